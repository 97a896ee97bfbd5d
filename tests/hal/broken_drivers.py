"""Drivers with one thing wrong each, and the checks that fail for it: these and no others."""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import signal
import socket
import time
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from pydantic import BaseModel
from wire_driver import CODES, FULL_SCALE_V, WireDriver, WireOptions, WireRig

from motorctl.hal import Driver, Inputs, Outputs, RateBudget, RunError, Status

BROKEN: dict[type[Driver], set[str]] = {}


def fails(*checks: str) -> Callable[[type[Driver]], type[Driver]]:
    """Note which checks have to fail."""

    def note(cls: type[Driver]) -> type[Driver]:
        BROKEN[cls] = set(checks)
        return cls

    return note


UNOPENED = "test_safe_reaches_the_device_without_open"
ANEW = "test_it_opens_anew_in_another_thread"
ABSENT = "test_open_names_the_device_that_is_absent"
DAMAGED = "test_a_damaged_reply_never_becomes_a_count"
LOCKED = "test_opening_anew_leaves_other_threads_their_turn"
LOST = "test_a_lost_reply_is_stale"
RAISES = "test_nothing_that_happens_makes_it_raise"
REOPENED = "test_close_and_open_bring_a_vanished_device_back"
SAFE_WITHOUT = "test_safe_after_vanishing_never_raises"
SILENCE = "test_silence_is_stale_for_as_long_as_it_lasts"
TOLD = "test_a_damaged_reply_is_told_as_corrupt"
VANISHED = "test_a_vanished_device_is_communication_lost"
UNTOUCHED = "test_nothing_is_touched_before_open"
VIRTUAL = "test_virtual_time_gives_the_same_run_twice"


# What it says of itself


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


# Values


@fails("test_arrays_are_filled_in_place")
class ReplacesArrays(WireDriver):
    def read(self, inputs: Inputs) -> None:
        status = inputs.status
        super().read(inputs)
        inputs.status = status.copy()


@fails("test_arrays_are_filled_in_place")
class ClipsInPlace(WireDriver):
    def write(self, outputs: Outputs) -> None:
        np.clip(outputs.volts, -FULL_SCALE_V, FULL_SCALE_V, out=outputs.volts)
        super().write(outputs)


@fails("test_only_its_own_slices_are_touched")
class FillsTheWholeArray(WireDriver):
    def read(self, inputs: Inputs) -> None:
        super().read(inputs)
        if inputs.status.base is not None:
            inputs.status.base[-1] = 0


@fails("test_only_its_own_slices_are_touched")
class KeepsTheFirstArrays(WireDriver):
    first: Any = None

    def read(self, inputs: Inputs) -> None:
        if self.first is None:
            self.first = Inputs(0)
            self.first.counts, self.first.status = inputs.counts, inputs.status
        super().read(self.first)


@fails("test_counts_come_through_over_the_whole_width_of_the_counter")
class KnowsOnly30Bits(WireDriver):
    def decode(self, reply):
        counts = super().decode(reply)
        return counts and [(count + 2**30) % 2**31 - 2**30 for count in counts]


@fails("test_volts_arrive_within_quantisation")
class RoundsCoarsely(WireDriver):
    def code(self, volts: float) -> int:
        code = super().code(volts)
        return code if abs(volts) > 0.1 else code // 8 * 8


@fails("test_outputs_are_zero_and_disabled_until_they_are_written")
class OpensWithTheLastCommand(WireDriver):
    last_sent = ([0, 0], 0)

    def write(self, outputs: Outputs) -> None:
        super().write(outputs)
        if self.device is not None:
            codes = np.round(self.device.volts / FULL_SCALE_V * CODES).astype(int)
            self.last_sent = (codes.tolist(), 3)

    def open(self) -> None:
        super().open()
        self.send(*self.last_sent)


@fails("test_a_disabled_channel_gets_zero_whatever_volts_says")
class ForgetsEnable(WireDriver):
    def permitted(self, on: bool, volts: float) -> tuple[bool, float]:
        return on and bool(np.isfinite(volts)), volts if np.isfinite(volts) else 0.0


@fails("test_volts_beyond_the_range_are_clamped_and_never_wrap")
class WrapsVolts(WireDriver):
    def code(self, volts: float) -> int:
        return (round(volts / FULL_SCALE_V * CODES) + 32768) % 65536 - 32768


