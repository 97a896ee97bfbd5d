"""A serial port as the kernel gives it: opened and set, then raw reads and writes."""

from __future__ import annotations

import errno
import fcntl
import os
import select
import struct
import termios
from pathlib import Path

import numpy as np
import serial  # type: ignore[import-untyped]
from serial.rs485 import RS485Settings  # type: ignore[import-untyped]

from motorctl.hal import RunError
from motorctl_serial.options import Rs485Options, SerialOptions

CHUNK_BYTES = 4096
BAUD_TOLERANCE = 0.02
HIGHEST_DESCRIPTOR = 1023
"""Beyond it select cannot wait, and poll counts milliseconds only."""
PSEUDO_TERMINALS = range(136, 144)
"""Their major numbers."""
USB_CDC = 166
GADGET_NAME = "ttyGS"

_TERMIOS2 = 44
_TCGETS2 = 0x802C542A
_OUTPUT_SPEED_AT = 40


class Port:
    """One open terminal.

    After `gone` is set it has vanished: reads give nothing, writes do nothing.
    """

    def __init__(self, options: SerialOptions) -> None:
        """Open and set it. Raises RunError that names the port and the key."""
        self.notes: list[str] = []
        self.gone = False
        self._cut = False
        self._name = options.port
        self._serial = _opened(options)
        try:
            self._fd: int = self._serial.fileno()
            self._check_descriptor(options)
            self._check_baud(options)
            self._lower_latency(options)
        except BaseException:
            self._serial.close()
            raise
        self.chunk = np.zeros(CHUNK_BYTES, np.uint8)
        self._buffers = [self.chunk.data]
        self._waited = [self._fd]
        self._nothing: tuple[int, ...] = ()
        self._poll = select.poll()
        self._poll.register(self._fd, select.POLLIN)

    def close(self) -> None:
        """Release it."""
        self._serial.close()

    def read(self) -> int:
        """Read the waiting bytes into `chunk`, without blocking; return their number."""
        if self.gone:
            return 0
        try:
            return os.readv(self._fd, self._buffers)
        except BlockingIOError:
            return 0
        except OSError:
            self.gone = True
            return 0

    def wait(self, timeout_s: float) -> bool:
        """Wait until there is something to read; False after `timeout_s`."""
        try:
            return bool(select.select(self._waited, self._nothing, self._nothing, timeout_s)[0])
        except (OSError, ValueError):
            self.gone = True
            return False

    def look(self) -> None:
        """Set `gone` if the port has vanished, which a read of no bytes alone does not tell."""
        try:
            for _, events in self._poll.poll(0):
                if events & (select.POLLHUP | select.POLLERR | select.POLLNVAL):
                    self.gone = True
        except OSError:
            self.gone = True

    def write(self, wire: memoryview | bytes) -> bool:
        """Send a frame without blocking; return whether the kernel took all of it."""
        if self.gone:
            return False
        try:
            if self._cut:
                # What was sent of the last frame must not run into this one.
                self._cut = os.write(self._fd, b"\0") == 0
            sent = os.write(self._fd, wire)
        except BlockingIOError:
            return False
        except OSError:
            self.gone = True
            return False
        self._cut = self._cut or 0 < sent < len(wire)
        return sent == len(wire)

    def discard_input(self) -> None:
        """Throw away what has been received and not read."""
        self._flush(termios.TCIFLUSH)

    def discard_output(self) -> None:
        """Throw away what has not been sent yet."""
        self._flush(termios.TCOFLUSH)
        self._cut = True

    def _flush(self, queue: int) -> None:
        try:
            termios.tcflush(self._fd, queue)
        except (OSError, termios.error):
            self.gone = True

    def _check_descriptor(self, options: SerialOptions) -> None:
        if self._fd > HIGHEST_DESCRIPTOR:
            raise RunError(f"port {options.port}: too many files are open ({self._fd})")

    def _check_baud(self, options: SerialOptions) -> None:
        if options.baud is None:
            major = os.major(os.fstat(self._fd).st_rdev)
            gadget = GADGET_NAME in os.path.realpath(options.port)
            if major not in PSEUDO_TERMINALS and major != USB_CDC and not gadget:
                raise RunError(
                    f"port {options.port}: baud: null is for pseudo-terminals and USB CDC devices; "
                    "this port needs a baud rate"
                )
            return
        try:
            settings = fcntl.ioctl(self._fd, _TCGETS2, bytes(_TERMIOS2))
        except OSError:
            return  # not every kernel driver tells
        (speed,) = struct.unpack_from("=I", settings, _OUTPUT_SPEED_AT)
        if abs(speed - options.baud) > BAUD_TOLERANCE * options.baud:
            raise RunError(
                f"port {options.port}: baud: {options.baud} is not possible, it would be {speed}"
            )

    def _lower_latency(self, options: SerialOptions) -> None:
        if options.low_latency == "no":
            return
        timer = Path("/sys/bus/usb-serial/devices") / Path(os.path.realpath(options.port)).name
        timer /= "latency_timer"
        try:
            self._serial.set_low_latency_mode(True)
        except (ValueError, OSError, NotImplementedError) as error:
            message = f"port {options.port}: low_latency is refused ({error}); "
            pseudo = os.major(os.fstat(self._fd).st_rdev) in PSEUDO_TERMINALS
            if pseudo:
                message += "a pseudo-terminal has no latency timer and needs none"
            elif timer.exists():
                message += f"{timer} holds {_text(timer)} ms, write 1 into it"
            else:
                message += f"an FTDI adapter would have its timer in {timer}"
            if options.low_latency == "require":
                raise RunError(f"{message}; low_latency: ask goes on without") from error
            if not pseudo:  # there the mode does not exist: nothing is refused
                self.notes.append(message)
            return
        if timer.exists() and _text(timer) not in {"0", "1"}:
            self.notes.append(
                f"port {options.port}: {timer} still holds {_text(timer)} ms; write 1 into it"
            )


def _opened(options: SerialOptions) -> serial.Serial:
    port = serial.Serial()
    port.port = options.port
    port.exclusive = True
    port.timeout = 0
    port.write_timeout = 0
    what = ""
    try:
        if options.baud is not None:
            what = f"baud: {options.baud} is refused: "
            port.baudrate = options.baud
        if options.rs485 is not None:
            what = f"rs485 or baud: {options.baud} is refused: "
            port.rs485_mode = _rs485(options.rs485)
        port.open()
    except serial.SerialException as error:
        raise RunError(f"port {options.port}: {_reason(error)}") from error
    except (ValueError, OSError, OverflowError, NotImplementedError, termios.error) as error:
        raise RunError(f"port {options.port}: {what}{error}") from error
    return port


def _rs485(options: Rs485Options) -> RS485Settings:
    # Without loopback: the receiver is off while the transmitter sends.
    return RS485Settings(
        options.rts_level_for_tx,
        options.rts_level_for_rx,
        False,
        options.delay_before_tx_s,
        options.delay_before_rx_s,
    )


def _reason(error: serial.SerialException) -> str:
    text = str(error)
    if "exclusively lock" in text:
        return "in use by another program"
    if os.strerror(errno.ENOTTY) in text:
        return "is no serial port"
    return os.strerror(error.errno) if error.errno else text


def _text(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:
        return "an unknown number of"
