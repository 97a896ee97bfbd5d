"""One suite of checks that every driver passes, for third parties' drivers as well.

In a test file of your own::

    from motorctl.hal.conformance import DriverConformance, Rig

    class MyRig(Rig):
        ...

    class TestMyDriver(DriverConformance):
        @pytest.fixture
        def rig(self):
            with MyRig() as rig:
                yield rig

or, without a test file::

    pytest -p motorctl.hal.conformance --pyargs motorctl.hal.conformance --driver-rig module:MyRig
    pytest -p motorctl.hal.conformance --pyargs motorctl.hal.conformance \\
        --driver NAME --driver-options '{"port": "/dev/ttyUSB0"}'

`docs/drivers/your_own.md` has a complete example. This package is a pytest plug-in because of its
options; it needs pytest, which running motorctl does not.
"""

from __future__ import annotations

import pytest

# The checks' bare asserts then tell values, in a third party's test run too.
pytest.register_assert_rewrite(
    *(
        f"{__name__}.{module}"
        for module in ("counts_and_volts", "declarations", "driver_bench", "faults", "life")
    )
)

from motorctl.hal.conformance.rig import Received, Rig  # noqa: E402
from motorctl.hal.conformance.suite import DriverConformance  # noqa: E402

__all__ = ["DriverConformance", "Received", "Rig"]


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options that name a driver or a rig on the command line."""
    group = parser.getgroup("motorctl drivers")
    group.addoption("--driver-rig", metavar="PACKAGE.MODULE:RIG", help="rig of the driver to check")
    group.addoption("--driver", metavar="TYPE", help="or the driver, as `type` in a configuration")
    group.addoption("--driver-options", metavar="JSON", default="{}", help="its options")
    group.addoption("--driver-channels", metavar="N", type=int, default=2, help="default: 2")
    group.addoption("--driver-rate-hz", metavar="HZ", type=float, default=200.0, help="default 200")
    group.addoption(
        "--driver-opens",
        action="store_true",
        help="its device is there: open it; it is sent zero volts and disable, nothing else",
    )
    group.addoption("--driver-exchanges", metavar="N", type=int, help="exchanges of the endurance")
