"""The machine in the device: the simulated gantry, its counters, its amplifiers, its watchdog."""

from __future__ import annotations

import math
import os
import time
from collections import deque
from collections.abc import Sequence

from motorctl.hal import Driver, Inputs, Outputs, Status
from motorctl_devices.schedule import NEVER

PHASE = 0.12
"""Where in the device's period requests arrive once its clock is synchronised with them, a share of
the period. A request so much earlier, or later by the rest of the period, still reads the sample
that was taken on time."""
FOLLOW = 1 / 256
"""Gain of the synchronisation: the share of the difference that one request corrects."""
MOST_PERIODS = 1000
"""Bound on the work of one catching up; what is beyond it is dropped."""
REST_NS = 300_000_000
"""Amplifiers that are off for so long are off, and do not flicker. Convention."""
MOST_RESTS = 1000
INDEX_LATCHED = int(Status.INDEX_LATCHED)
AMPLIFIER_FAULT = int(Status.AMPLIFIER_FAULT)
ENCODER_LOST = int(Status.ENCODER_LOST)


class Machine:
    """What the firmware sees of motors and encoders, sampled by the device's own clock.

    A command acts from the moment it came: who reads and writes in one exchange calls `sample`
    first. Each channel has a watchdog: enabled and without a command for the watchdog's time, it
    gets 0 V and its amplifier is disabled. That stays until a command that disables it.
    """

    def __init__(
        self,
        driver: Driver,
        counter_bits: Sequence[int],
        watchdog_s: float | None,
        wrap_counts: Sequence[int | None],
        signed: Sequence[bool],
    ) -> None:
        driver.start_virtual_time()
        self._driver = driver
        n = len(counter_bits)
        self.channels = n
        self._bits = tuple(counter_bits)
        self._masks = tuple((1 << bits) - 1 for bits in counter_bits)
        self._period_ns = driver.period_s * 1e9
        self._watchdog_ns = NEVER
        self._watchdog_s = watchdog_s
        self._wrap_counts = tuple(wrap_counts)
        self._signed = tuple(signed)
        self._inputs, self._outputs = Inputs(n), Outputs(n)
        self._offsets = [0] * n
        self._instant_ns = 0.0
        self._heard_ns = [0] * n
        self._first = [0] * n
        self._least, self._most = [0] * n, [0] * n
        self.counts = [0] * n
        """What the counters show, each wrapped to its width, not negative."""
        self.index_counts = [0] * n
        self.status = [0] * n
        """`motorctl.hal.Status` of each channel; an index mark stays told until `index_told`."""
        self.volts = [0.0] * n
        self.enabled = [False] * n
        self.tripped = [False] * n
        """Where the watchdog took the amplifier away, and no command has disabled it since."""
        self._broken = [0] * n
        """AMPLIFIER_FAULT of the channels whose amplifiers are broken."""
        self._lost = [0] * n
        """ENCODER_LOST of the channels whose encoders are lost: their counts stand still."""
        self.silent = [False] * n
        """Channels whose drives hear, and tell nothing."""
        self.boot_id = (os.getpid() ^ time.time_ns()) & 0xFFFF
        self.samples = self.commands = self.watchdog_trips = self.restarts = 0
        self.watchdog_after_ns: int | None = None
        """From the last command that it heard to the volts that it took; None: it never tripped."""
        self.due_ns = NEVER
        """When the first watchdog fires."""
        self.off_ns: int | None = 0
        """Since when every amplifier is off; None while one is on."""
        self.rests_ns: deque[tuple[int, int]] = deque(maxlen=MOST_RESTS)
        """From when to when every amplifier was off, for REST_NS at least."""
        self.set_watchdog(watchdog_s)

    def open(self) -> None:
        """Power on."""
        self._driver.open()
        self._driver.read(self._inputs)
        for i, raw in enumerate(self._inputs.counts.tolist()):
            self._first[i] = self._least[i] = self._most[i] = raw
            left = self._wrap_counts[i]
            if left is not None:
                edge = 1 << (self._bits[i] - self._signed[i])
                self._offsets[i] = edge - left - raw
        self._instant_ns = float(time.monotonic_ns())
        self._show()

    def close(self) -> None:
        """Power off."""
        self._driver.safe()
        self._driver.close()

    def sample(self, now_ns: int) -> None:
        """Make the newest sample available to a request.

        The device's clock has a constant period and synchronises with its requests, as a servo
        drive's clock does with its master's cycle: a request that is late by less than most of a
        period still reads the sample that was taken on time.
        """
        self.catch_up(now_ns)
        error = (now_ns - self._instant_ns) / self._period_ns - PHASE
        if error > 0.5:
            error -= 1.0
        self._instant_ns += FOLLOW * error * self._period_ns

    def catch_up(self, now_ns: int) -> None:
        """Let the machine move until the last instant of sampling, under the volts in force."""
        periods = int((now_ns - self._instant_ns) // self._period_ns)
        if periods <= 0:
            return
        if periods > MOST_PERIODS:
            self._instant_ns = now_ns - MOST_PERIODS * self._period_ns
            periods = MOST_PERIODS
        for _ in range(periods):
            self._driver.advance()
        self._instant_ns += periods * self._period_ns
        self._show()

    def _show(self) -> None:
        """Take the counts of the instant."""
        inputs = self._inputs
        self._driver.read(inputs)
        self.samples += 1
        raws, marks, words = inputs.counts.tolist(), inputs.index_counts.tolist(), inputs.status
        for i in range(self.channels):
            raw = raws[i]
            if raw < self._least[i]:
                self._least[i] = raw
            elif raw > self._most[i]:
                self._most[i] = raw
            offset, mask = self._offsets[i], self._masks[i]
            if not self._lost[i]:
                self.counts[i] = raw + offset & mask
            self.index_counts[i] = marks[i] + offset & mask
            word = int(words[i]) | self._broken[i] | self._lost[i]
            self.status[i] = word | self.status[i] & INDEX_LATCHED

    def index_told(self) -> None:
        """Rearm the index latches: the last sample was sent."""
        for i in range(self.channels):
            self.status[i] &= ~INDEX_LATCHED

    def command(self, channel: int, volts: float, enable: bool, now_ns: int) -> None:
        """Set the command of a channel's amplifier; `apply` puts it into effect.

        Parameters
        ----------
        channel
            Index of the channel.
        volts
            Voltage [V]; what is not finite counts as disabled.
        enable
            Whether the amplifier is on; a tripped one stays off until it was disabled.
        now_ns
            Time of the command [ns].
        """
        self._heard_ns[channel] = now_ns
        self.tripped[channel] = self.tripped[channel] and enable
        able = not (self.tripped[channel] or self._broken[channel])
        good = enable and able and math.isfinite(volts)
        self.volts[channel] = volts if good else 0.0
        self.enabled[channel] = good

    def apply(self, now_ns: int) -> None:
        """Let what `command` set act from the last sampling instant on, and count a command.

        The machine catches up first, so that the time before is under the volts of before.
        """
        self.catch_up(now_ns)
        self.commands += 1
        self._write()

    def disable_all(self) -> None:
        """Zero and disable every channel, and forget that the watchdog fired."""
        self.catch_up(time.monotonic_ns())
        for i in range(self.channels):
            self.volts[i], self.enabled[i], self.tripped[i] = 0.0, False, False
        self._write()

    def set_watchdog(self, watchdog_s: float | None) -> None:
        """Set the watchdog's time; None and 0 switch it off."""
        self._watchdog_ns = int(watchdog_s * 1e9) if watchdog_s else NEVER
        self._write_due()

    def check_watchdog(self, now_ns: int) -> None:
        """Take the amplifiers away from whom no command came; call from `due_ns` on."""
        heard_ns = self.due_ns - self._watchdog_ns
        tripped = self.due_ns <= now_ns
        self.watchdog_trips += tripped
        while (due_ns := self.due_ns) <= now_ns:
            # It acts when it is due, however late this process gets to it.
            self.catch_up(due_ns)
            for i in range(self.channels):
                if self.enabled[i] and due_ns - self._heard_ns[i] >= self._watchdog_ns:
                    self.volts[i], self.enabled[i], self.tripped[i] = 0.0, False, True
            self._write()
        if tripped:
            self.watchdog_after_ns = time.monotonic_ns() - heard_ns

    def break_amplifier(self, channel: int, broken: bool) -> None:
        """Let an amplifier report a fault and give nothing, or be in order again."""
        self.catch_up(time.monotonic_ns())
        self._broken[channel] = AMPLIFIER_FAULT if broken else 0
        self.status[channel] = self.status[channel] & ~AMPLIFIER_FAULT | self._broken[channel]
        if broken:
            self.volts[channel], self.enabled[channel] = 0.0, False
        self._write()

    def lose_encoder(self, channel: int, lost: bool) -> None:
        """Let a count stand still and the status say so, or the encoder be there again."""
        self.catch_up(time.monotonic_ns())
        self._lost[channel] = ENCODER_LOST if lost else 0
        self.status[channel] = self.status[channel] & ~ENCODER_LOST | self._lost[channel]

    def silence(self, channel: int, silent: bool) -> None:
        """Let a channel's drive tell nothing from now on, or tell again."""
        self.silent[channel] = silent

    def shift_counter(self, channel: int, counts: int) -> None:
        """Let a counter show so many counts more from now on."""
        self._offsets[channel] += counts
        self.counts[channel] = self.counts[channel] + counts & self._masks[channel]

    def restart(self) -> None:
        """Begin anew as after a power failure: other boot id, counters at zero, no volts."""
        self.disable_all()
        for i in range(self.channels):
            self._offsets[i] -= self.counts[i]
            self.counts[i] = 0
            self.status[i] &= ~INDEX_LATCHED
        self.boot_id = self.boot_id + 1 & 0xFFFF
        self.restarts += 1
        self.set_watchdog(self._watchdog_s)

    def signed(self, channel: int, count: int) -> int:
        """Return a counter's value as signed, from two's complement."""
        bits = self._bits[channel]
        return count - (1 << bits) if count >> (bits - 1) else count

    def travelled_counts(self) -> list[tuple[int, int]]:
        """Return how far each carriage went to either side of its place at power-on [counts]."""
        return [
            (low - first, high - first)
            for first, low, high in zip(self._first, self._least, self._most, strict=True)
        ]

    @property
    def any_enabled(self) -> bool:
        """Whether an amplifier is enabled."""
        return True in self.enabled

    def _write(self) -> None:
        outputs = self._outputs
        for i in range(self.channels):
            outputs.volts[i] = self.volts[i]
            outputs.enable[i] = self.enabled[i]
        if True in self.enabled:
            off_ns, on_ns = self.off_ns, time.monotonic_ns()
            if off_ns is not None and on_ns - off_ns >= REST_NS:
                self.rests_ns.append((off_ns, on_ns))
            self.off_ns = None
        elif self.off_ns is None:
            self.off_ns = time.monotonic_ns()
        self._write_due()
        self._driver.write(outputs)

    def _write_due(self) -> None:
        due = NEVER
        for i in range(self.channels):
            if self.enabled[i]:
                due = min(due, self._heard_ns[i] + self._watchdog_ns)
        self.due_ns = due
