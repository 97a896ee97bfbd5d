"""Heartbeats that wait while the loop stands still are no silence of the drive that sent them."""

from __future__ import annotations

import struct
from unittest.mock import patch

import can
import numpy as np
from canopen_bench import PERIOD_S, data, driver
from hypothesis import given
from hypothesis import strategies as st

from motorctl.hal import Inputs, Outputs, Status
from motorctl_canopen import exchange as exchange_module

HEARTBEAT_S = 0.1
OPERATIONAL, OPERATION_ENABLED = 0x05, 0x27
SILENT = int(Status.COMMUNICATION_LOST | Status.DEVICE_RESTARTED | Status.ENCODER_LOST)


class PausedBus:
    """One drive that answers at once and sends its heartbeats, and the clock of both.

    Once `armed`, the loop stands still after so many readings of the clock more.
    """

    lost = passing = status = 0

    def __init__(self, pause_s: float, at: int) -> None:
        self.pause_s, self.left = pause_s, at
        self.now_s = 0.0
        self.armed = False
        self._heartbeats = 0
        self._waiting: list[can.Message] = []

    def monotonic(self) -> float:
        """Return the time as motorctl reads it [s], and let the pause follow where it is due."""
        told_s = self.now_s
        self.now_s += 1e-6
        if self.armed:
            self.left -= 1
            if self.left == 0:
                self.now_s += self.pause_s
        return told_s

    def send(self, message: can.Message) -> bool:
        if message.arbitration_id == 0x80:
            told = bytearray(struct.pack("<Hi", OPERATION_ENABLED, 0))
            self._come(0x185, told)
        return True

    def receive(self, timeout_s: float) -> can.Message | None:
        while self._heartbeats < int(self.now_s / HEARTBEAT_S):
            self._heartbeats += 1
            self._come(0x705, bytearray([OPERATIONAL]))
        if self._waiting:
            return self._waiting.pop(0)
        self.now_s += timeout_s
        return None

    def more(self) -> bool:
        return False

    def _come(self, identifier: int, told: bytearray) -> None:
        self._waiting.append(
            can.Message(arbitration_id=identifier, is_extended_id=False, data=told)
        )


@given(st.floats(0.0, 30.0), st.integers(1, 12), st.floats(0.0, 0.1))
def test_a_pause_at_whatever_moment_of_the_exchange_is_no_silence_of_a_drive_that_spoke(
    pause_s, at, since_s
):
    made = driver(data(sync={"wait_s": 2e-4}, heartbeat_s=HEARTBEAT_S))
    made.prepare()
    bus = PausedBus(pause_s, at)
    made._exchange.link = made._link = bus  # type: ignore[assignment]
    inputs, outputs = Inputs(1), Outputs(1)
    with patch.object(exchange_module, "time", bus):
        made._nodes[0].begin(0.0)
        made._nodes[0].nmt = OPERATIONAL
        for _ in range(int((0.1 + since_s) / PERIOD_S)):
            made.read(inputs)
            made.write(outputs)
            bus.now_s += PERIOD_S
        bus.armed = True
        for _ in range(6):
            made.read(inputs)
            made.write(outputs)
            bus.now_s += PERIOD_S
            assert not np.any(inputs.status & SILENT), Status(int(inputs.status[0]) & 0xFFF)
        assert bus.left <= 0
