"""One python-can bus whose troubles become status instead of exceptions."""

from __future__ import annotations

import errno
import fcntl
import os
import select
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import can

from motorctl.hal import RunError, Status
from motorctl_can.bus import BusOptions

GONE = int(Status.BUS_OFF | Status.COMMUNICATION_LOST)
NOT_SENT = int(Status.COMMUNICATION_LOST)
GARBAGE = UNSENT = int(Status.CORRUPT)

# Classes of linux/can/error.h, in the identifier of an error frame
ERROR_BUS_OFF = 0x40
ERROR_RESTARTED = 0x100
FULL = (None, errno.ENOBUFS, errno.EAGAIN)
Wanted = tuple[int, bool]
"""A frame that is received: its identifier, and whether it has 29 bits."""

# Longer than any line of slcan: 29-bit identifier and 64 bytes
NOISE_CHARACTERS = 200


class Link:
    """A bus that is open.

    What went wrong is kept in two words, for all channels: `lost` until a state frame is accepted,
    `passing` until a read has told it. The driver clears both.
    """

    def __init__(
        self,
        options: BusOptions,
        wanted: Iterable[Wanted],
        settle_s: float = 0.0,
        *,
        fd: bool = False,
        data_bitrate: int | None = None,
    ) -> None:
        """Open the bus. Raises RunError, naming interface and channel.

        Where the kernel can, it drops frames that are not wanted; other buses give everything.
        """
        where = f"{options.interface} channel '{options.channel}'"
        self._claim = -1
        try:
            self._claim = _claimed(options)
            self._bus = _open(options, wanted, settle_s, fd, data_bitrate)
        except Exception as error:  # backends raise errors of their own kinds
            self._release_claim()
            hint = _hint(options, error)
            raise RunError(f"CAN: {where} cannot be opened: {_said(error)}{hint}") from error
        self.lost = 0
        self.passing = 0
        self.complaint: Exception | None = None
        self._sockets = options.interface == "socketcan"
        self._poll, self._fd = _poller(self._bus)
        self._slcan = options.interface == "slcan"
        self._lines = _Lines(self._fd) if self._slcan else None
        self._waited = [self._fd] if self._slcan else []
        self._none: tuple[int, ...] = ()
        # what has come of a line; python-can keeps noise without a line end for ever
        self._begun: bytearray = getattr(self._bus, "_buffer", bytearray())

    @property
    def status(self) -> int:
        """Return the status bits that hold for all channels."""
        return self.lost | self.passing

    def receive(self, timeout_s: float) -> can.Message | None:
        """Return the next frame, or None where none came in time or it was no frame.

        On a serial line None may also mean that only a part of a frame has arrived yet.
        """
        try:
            if self._waited and timeout_s > 0:
                # python-can would spin, and a device or a kernel thread on this CPU never get it.
                select.select(self._waited, self._none, self._none, timeout_s)
                timeout_s = 0
            message = self._taken(timeout_s)
        except Exception as error:
            self._failed(error)
            return None
        if len(self._begun) > NOISE_CHARACTERS:
            self._forget()
        return message

    def _taken(self, timeout_s: float) -> can.Message | None:
        """Return what python-can's `recv` would, whatever happens to the wall clock meanwhile.

        `recv` counts its time by that: set back, it waits for as long as the clock went back.
        """
        bus = self._bus
        deadline = time.monotonic() + timeout_s if timeout_s > 0 else 0.0
        left = timeout_s
        while True:
            message, filtered = bus._recv_internal(left)
            if message is not None and (filtered or bus._matches_filters(message)):
                return message
            if timeout_s <= 0:
                return None
            left = deadline - time.monotonic()
            if left <= 0:
                return None

    def more(self) -> bool:
        """Tell whether something is waiting after `receive` gave None."""
        if self._poll is None:
            return False
        try:
            events = self._poll.poll(0)
        except OSError:
            self.lost = GONE
            return False
        if not events:
            return False
        if events[0][1] & (select.POLLHUP | select.POLLNVAL):
            self.lost = GONE
            return False
        return True

    def send(self, message: can.Message) -> bool:
        """Hand a frame over without waiting; False where there was no room, or the bus is gone."""
        try:
            if self._lines is None:
                self._bus.send(message, 0)
                return True
            if self._lines.send(message):
                return True
        except Exception as error:
            self.complaint = error.with_traceback(None)
            cause = error.__cause__ if isinstance(error, can.CanError) else error
            if getattr(cause, "errno", None) not in FULL:
                self.lost = GONE
                return False
        self.passing |= UNSENT
        return False

    def lose_commands(self) -> None:
        """Note that too many periods passed in which not everything could be sent."""
        self.passing |= NOT_SENT

    def error_frame(self, message: can.Message) -> None:
        """Take in what an error frame tells."""
        if not self._sockets or message.arbitration_id & ERROR_BUS_OFF:
            self.lost = GONE
        elif message.arbitration_id & ERROR_RESTARTED:
            self.lost = 0
        else:
            self.passing |= GARBAGE

    def close(self) -> None:
        """Release the bus, whatever state it is in."""
        try:
            self._bus.shutdown()
        except Exception:
            # slcan writes a farewell first; where the port is gone, it is left open by that
            port = getattr(self._bus, "serialPortOrig", None)
            if port is not None:
                port.close()
        self._release_claim()

    def _release_claim(self) -> None:
        if self._claim >= 0:
            os.close(self._claim)
        self._claim = -1

    def _failed(self, error: Exception) -> None:
        gone = isinstance(error, OSError) or (
            isinstance(error, can.CanError)
            and (error.__cause__ is None or isinstance(error.__cause__, OSError))
        )
        if gone:
            self.lost = GONE
            self.complaint = error.with_traceback(None)
            return
        # A line or datagram that is no frame: backends parse, and fail each in its own way.
        self.passing |= GARBAGE
        if self._slcan and (
            isinstance(error, UnicodeDecodeError) or isinstance(error.__cause__, UnicodeDecodeError)
        ):
            self._forget()

    def _forget(self) -> None:
        """Drop what has come of a line, and what waits behind it."""
        self.passing |= GARBAGE
        bus: Any = self._bus
        try:
            bus.flush()
        except (can.CanError, OSError):
            self.lost = GONE


