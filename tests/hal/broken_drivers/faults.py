"""Drivers that are wrong where something fails."""

from __future__ import annotations

import time

import numpy as np
from wire_driver import WireDriver

from broken_drivers.registry import (
    DAMAGED,
    LOST,
    RAISES,
    REOPENED,
    SAFE_WITHOUT,
    SILENCE,
    TOLD,
    VANISHED,
    fails,
)
from motorctl.hal import Inputs, Outputs, Status


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
