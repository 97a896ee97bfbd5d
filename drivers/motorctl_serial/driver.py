"""The driver of a box on a serial line, behind the doors of `motorctl.hal.Driver`."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from typing import ClassVar

import numpy as np

from motorctl.hal import (
    Channel,
    Driver,
    DriverOptions,
    FirstAxis,
    FirstOptions,
    Inputs,
    Outputs,
    RateBudget,
    RunError,
    Status,
    kernels_cached,
    serial_line,
    specialise,
)

with kernels_cached():
    from motorctl_serial import frames, receiver
from motorctl_serial import budget, session
from motorctl_serial.first_options import first_options
from motorctl_serial.options import SerialOptions
from motorctl_serial.port import Port
from motorctl_serial.protocol import (
    LONGEST_BODY,
    MOST_CHANNELS,
    VOLT_CODES,
    Capabilities,
    FrameType,
    bare,
)
from motorctl_serial.receiver import News

WIDEST_COUNTER_BITS = 32
WATCHDOG_PERIODS = 2
READS_A_TICK = 2
"""Of `port.CHUNK_BYTES` each; whatever is beyond them is too old to be worth the time."""

FEW_BYTES = 1024
"""A read of fewer has emptied the line; a backlog gives 4095 at once on a terminal."""

DELAY_PERIODS = {"poll": 0.0, "exchange": 1.0, "stream": 0.5}

# Plain integers: an operation on an enum costs about a microsecond.
_FRESH, _REFUSED = int(News.FRESH), int(News.REFUSED)
_RESTARTED, _ENOUGH = int(News.RESTARTED), int(News.FRESH | News.ANSWERED)
_GONE_BITS = int(Status.BUS_OFF | Status.COMMUNICATION_LOST)
_CLOSED_BITS = int(Status.COMMUNICATION_LOST)
_RESTART_BITS = int(Status.DEVICE_RESTARTED | Status.ENCODER_LOST)


class SerialDriver(Driver):
    """One box of amplifiers and encoders; ``docs/drivers/serial.md`` has the protocol.

    In mode poll a read sends for its sample and waits for it, at most `SerialOptions.wait_s`. In
    the other modes nothing waits.
    """

    Options: ClassVar[type[DriverOptions]] = SerialOptions

    def __init__(
        self, options: DriverOptions, channels: Sequence[Channel], period_s: float
    ) -> None:
        super().__init__(options, channels, period_s)
        assert isinstance(options, SerialOptions)
        self._settings = options
        self.medium = serial_line(options.port)
        self.device: Capabilities | None = None
        """What the device said of itself at the last `open`."""
        self.exchange_delay_periods = DELAY_PERIODS[options.mode]
        self.watchdog_s = options.watchdog_s
        self._polls = options.mode == "poll"
        self._exchanges = options.mode == "exchange"
        self._streams = options.mode == "stream"
        self._wait_s = options.wait_s or budget.DEFAULT_WAIT_PERIODS * period_s
        self.longest_wait_s = self._wait_s if self._polls else 0.0
        self._command_type = int(
            FrameType.EXCHANGE if options.mode == "exchange" else FrameType.COMMAND
        )
        self._session_channels = max(channel.number for channel in self.channels) + 1
        self._port: Port | None = None
        self._restarted = False
        self._carried = 0
        self._sequence = 0
        self._codes_per_volt = 0.0
        self._rx = receiver.make_receiver()
        self._numbers = np.array([channel.number for channel in self.channels], np.int64)
        self._body = np.zeros(LONGEST_BODY + frames.CRC_BYTES, np.uint8)
        self._wire = np.zeros(LONGEST_BODY + frames.OVERHEAD_BYTES, np.uint8)
        self._command = self._wire.data[: budget.command_wire_bytes(self._session_channels)]
        self._poll_frames: tuple[bytes, ...] = ()
        self._take: Callable[..., int] = receiver.take
        self._expect: Callable[..., None] = receiver.expect
        self._command_sent: Callable[..., None] = receiver.command_sent
        self._lose_count: Callable[..., None] = receiver.lose_count
        self._deliver: Callable[..., None] = receiver.deliver
        self._put_command: Callable[..., int] = frames.put_command

    @classmethod
    def first_options(cls, axes: Sequence[FirstAxis], period_s: float) -> FirstOptions:
        """Return a box at a USB adapter."""
        return first_options(axes, period_s)

    def rate_budget(self) -> RateBudget:
        """Compute how many exchanges a second fit on the line."""
        return budget.rate_budget(self._settings, self._session_channels, self.period_s)

    def problems(self) -> Sequence[tuple[tuple[str | int, ...], str]]:
        """Tell of channels that the protocol does not carry, and of times that do not fit."""
        found: list[tuple[tuple[str | int, ...], str]] = []
        options = self._settings
        for channel in self.channels:
            # The key at fault is the axis', and a driver can point to its own section alone.
            axis = f"axes.{channel.axis}"
            if channel.number >= MOST_CHANNELS:
                found.append((
                    (),
                    f"{axis}.channel is {channel.number}, but the protocol carries channels 0 to "
                    f"{MOST_CHANNELS - 1}",
                ))  # fmt: skip
            if channel.counter_bits > WIDEST_COUNTER_BITS:
                found.append((
                    (),
                    f"{axis}.encoder.counter_bits is {channel.counter_bits}, but the protocol "
                    f"carries counters of up to {WIDEST_COUNTER_BITS} bits",
                ))  # fmt: skip
        if options.watchdog_s < WATCHDOG_PERIODS * self.period_s:
            found.append((
                ("watchdog_s",),
                f"found {options.watchdog_s:g}, must be at least {WATCHDOG_PERIODS} periods of "
                f"{self.period_s:g} s",
            ))  # fmt: skip
        if options.wait_s is not None:
            needed_s = budget.round_trip_s(options, min(self._session_channels, MOST_CHANNELS))
            if options.wait_s >= self.period_s:
                found.append((
                    ("wait_s",),
                    f"found {options.wait_s:g}, must be below the period of {self.period_s:g} s",
                ))  # fmt: skip
            elif options.baud is not None and options.wait_s < needed_s:
                found.append((
                    ("wait_s",),
                    f"found {options.wait_s:g}, but POLL and STATE take {needed_s:.6f} s at "
                    f"{options.baud} baud with the turnaround",
                ))  # fmt: skip
        return found

    def prepare(self) -> None:
        """Compile the frames' kernels, or take them from the cache."""
        if self._poll_frames:
            return
        seen, asked = Inputs(len(self.channels)), Outputs(len(self.channels))
        chunk = np.zeros(1, np.uint8)
        self._take = specialise(receiver.take, self._rx, chunk, 0)
        self._expect = specialise(receiver.expect, self._rx, 0)
        self._command_sent = specialise(receiver.command_sent, self._rx, 0)
        self._lose_count = specialise(receiver.lose_count, self._rx)
        self._deliver = specialise(
            receiver.deliver, self._rx, self._numbers, 0, 0,
            seen.counts, seen.index_counts, seen.status,
        )  # fmt: skip
        self._put_command = specialise(
            frames.put_command, 0, 0, asked.volts, asked.enable, self._numbers, 0, 0.0,
            self._body, self._wire,
        )  # fmt: skip
        self._poll_frames = tuple(
            frames.frame_of(bare(FrameType.POLL, number)) for number in range(256)
        )

    def open(self) -> None:
        """Open the port, begin a session with the device, arm its watchdog, get a first sample.

        Raises RunError where the port, the device or the channels do not fit.
        """
        if self._port is not None:
            raise RunError(f"port {self._settings.port}: this driver has it open already")
        if wrong := self.problems():
            path, message = wrong[0]
            raise RunError(": ".join((f"port {self._settings.port}", *map(str, path), message)))
        self.prepare()
        port = Port(self._settings)
        try:
            self.device, self._sequence = session.begin(
                port, self._rx, self._settings, self.channels, self.period_s, self._sequence
            )
            self._codes_per_volt = VOLT_CODES / self.device.full_scale_v
            self._restarted = False
            self._port = port
            session.first_sample(port, self._rx, self._settings, self._ask)
            self._carried = 0 if self._polls else _FRESH
        except BaseException:
            self._port = None
            with contextlib.suppress(Exception):
                port.write(b"\0" + frames.frame_of(bare(FrameType.SAFE, self._sequence)))
                port.close()
            raise
        self.notes = tuple(port.notes)

    def close(self) -> None:
        """Zero and disable, end a stream, and release the port."""
        port = self._port
        if port is None:
            return
        self.safe()
        if self._streams:
            port.write(frames.frame_of(bare(FrameType.STOP_STREAM, self._next_number())))
        self._port = None
        port.close()

    def read(self, inputs: Inputs) -> None:
        """Fill `inputs` with the newest sample; in mode poll, ask for it first and wait for it."""
        port = self._port
        if port is None:
            bits, news = _CLOSED_BITS, 0
        else:
            news = self._polled(port) if self._polls else self._collected(port)
            if news & _RESTARTED:
                self._restarted = True
            bits = _RESTART_BITS if self._restarted else 0
            if port.gone:
                bits |= _GONE_BITS
        self._deliver(
            self._rx, self._numbers, news, bits,
            inputs.counts, inputs.index_counts, inputs.status,
        )  # fmt: skip

    def write(self, outputs: Outputs) -> None:
        """Send volts and enables; in mode exchange this also asks for the next read's sample."""
        port = self._port
        if port is not None:
            number = self._next_number()
            if self._streams:
                self._command_sent(self._rx, number)
            elif self._exchanges:  # an answer to an older one was sampled more than a period ago
                self._expect(self._rx, number)
            self._put_command(
                self._command_type, number, outputs.volts, outputs.enable,
                self._numbers, self._session_channels, self._codes_per_volt,
                self._body, self._wire,
            )  # fmt: skip
            port.write(self._command)

    def safe(self) -> None:
        """Zero and disable every channel; where the port is not open, it is opened for that."""
        with self.telling_safe():
            if self._port is not None:
                self._send_safe(self._port)
                return
            # No reason to refuse may keep the amplifiers from being disabled.
            port = Port(self._settings.model_copy(update={"low_latency": "no"}))
            try:
                self._send_safe(port)
            finally:
                port.close()

    def _send_safe(self, port: Port) -> None:
        frame = b"\0" + frames.frame_of(bare(FrameType.SAFE, self._next_number()))
        sent = port.write(frame)
        if not sent:
            port.discard_output()
            sent = port.write(frame)
        self.safe_sent = sent
        if not sent:
            why = "it has vanished" if port.gone else "it does not take what is sent"
            self.safe_failed = f"port {self._settings.port}: {why}"

    def _polled(self, port: Port) -> int:
        deadline_s = time.monotonic() + self._wait_s
        asked = self._next_number()
        self._expect(self._rx, asked)
        port.write(self._poll_frames[asked])
        news = 0
        while not news & _ENOUGH:
            remaining_s = deadline_s - time.monotonic()
            if remaining_s <= 0.0 or not port.wait(remaining_s):
                break
            size = port.read()
            if size == 0:
                port.look()
                if port.gone:
                    break
                continue
            news |= self._take(self._rx, port.chunk, size)
        return news

    def _collected(self, port: Port) -> int:
        if self._carried:
            # The first read gives the sample that `open` waited for. What a stream has sent since
            # is old, and more of it may be lost than the numbers can tell.
            news, self._carried = self._carried, 0
            self._start_over(port)
            return news
        news = 0
        for _ in range(READS_A_TICK):
            size = port.read()
            if size == 0:
                if not news & _FRESH:
                    port.look()
                return news
            news |= self._take(self._rx, port.chunk, size)
            if size < FEW_BYTES:
                return news
        # The newest sample is behind more than can be read now: begin afresh with what comes.
        self._start_over(port)
        return (news | _REFUSED) & ~_FRESH

    def _start_over(self, port: Port) -> None:
        port.discard_input()
        self._lose_count(self._rx)

    def _ask(self) -> None:
        """Ask for a first sample, by what the mode asks with, nothing enabled."""
        port = self._port
        assert port is not None
        mode = self._settings.mode
        if mode == "exchange":
            self.write(Outputs(len(self.channels)))
            return
        number = self._next_number()
        asks = FrameType.POLL if mode == "poll" else FrameType.START_STREAM
        if mode == "poll":
            self._expect(self._rx, number)
        port.write(frames.frame_of(bare(asks, number)))

    def _next_number(self) -> int:
        number = self._sequence
        self._sequence = (number + 1) & 0xFF
        return number
