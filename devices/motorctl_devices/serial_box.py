"""The box of amplifiers and encoders at the end of a serial line."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from motorctl.hal import Status
from motorctl_devices.endpoint import Endpoint
from motorctl_devices.line import change_length, flip_bits
from motorctl_devices.machine import INDEX_LATCHED, Machine
from motorctl_devices.orders import Settings
from motorctl_devices.pty_port import PtyPort
from motorctl_devices.schedule import NEVER, Fault
from motorctl_devices.serial_codec import LONGEST_WIRE, Kind, Refusal, from_wire, to_wire

VERSION = 1
MODES = {"poll": 1, "exchange": 2, "stream": 4}
IN_FORCE, WATCHDOG, REFUSED = 1, 2, 4
INDEX_TOLD_IN = 4
"""A mark is told in the first STATE after it and in the three that follow."""
COMMUNICATION_LOST = int(Status.COMMUNICATION_LOST)
LOW_BITS = 0xFF
"""The low eight bits of `Status` are the status byte of the wire."""

_HELLO = struct.Struct("<BBBBHI")
_CAPABILITIES = struct.Struct("<BBBBBBBBHHII16s")
_STATE = struct.Struct("<BBBBBH")
_CHANNEL = struct.Struct("<Bi")
_ERROR = struct.Struct("<BBBBBH")
_BOLD = (Kind.STOP_STREAM, Kind.SAFE)
_COMMANDS = (Kind.COMMAND, Kind.EXCHANGE)
_LENGTHS = {Kind.HELLO: 12, Kind.POLL: 2, Kind.START_STREAM: 2, Kind.STOP_STREAM: 2, Kind.SAFE: 2}


class SerialShape(Settings):
    """A box on a serial line, which is a pseudo-terminal."""

    name: Annotated[str, Field(max_length=16, pattern=r"^[ -~]*$")] = "simulated gantry"
    modes: tuple[Literal["poll", "exchange", "stream"], ...] = ("poll", "exchange", "stream")
    half_duplex: bool = False
    max_rate_hz: Annotated[int, Field(ge=1, le=65535)] | None = Field(
        default=None, description="null: the device's rate_hz"
    )
    longest_watchdog_s: Annotated[float, Field(ge=0.001, le=65.535)] = 65.535


@dataclass(frozen=True)
class Traits:
    """What the box tells of itself."""

    shape: SerialShape
    counter_bits: int
    full_scale_v: float
    max_rate_hz: int
    longest_watchdog_ms: int

    @property
    def modes(self) -> int:
        """Return the sum of the modes that the device supports."""
        known = set(self.shape.modes) - ({"stream"} if self.shape.half_duplex else set())
        return sum(MODES[name] for name in known)


@dataclass
class _Session:
    channels: int
    mode: int
    period_ns: int


class SerialBox(Endpoint[bytes]):
    """Firmware of the box; messages are frames as they travel, with their 00."""

    def __init__(
        self, machine: Machine, faults: Sequence[Fault], traits: Traits, link: Path | None
    ) -> None:
        super().__init__(machine, faults)
        self._traits = traits
        self._port = PtyPort(link)
        self._came = bytearray()
        self._skipping = False
        self._volts_per_code = traits.full_scale_v / 32767
        self._forget()

    def _forget(self) -> None:
        self._session: _Session | None = None
        self._sent = 0
        self._sampled = 0
        self._last_heard = 0
        self._last_refused: int | None = None
        self._in_force: int | None = None
        self._refused_command = False
        self._stream_answers = 0
        self._marks_left = [0] * self.machine.channels
        self.due_ns = NEVER

    @property
    def address(self) -> str:
        """Return the path of the serial port."""
        return self._port.path

    def open(self) -> None:
        """Make the serial port, and announce the start. Raises RunError."""
        self._port.open()
        self.booted()

    def close(self) -> None:
        """Take the serial port away."""
        self._port.close()

    def filenos(self) -> list[int]:
        """Return the file descriptors to wait on."""
        number = self._port.fileno()
        return [number] if number >= 0 else []

    def unplug(self) -> None:
        """Take the port away."""
        super().unplug()
        self._port.close()

    def plug(self) -> None:
        """Open the port again. Raises RunError."""
        super().plug()
        self._came.clear()
        self._port.open()

    def died(self) -> None:
        """Forget session and numbers."""
        self._forget()

    def booted(self) -> None:
        """Announce the start, where the line has room for what nobody asked for."""
        if not self._traits.shape.half_duplex:
            self._say_capabilities(0, 0)

    def hear(self, ready: Sequence[int]) -> None:
        """Split the received bytes into frames."""
        if self._port.fileno() not in ready:
            return
        *frames, rest = (bytes(self._came) + self._port.read()).split(b"\0")
        for frame in frames:
            if frame and not self._skipping:
                self.heard(frame + b"\0")
            self._skipping = False
        if len(rest) > LONGEST_WIRE:
            self._skipping = True
            rest = b""
        self._came[:] = rest

    def answer(self, message: bytes) -> None:
        """Do what a frame of the host asks for."""
        # A frame that was damaged on its way may have come apart.
        for part in message.split(b"\0"):
            if not part:
                continue
            body = from_wire(part)
            if body is None or len(body) < 2 or body[0] >= 0x80:
                self.refused += 1
            else:
                self._obey(body)

    def _obey(self, body: bytes) -> None:
        kind, number = body[0], body[1]
        if kind == Kind.HELLO:
            self._hello(body)
            return
        if kind in _BOLD:
            self._in_turn(number)
            if len(body) == _LENGTHS[Kind(kind)]:
                self._bold(kind)
            return
        if kind in (Kind.COMMAND, Kind.EXCHANGE, Kind.POLL, Kind.START_STREAM):
            if self._session is None:
                if kind != Kind.COMMAND or not self._traits.shape.half_duplex:
                    self._say_error(Refusal.NO_SESSION, body, 0)
                return
            distance = number - self._last_heard & 0xFF
            if distance == 0:
                return
            if not self._in_turn(number):
                self._refuse(body, Refusal.BAD_VALUE, 1)
                return
            self._session_frame(kind, body, self._session)
            return
        self._in_turn(number)
        self._say_error(Refusal.UNKNOWN_TYPE, body, 0)

    def _in_turn(self, number: int) -> bool:
        """Take a number over where it is new; a count that came round is, at the second frame."""
        distance = number - self._last_heard & 0xFF
        follows = self._last_refused is not None and number == self._last_refused + 1 & 0xFF
        if 1 <= distance < 128 or follows:
            self._last_heard, self._last_refused = number, None
            return True
        if distance:
            self._last_refused = number
        return False

    def _hello(self, body: bytes) -> None:
        self.machine.disable_all()
        answers, sampled = body[1], self._sampled
        self._forget()
        self._sampled = sampled
        if len(body) > 2 and body[2] != VERSION:
            self._say_error(Refusal.VERSION, body, VERSION | VERSION << 8)
            return
        if len(body) != _LENGTHS[Kind.HELLO]:
            self._say_error(Refusal.BAD_LENGTH, body, _LENGTHS[Kind.HELLO])
            return
        _, channels, mode, zero, watchdog_ms, period_us = _HELLO.unpack_from(body, 2)
        traits = self._traits
        for good, offset in (
            (channels >= 1, 3),
            (mode in MODES.values(), 4),
            (zero == 0, 5),
            (watchdog_ms >= 1, 6),
            (period_us >= 1, 8),
        ):
            if not good:
                self._say_error(Refusal.BAD_VALUE, body, offset)
                return
        if channels > self.machine.channels:
            self._say_error(Refusal.TOO_MANY_CHANNELS, body, self.machine.channels)
        elif not mode & traits.modes:
            self._say_error(Refusal.MODE, body, traits.modes)
        elif (period_us + 1) * traits.max_rate_hz < 1_000_000:  # it is rounded to whole us
            self._say_error(Refusal.TOO_FAST, body, traits.max_rate_hz)
        elif watchdog_ms > traits.longest_watchdog_ms:
            self._say_error(Refusal.WATCHDOG, body, traits.longest_watchdog_ms)
        else:
            self._session = _Session(channels, mode, 1000 * period_us)
            self._last_heard = answers
            self.machine.set_watchdog(watchdog_ms * 1e-3)
            self._say_capabilities(answers, watchdog_ms)

    def _bold(self, kind: int) -> None:
        self.due_ns = NEVER
        if kind == Kind.SAFE:
            self.machine.disable_all()
            self._in_force = None

    def _session_frame(self, kind: int, body: bytes, session: _Session) -> None:
        right = 3 + 2 * session.channels if kind in _COMMANDS else _LENGTHS[Kind(kind)]
        if len(body) != right:
            self._refuse(body, Refusal.BAD_LENGTH, right)
            return
        if kind in _COMMANDS:
            codes = struct.unpack_from(f"<{session.channels}h", body, 3)
            if -32768 in codes:
                self._refuse(body, Refusal.BAD_VALUE, 3 + 2 * codes.index(-32768))
                return
            if kind == Kind.EXCHANGE:
                self.machine.sample(self.now_ns)
            self._command(body[1], body[2], codes)
        elif kind == Kind.START_STREAM:
            if session.mode != MODES["stream"]:
                self._say_error(Refusal.MODE, body, self._traits.modes)
                return
            self._stream_answers = body[1]
            self.due_ns = self.now_ns
            self.on_due()
            return
        if kind != Kind.COMMAND:
            self.machine.sample(self.now_ns)
            self._say_state(body[1], session)

    def _command(self, number: int, enable: int, codes: Sequence[int]) -> None:
        machine = self.machine
        enable &= (1 << len(codes)) - 1
        if True in machine.tripped:
            self._in_force = None
            if enable:
                machine.commands += 1
                return
            machine.disable_all()
        for channel, code in enumerate(codes):
            volts = code * self._volts_per_code
            machine.command(channel, volts, bool(enable >> channel & 1), self.now_ns)
        machine.apply(self.now_ns)
        self._in_force = number

    def on_due(self) -> None:
        """Send the stream's next STATE."""
        session = self._session
        if session is None or self.now_ns < self.due_ns:
            return
        self.machine.sample(self.now_ns)
        self._say_state(self._stream_answers, session)
        missed = (self.now_ns - self.due_ns) // session.period_ns
        self.due_ns += (missed + 1) * session.period_ns

    def _say_state(self, answers: int, session: _Session) -> None:
        machine = self.machine
        tripped = True in machine.tripped
        if tripped:
            self._in_force = None
        flags = WATCHDOG if tripped else 0
        flags |= 0 if self._in_force is None else IN_FORCE
        flags |= REFUSED if self._refused_command else 0
        self._refused_command = False
        self._sampled = self._sampled + 1 & 0xFFFF
        in_force = self._in_force or 0
        parts = [b""]
        marks = []
        for channel in range(session.channels):
            status = machine.status[channel] & LOW_BITS & ~INDEX_LATCHED
            if machine.status[channel] & INDEX_LATCHED:
                self._marks_left[channel] = INDEX_TOLD_IN
            if self._marks_left[channel]:
                self._marks_left[channel] -= 1
                status |= INDEX_LATCHED
                mark = machine.signed(channel, machine.index_counts[channel])
                marks.append(mark.to_bytes(4, "little", signed=True))
            if tripped:
                status |= COMMUNICATION_LOST
            count = machine.signed(channel, machine.counts[channel])
            parts.append(_CHANNEL.pack(status, count))
        machine.index_told()
        number = self.sequence(self._next_number(), 256)
        parts[0] = _STATE.pack(Kind.STATE, number, answers, in_force, flags, self._sampled)
        self.say(to_wire(b"".join(parts + marks)))

    def _say_capabilities(self, answers: int, watchdog_ms: int) -> None:
        traits, machine = self._traits, self.machine
        body = _CAPABILITIES.pack(
            Kind.CAPABILITIES,
            self._next_number(),
            VERSION,
            VERSION,
            answers,
            machine.channels,
            traits.counter_bits,
            traits.modes,
            watchdog_ms,
            traits.max_rate_hz,
            machine.boot_id,
            round(traits.full_scale_v * 1e6),
            traits.shape.name.encode("ascii"),
        )
        self.say(to_wire(body))

    def _refuse(self, body: bytes, code: Refusal, detail: int) -> None:
        if body[0] == Kind.COMMAND:
            self._refused_command = True
        else:
            self._say_error(code, body, detail)

    def _say_error(self, code: Refusal, body: bytes, detail: int) -> None:
        number = self._next_number()
        self.say(to_wire(_ERROR.pack(Kind.ERROR, number, code, body[0], body[1], detail)))

    def _next_number(self) -> int:
        self._sent = self._sent + 1 & 0xFF
        return self._sent

    def emit(self, message: bytes) -> None:
        """Send a frame."""
        self._port.write(message)

    def spoil(self, message: bytes, fault: Fault) -> bytes:
        """Flip bits anywhere in the frame, its end too."""
        return flip_bits(message, fault)

    def cut(self, message: bytes, fault: Fault) -> bytes:
        """Cut or lengthen the frame, and end it."""
        return change_length(message[:-1], fault, LONGEST_WIRE) + b"\0"

    def babble(self, fault: Fault) -> None:
        """Send noise."""
        self._port.write(bytes(fault.random.randrange(256) for _ in range(8)))
