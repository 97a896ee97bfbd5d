"""Drivers that are wrong in what they say of themselves."""

from __future__ import annotations

import contextlib
import socket
from typing import Any, ClassVar

from pydantic import BaseModel
from wire_driver import WireDriver, WireOptions

from broken_drivers.registry import ABSENT, UNOPENED, UNTOUCHED, fails
from motorctl.hal import RateBudget, Status


@fails("test_it_is_a_driver_and_is_found_under_its_name")
class LosesChannels(WireDriver):
    def __init__(self, options, channels, period_s):
        super().__init__(options, channels, period_s)
        self.channels = ()


@fails("test_options_refuse_keys_that_they_do_not_know")
class TakesAnyKey(WireDriver):
    class Options(WireOptions):
        model_config: ClassVar[Any] = {"extra": "ignore"}


class Line(BaseModel):
    baud: int = 115200


@fails("test_options_refuse_keys_that_they_do_not_know")
class TakesAnyNestedKey(WireDriver):
    class Options(WireOptions):
        line: Line = Line()


@fails("test_the_rate_budget_is_positive_and_shows_its_arithmetic")
class HasNoArithmetic(WireDriver):
    def rate_budget(self) -> RateBudget:
        return RateBudget(10_000.0, "fast")


@fails("test_the_rate_budget_is_positive_and_shows_its_arithmetic")
class IsTooSlowForItself(WireDriver):
    def rate_budget(self) -> RateBudget:
        return RateBudget(10.0, "one call in memory takes 100 ms")


@fails("test_it_tells_the_switches_of_each_channel_or_that_nobody_knows")
class TellsTheSwitchesOfOneChannel(WireDriver):
    def switches(self) -> list[Status]:
        return [Status.HOME_SWITCH]


@fails("test_it_tells_the_switches_of_each_channel_or_that_nobody_knows")
class TakesAFaultForASwitch(WireDriver):
    def switches(self) -> list[Status]:
        return [Status.AMPLIFIER_FAULT for _ in self.channels]


@fails("test_it_tells_the_way_of_each_channel_or_that_nobody_knows")
class TellsTheWayOfOneChannel(WireDriver):
    def ways(self) -> list[None]:
        return [None]


@fails(UNTOUCHED)
class ConnectsAtOnce(WireDriver):
    def __init__(self, options, channels, period_s):
        super().__init__(options, channels, period_s)
        socket.socket().close()


@fails(UNTOUCHED)
class AsksTheDeviceForItsRate(WireDriver):
    def rate_budget(self) -> RateBudget:
        with contextlib.suppress(OSError), open("/dev/ptmx", "rb"):  # noqa: PTH123
            pass
        return super().rate_budget()


@fails("test_a_good_layout_has_no_problems")
class ComplainsOfNothing(WireDriver):
    def problems(self):
        return [(("port",), "wire0 is a bad name")]


@fails("test_virtual_time_is_refused_where_it_is_not_supported")
class PretendsVirtualTime(WireDriver):
    def start_virtual_time(self) -> None:
        pass


@fails("test_before_open_read_write_and_safe_never_raise", ABSENT, UNOPENED)
class IsUnsafeBeforeOpen(WireDriver):
    was_open = False

    def open(self) -> None:
        super().open()
        self.was_open = True

    def safe(self) -> None:
        if not self.was_open:
            raise AttributeError("no device")
        super().safe()
