"""Flight records: the last seconds before a fault at full rate, each an ordinary log."""

from motorctl.flight.records import (
    FOLDER,
    FlightRecord,
    Listing,
    find_record,
    free_record_path,
    later_than_all,
    list_records,
    load_record,
    remove_oldest,
)

__all__ = [
    "FOLDER",
    "FlightRecord",
    "Listing",
    "find_record",
    "free_record_path",
    "later_than_all",
    "list_records",
    "load_record",
    "remove_oldest",
]
