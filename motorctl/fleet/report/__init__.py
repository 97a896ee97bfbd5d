"""A fleet as one page: what to look at first, every machine, findings a click from their logs."""

from motorctl.fleet.report.page import write_fleet_page

__all__ = ["write_fleet_page"]