@fails("test_volts_that_are_no_number_never_reach_the_amplifier")
class StaysEnabledWithoutANumber(WireDriver):
    def permitted(self, on: bool, volts: float) -> tuple[bool, float]:
        return on, volts if on and np.isfinite(volts) else 0.0


@fails("test_volts_that_are_no_number_never_reach_the_amplifier")
class TurnsInfinityAround(WireDriver):
    def permitted(self, on: bool, volts: float) -> tuple[bool, float]:
        return super().permitted(on, -1e9 if volts == np.inf else volts)


# Faults


@fails(LOST, DAMAGED, SILENCE)
class IsNeverStale(WireDriver):
    def stale(self) -> Status:
        return Status(0)


@fails(LOST, DAMAGED, SILENCE)
class ForgetsTheCountWhenStale(WireDriver):
    def stale(self) -> Status:
        if self.device is not None and not self.device.gone:
            self.last[:] = 0
        return Status.STALE


@fails(LOST, DAMAGED)
class GuessesOneCountOn(WireDriver):
    waits = 0

    def decode(self, reply):
        self.waits = 0
        return super().decode(reply)

    def stale(self) -> Status:
        self.waits += 1
        lost_one = self.waits == 1 and self.device is not None and not self.device.silent
        if lost_one and not self.device.gone:
            self.last += 1
        return Status.STALE


@fails(DAMAGED, TOLD)
class ChecksNoSum(WireDriver):
    def decode(self, reply):
        return np.frombuffer(reply, "<i4")[1 : 1 + self.size].tolist()

    def read(self, inputs: Inputs) -> None:
        super().read(inputs)
        # This one is not about restarts.
        if self.device is not None and self.device.session != self.session:
            self.restarted()
            inputs.status[:] |= np.uint32(self.latched)


@fails(TOLD)
class SaysNothingOfDamage(WireDriver):
    def corrupt(self) -> Status:
        return Status(0)


@fails(DAMAGED, TOLD, RAISES)
class RaisesOnGarbage(WireDriver):
    def corrupt(self) -> Status:
        raise ValueError("bad checksum")


@fails(SILENCE)
class CallsSilenceAFault(WireDriver):
    waits = 0

    def decode(self, reply):
        self.waits = 0
        return super().decode(reply)

    def stale(self) -> Status:
        self.waits += 1
        return Status.STALE | (Status.COMMUNICATION_LOST if self.waits > 30 else Status(0))


@fails(SILENCE)
class NeverRecovers(WireDriver):
    waits = 0

    def decode(self, reply):
        return super().decode(reply) if self.waits < 45 else None

    def stale(self) -> Status:
        self.waits += self.device is not None and self.device.silent and not self.device.faults
        return Status.STALE

    def open(self) -> None:
        super().open()
        self.waits = 0


@fails("test_no_call_waits_for_a_silent_device")
class WaitsTooLong(WireDriver):
    def stale(self) -> Status:
        if self.device is not None and not self.device.gone:
            time.sleep(4e-3)
        return Status.STALE


@fails(VANISHED)
class TriesToReconnect(WireDriver):
    def vanished(self) -> None:
        super().vanished()
        time.sleep(4e-3)


@fails(VANISHED, REOPENED, SAFE_WITHOUT)
class DoesNotMissTheDevice(WireDriver):
    def vanished(self) -> None:
        pass


@fails(VANISHED, REOPENED, SAFE_WITHOUT, RAISES)
class RaisesWhenTheDeviceIsGone(WireDriver):
    def vanished(self) -> None:
        super().vanished()
        raise ConnectionResetError("the wire is cut")


@fails(REOPENED, SAFE_WITHOUT)
class IsUnsafeWithoutADevice(WireDriver):
    def safe(self) -> None:
        if self.device is not None and self.device.gone:
            raise ConnectionResetError("the wire is cut")
        super().safe()


@fails(SAFE_WITHOUT, REOPENED)
class LingersInSafe(WireDriver):
    def safe(self) -> None:
        if self.device is not None and self.device.gone:
            time.sleep(0.25)
        super().safe()


@fails(REOPENED)
class RemembersThatItWasLost(WireDriver):
    def open(self) -> None:
        lost = self.latched & Status.COMMUNICATION_LOST
        super().open()
        self.latched |= lost


