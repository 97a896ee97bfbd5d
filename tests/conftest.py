"""What all tests share: exchanges with another process by the wall clock may be tried again."""

import pytest

BY_THE_WALL_CLOCK = (
    "test_buses_",
    "test_can_",
    "test_conformance_",
    "test_gantry_device_",
    "test_modbus_",
    "test_own_driver",
    "test_serial_",
)
"""They speak with a peer in another thread or process. A shared machine pauses either side for tens
of milliseconds now and then, and that looks just like the faults that the tests order."""
TRIES_MORE = 2


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.path.name.startswith(BY_THE_WALL_CLOCK):
            item.add_marker(pytest.mark.flaky(reruns=TRIES_MORE))
