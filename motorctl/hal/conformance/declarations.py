"""What a driver says of itself, without a device."""

from __future__ import annotations

import math

import pytest

from motorctl.hal import Driver, DriverOptions, Status, driver_class
from motorctl.hal.conformance.driver_bench import Bench
from motorctl.hal.conformance.io_watch import touched_by
from motorctl.hal.conformance.rig import Rig


class DeclarationChecks:
    """Class, options, budget and layout: nothing here opens the driver."""

    def test_it_is_a_driver_and_is_found_under_its_name(self, rig: Rig) -> None:
        """Its class is complete, and its entry point leads to it."""
        cls = rig.driver_class
        assert isinstance(cls, type)
        assert issubclass(cls, Driver)
        assert issubclass(cls.Options, DriverOptions)
        driver = rig.make_driver()
        assert driver.channels == tuple(rig.channels)
        assert driver.period_s == rig.period_s
        assert driver.exchange_delay_periods >= 0.0
        assert driver.watchdog_s is None or driver.watchdog_s > 0.0
        if rig.type_name is not None:
            assert driver_class(rig.type_name) is cls

    def test_options_refuse_keys_that_they_do_not_know(self, rig: Rig) -> None:
        """A typing error in a configuration is told with its key, in nested tables as well."""
        with pytest.raises(ValueError, match="no_such_key"):
            rig.driver_class.Options.model_validate(
                {**rig.options, "no_such_key": 1}, context=dict(rig.directory_context())
            )
        schema = rig.driver_class.Options.model_json_schema()
        tables = {"the options": schema, **schema.get("$defs", {})}
        open_ones = [
            name
            for name, table in tables.items()
            if "properties" in table and table.get("additionalProperties") is not False
        ]
        assert not open_ones, f"these tables take unknown keys: {open_ones}"

    def test_the_rate_budget_is_positive_and_shows_its_arithmetic(self, rig: Rig) -> None:
        """Whoever is refused a rate can follow why; the rig's own rate is within it."""
        budget = rig.make_driver().rate_budget()
        assert math.isfinite(budget.max_rate_hz)
        assert budget.max_rate_hz >= 1.0 / rig.period_s * (1.0 - 1e-9)
        words = budget.arithmetic.split()
        assert any(character.isdigit() for word in words for character in word), budget.arithmetic
        assert sum(word.isalpha() for word in words) >= 3, budget.arithmetic
        assert rig.make_driver().rate_budget() == budget

    def test_nothing_is_touched_before_open(self, rig: Rig) -> None:
        """Checking a configuration never moves a machine: no socket, no device, no program."""
        drivers: list[Driver] = []
        touched = touched_by(lambda: drivers.append(rig.make_driver()))
        assert not touched, f"the constructor touches {touched}"
        (driver,) = drivers
        for name in ("rate_budget", "problems", "switches", "ways", "prepare"):
            touched = touched_by(getattr(driver, name))
            assert not touched, f"{name} touches {touched}"

    def test_a_good_layout_has_no_problems(self, rig: Rig) -> None:
        """Options and channels of the rig fit together."""
        problems = rig.make_driver().problems()
        assert not problems, problems

    def test_it_tells_the_switches_of_each_channel_or_that_nobody_knows(self, rig: Rig) -> None:
        """Whoever homes an axis can be told that its switch would never come."""
        driver = rig.make_driver()
        told = driver.switches()
        every = Status.HOME_SWITCH | Status.INDEX_LATCHED
        every |= Status.LIMIT_NEGATIVE | Status.LIMIT_POSITIVE
        if told is not None:
            assert len(told) == len(rig.channels)
            assert all(0 <= int(bits) <= int(every) and not bits & ~every for bits in told)
        assert math.isfinite(driver.sampled_apart_s)
        assert driver.sampled_apart_s >= 0.0

    def test_it_tells_the_way_of_each_channel_or_that_nobody_knows(self, rig: Rig) -> None:
        """A simulated axis that would always meet its ends is refused before it runs."""
        told = rig.make_driver().ways()
        if told is not None:
            assert len(told) == len(rig.channels)
            for way in told:
                assert way is None or way.reach_m[0] < way.reach_m[1]

    def test_virtual_time_is_refused_where_it_is_not_supported(self, rig: Rig) -> None:
        """What cannot run in virtual time says so, and names itself."""
        if rig.driver_class.supports_virtual_time:
            pytest.skip("it supports virtual time")
        driver = rig.make_driver()
        for call in (driver.start_virtual_time, driver.advance):
            with pytest.raises(TypeError, match=type(driver).__name__):
                call()

    def test_before_open_read_write_and_safe_never_raise(self, rig: Rig) -> None:
        """The supervisor makes outputs safe through drivers that it never opened."""
        bench = Bench(rig)
        bench.safe()
        bench.read()
        bench.write()
        bench.safe()