class _Lines:
    """Writes frames as slcan lines; python-can's own way waits until all bits have left."""

    def __init__(self, fd: int) -> None:
        self._fd = fd
        self._torn = b""

    def send(self, message: can.Message) -> bool:
        kind = "t"
        if message.is_fd:
            kind = "b" if message.bitrate_switch else "d"
        if message.is_extended_id:
            head = f"{kind.upper()}{message.arbitration_id:08X}"
        else:
            head = f"{kind}{message.arbitration_id:03X}"
        length = can.util.len2dlc(message.dlc)
        text = f"{head}{length:X}{message.data.hex().upper()}\r"
        line = self._torn + text.encode()
        try:
            written = os.write(self._fd, line)
        except BlockingIOError:
            return False
        if written < len(line):
            # end the torn line before the next, so that nothing is read into both
            self._torn = b"\r"
            return False
        self._torn = b""
        return True


def _claimed(options: BusOptions) -> int:
    """Take a serial port for this program alone, which python-can does not; -1 without one.

    Raises OSError. A second program would take the first one's frames, and close its channel.
    """
    port = options.channel.partition("@")[0]
    if options.interface != "slcan" or not Path(port).exists():
        return -1
    claim = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(claim)
        raise OSError("in use by another program") from None
    return claim


def _open(
    options: BusOptions,
    wanted: Iterable[Wanted],
    settle_s: float,
    fd: bool,
    data_bitrate: int | None,
) -> can.BusABC:
    common: dict[str, Any] = {"interface": options.interface, "channel": options.channel}
    if options.interface == "socketcan":
        filters = [_filter(*frame) for frame in wanted]
        return can.Bus(**common, fd=fd, can_filters=filters, ignore_config=True)
    # Without a kernel's help python-can filters in recv, which then gives up at the first frame
    # that does not match though others wait behind it; so these give everything.
    if options.interface == "udp_multicast":
        # never further than this machine: not every frame out of its network card
        return can.Bus(**common, fd=fd, port=options.port, hop_limit=0, ignore_config=True)
    if options.interface == "virtual":
        return can.Bus(**common, ignore_config=True)
    rate = None if fd else options.bitrate
    bus: Any = can.Bus(
        **common,
        bitrate=rate,
        tty_baudrate=options.tty_baudrate,
        sleep_after_open=settle_s,
        timeout=0,
        ignore_config=True,
    )
    if fd:
        try:
            bus.set_bitrate(options.bitrate, data_bitrate)
        except Exception:
            bus.shutdown()
            raise
    opened: can.BusABC = bus
    return opened


def _filter(identifier: int, extended: bool) -> Any:
    mask = 0x1FFFFFFF if extended else 0x7FF
    return {"can_id": identifier, "can_mask": mask, "extended": extended}


def _poller(bus: can.BusABC) -> tuple[select.poll | None, int]:
    try:
        fd = bus.fileno()
    except NotImplementedError:
        return None, -1
    poll = select.poll()
    poll.register(fd, select.POLLIN)
    return poll, fd


def _said(error: Exception) -> str:
    cause = error.__cause__
    number = getattr(cause, "errno", None) or getattr(error, "errno", None)
    if isinstance(number, int) and f"[Errno {number}]" in str(cause or error):
        return os.strerror(number)
    text = str(error) or type(error).__name__
    return f"{text} ({cause})" if isinstance(cause, OSError) and str(cause) not in text else text


def _hint(options: BusOptions, error: Exception) -> str:
    if options.interface == "socketcan":
        return (
            f"; is it there and up? ip link set {options.channel} up type can bitrate "
            f"{options.bitrate}"
        )
    if "msgpack" in str(error):
        return "; pip install msgpack"
    return ""


def now_s() -> float:
    """Return the time on the clock of the frames' time stamps [s]."""
    return time.time()