@fails("test_a_restarted_device_is_never_taken_for_the_old_one")
class DoesNotNoticeARestart(WireDriver):
    def restarted(self) -> None:
        pass


@fails("test_a_restarted_device_is_never_taken_for_the_old_one")
class NoticesARestartTooLate(WireDriver):
    answers = 0

    def restarted(self) -> None:
        self.answers += 1
        if self.answers > 1:
            super().restarted()


@fails(RAISES)
class RaisesOnStrangeVolts(WireDriver):
    def write(self, outputs: Outputs) -> None:
        for volts, on in zip(outputs.volts, outputs.enable, strict=True):
            if on and 0.0 < abs(float(volts)) < 1e-300:
                raise FloatingPointError("underflow")
        super().write(outputs)


# Life


@fails(ABSENT)
class DoesNotSayWhichDevice(WireDriver):
    def refuse(self) -> None:
        raise RunError("no answer")


@fails(ABSENT)
class ShowsATraceback(WireDriver):
    def refuse(self) -> None:
        raise FileNotFoundError("wire0")


@fails(ABSENT)
class CannotTryAgain(WireDriver):
    failed = False

    def refuse(self) -> None:
        self.failed = True
        super().refuse()

    def open(self) -> None:
        super().open()
        if self.failed:
            self.refuse()


@fails("test_safe_ends_at_zero_and_disabled", "test_closing_leaves_the_device_at_zero_and_disabled")
class ForgetsAChannelInSafe(WireDriver):
    def safe(self) -> None:
        if self.device is None:
            super().safe()
        elif not self.device.gone:
            self.device.volts[0], self.device.enabled[0] = 0.0, False


@fails(UNOPENED)
class IsSafeOnlyWhileOpen(WireDriver):
    def safe(self) -> None:
        if self.device is not None:
            super().safe()


@fails("test_closing_leaves_the_device_at_zero_and_disabled")
class WritesAfterClosing(WireDriver):
    old: Any = None

    def close(self) -> None:
        self.old = self.device
        super().close()

    def write(self, outputs: Outputs) -> None:
        if self.device is not None or self.old is None:
            super().write(outputs)
        else:
            self.device = self.old
            super().write(outputs)
            self.device = None

    def safe(self) -> None:
        if self.device is not None or self.old is None:
            super().safe()


@fails("test_closing_leaves_the_device_at_zero_and_disabled")
class RaisesAfterClosing(WireDriver):
    was_open = False

    def open(self) -> None:
        super().open()
        self.was_open = True

    def read(self, inputs: Inputs) -> None:
        if self.was_open and self.device is None:
            raise ValueError("file descriptor cannot be a negative integer (-1)")
        super().read(inputs)


@fails("test_it_opens_again_after_closing", ANEW, LOCKED)
class OpensTwice(WireDriver):
    times = 0

    def open(self) -> None:
        self.times += 1
        if self.times > 2:
            raise RunError(f"port {self.port}: in use")
        super().open()


@fails(ANEW, LOCKED)
class IsBoundToItsThread(WireDriver):
    def open(self) -> None:
        signal.signal(signal.SIGUSR2, signal.SIG_DFL)  # the main thread alone may do that
        super().open()


@fails(LOCKED)
class WaitsWithPythonsLock(WireDriver):
    def open(self) -> None:
        ctypes.PyDLL(None).usleep(100_000)
        super().open()


@fails("test_memory_does_not_grow")
class KeepsWhatItSaw(WireDriver):
    def __init__(self, options, channels, period_s):
        super().__init__(options, channels, period_s)
        self.seen: list[int] = []

    def read(self, inputs: Inputs) -> None:
        super().read(inputs)
        self.seen.append(0)


@fails(VIRTUAL)
class LooksAtTheClock(WireDriver):
    """In virtual time its carriage moves by itself, and no run is like the other."""

    supports_virtual_time = True
    runs = itertools.count()
    virtual = False

    def start_virtual_time(self) -> None:
        self.virtual, self.run = True, next(self.runs)

    def advance(self) -> None:
        self.last += 1 + self.run

    def read(self, inputs: Inputs) -> None:
        if self.virtual:
            inputs.counts[:] = self.last
        else:
            super().read(inputs)


def rig_class(cls: type[Driver]) -> type[WireRig]:
    """Make the rig of a broken driver."""
    return type(f"{cls.__name__}Rig", (WireRig,), {"driver_class": cls})
