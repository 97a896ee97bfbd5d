"""What all tests share: which of them go by the wall clock, and what follows from it."""

import pytest

WITH_A_PEER = (
    "test_buses_",
    "test_can_",
    "test_conformance_",
    "test_gantry_device_",
    "test_modbus_",
    "test_own_driver",
    "test_serial_",
)
"""They speak with a peer in another thread or process."""
IN_REAL_TIME = ("test_daemon_", "test_latency_", "test_loop_process", "test_loop_clock")
NOT_BESIDE_OTHERS = ("test_socket_access",)
"""Another user reaches into their folder, which is closed where processes share the tests."""
TRIES_MORE = 2
"""A shared machine pauses any process for tens of milliseconds now and then, and that looks just
like the faults that these tests order."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        name = item.path.name
        if name.startswith((*WITH_A_PEER, *IN_REAL_TIME)):
            item.add_marker(pytest.mark.flaky(reruns=TRIES_MORE))
        if name.startswith((*WITH_A_PEER, *IN_REAL_TIME, *NOT_BESIDE_OTHERS)):
            item.add_marker(pytest.mark.wall_clock)
