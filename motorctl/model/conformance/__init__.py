"""One suite of checks that every effect passes, for third parties' effects as well.

In a test file of your own::

    from motorctl.model.conformance import EffectConformance

    class TestMyEffect(EffectConformance):
        @pytest.fixture
        def effect(self):
            return MyEffect(MyOptions(peak_velocity_m_s=0.5))

or, without a test file::

    pytest -p motorctl.model.conformance --pyargs motorctl.model.conformance \\
        --effect package.module:MyEffect --effect-options '{"peak_velocity_m_s": 0.5}'

`docs/eddy_brake.py` is a complete example of an effect. This package is a pytest plug-in because of
its options; it needs pytest and hypothesis, which running motorctl does not.
"""

from __future__ import annotations

import pytest

# The checks' bare asserts then tell values, in a third party's test run too.
pytest.register_assert_rewrite(
    *(f"{__name__}.{module}" for module in ("declarations", "formulas", "memory", "search"))
)

from motorctl.model.conformance.suite import EffectConformance  # noqa: E402

__all__ = ["EffectConformance"]


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options that name an effect on the command line."""
    group = parser.getgroup("motorctl effects")
    group.addoption("--effect", metavar="NAME|PACKAGE.MODULE:CLASS", help="the effect to check")
    group.addoption("--effect-options", metavar="JSON", default="{}", help="its options")
