"""What a driver is.

A driver moves encoder counts in and amplifier volts out, for one or more channels, all of them
at once and through arrays that are made before the first tick. A complete example:

    class Bench(Driver):
        \"\"\"Two amplifiers on a bench supply.\"\"\"

        class Options(DriverOptions):
            port: str

        def rate_budget(self) -> RateBudget:
            return RateBudget(8000.0, "one 12-byte exchange at 1 Mbaud is 120 us")

        def open(self) -> None:
            self.line = connect(self.options.port)

        def close(self) -> None:
            self.line.close()

        def read(self, inputs: Inputs) -> None:
            inputs.counts[:], inputs.status[:] = self.line.receive()

        def write(self, outputs: Outputs) -> None:
            self.line.send(outputs.volts, outputs.enable)

        def safe(self) -> None:
            with self.telling_safe():
                self.line.send_zero_and_disable()
                self.safe_sent = True

It is found by the name under which its package registers it in the entry-point group
``motorctl.drivers``, or in YAML as ``type: package.module:Class``. Whether it keeps the contract is
checked by `motorctl.hal.conformance`.
"""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntFlag
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from motorctl.hal.first_options import FirstAxis, FirstOptions, FoundDevice
from motorctl.hal.way import Way


class Status(IntFlag):
    """The status word of one channel. Zero means: everything is as it should be.

    Bits 12 to 27 may hold an error code (`error_bits`); bits without a meaning here stay 0.
    """

    ENCODER_LOST = 1 << 0
    """The count cannot be trusted (broken wire, illegal transition, stale frame)."""
    AMPLIFIER_FAULT = 1 << 1
    """The amplifier reports a fault."""
    COMMUNICATION_LOST = 1 << 2
    """No news, but the device counts on. Where it may have restarted, and lost its count, a driver
    reports ENCODER_LOST as well: an incremental axis then has to be homed again."""
    LIMIT_NEGATIVE = 1 << 3
    """The limit switch at the negative end is pressed."""
    LIMIT_POSITIVE = 1 << 4
    """The limit switch at the positive end is pressed."""
    HOME_SWITCH = 1 << 5
    """The home switch is pressed."""
    INDEX_LATCHED = 1 << 6
    """An index mark was passed since the last read; ``Inputs.index_counts`` holds its count."""
    ESTOP = 1 << 7
    """The hardware's emergency-stop chain is open."""
    STALE = 1 << 8
    """No new sample has come since the last read, and the count repeats the last one. Not a fault:
    the loop holds the position for as many periods as the configuration allows, then trips."""
    CORRUPT = 1 << 9
    """Something came and was refused: checksum, length, or sequence; or could not be sent, as the
    bus had no room. Tells the cause of STALE."""
    BUS_OFF = 1 << 10
    """The controller is off the bus, or the port is gone. With COMMUNICATION_LOST. `motorctl reset`
    then opens the driver anew, as it does with DEVICE_RESTARTED on any channel that is to be reset,
    and with COMMUNICATION_LOST on all channels."""
    DEVICE_RESTARTED = 1 << 11
    """The device began anew, or was silent for so long that it may have: its count and its enables
    are not what they were. With ENCODER_LOST. It stays until the driver is opened again."""
    UNPOWERED = 1 << 28
    """The amplifier gives no force whatever the volts: it is off, or still on its way to be on. No
    fault. Of devices that take time to be enabled: an axis that is started waits with its law until
    it is gone; how long that may last is the driver's to say, by AMPLIFIER_FAULT."""


# Bits 12 to 27 hold the error code of an amplifier that has one: `error_bits`.

FAULT_BITS = Status.ENCODER_LOST | Status.AMPLIFIER_FAULT | Status.COMMUNICATION_LOST | Status.ESTOP


class Inputs:
    """What one read brings, an entry a channel. The arrays are made once and reused."""

    __slots__ = ("counts", "index_counts", "status")

    counts: NDArray[np.int64]
    """Raw counter, signed or not, possibly wrapped to the width that the configuration declares."""
    index_counts: NDArray[np.int64]
    """The counter's value at the last index mark."""
    status: NDArray[np.uint32]
    """Bits of `Status`."""

    def __init__(self, channels: int) -> None:
        self.counts = np.zeros(channels, np.int64)
        self.index_counts = np.zeros(channels, np.int64)
        self.status = np.zeros(channels, np.uint32)


class Outputs:
    """What one write takes, an entry a channel. The arrays are made once and reused."""

    __slots__ = ("enable", "volts")

    volts: NDArray[np.float64]
    enable: NDArray[np.uint8]
    """Where 0, the amplifier is disabled and gets 0 V, whatever `volts` says."""

    def __init__(self, channels: int) -> None:
        self.volts = np.zeros(channels, np.float64)
        self.enable = np.zeros(channels, np.uint8)


@dataclass(frozen=True)
class Channel:
    """What the machine description tells a driver about one of its channels."""

    axis: str
    """The axis' name, for messages."""
    number: int
    """Which of the device's channels it is. A driver's arrays follow the order of its channels."""
    resolution_m: float
    """Metres (or radians) a count."""
    counter_bits: int
    max_voltage_v: float


@dataclass(frozen=True)
class RateBudget:
    """The highest rate that a driver's bus, layout and channels can carry."""

    max_rate_hz: float
    arithmetic: str
    """How that number comes about, in words and numbers, for `check` and for error messages."""


@dataclass(frozen=True)
class NetworkInterface:
    """A network interface that has to be up before a driver can open."""

    name: str
    settings: str = ""
    """What `ip link set NAME up` takes besides, as in ``type can bitrate 1000000``."""


def serial_line(port: str) -> str:
    """Return the `Driver.medium` of a serial port, whatever link it is named by.

    Parameters
    ----------
    port
        Path of the port, or of a link to it.

    Returns
    -------
    str
        The same words for every name of the same port.
    """
    return f"serial port {os.path.realpath(port)}"


class DriverOptions(BaseModel):
    """Base of every driver's own options; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class Driver(ABC):
    """One device, serving `channels` in their order at one exchange a period.

    `read` and `write` are called once a tick in the real-time loop: they may not allocate
    memory that grows, log, wait beyond the period, or raise, not even before `open` or after
    `close`. They fill and read slices of arrays that other drivers share. Trouble is told through
    `Inputs.status`. `open` may raise `motorctl.errors.RunError` with one clear message that names
    the device; the driver may then be opened again, as after `close`.

    A driver that lost its device is opened anew while the daemon runs: `safe`, `close`, `prepare`
    and `open` of the same object, as at the start, but in a thread beside the ticks of other
    drivers. No `read` or `write` of this one runs meanwhile. Whatever `open` checks of the device
    is so checked again. What it does there may wait, but shares Python's lock with the ticks: long
    computations that keep the lock belong into the first `prepare`.
    """

    Options: ClassVar[type[DriverOptions]] = DriverOptions
    supports_virtual_time: ClassVar[bool] = False
    exchange_delay_periods: float = 0.0
    """How many periods later than in a direct exchange a command acts on what is read: 0 where
    `read` brings what was sampled at its call and `write` takes effect at once; 1 where one
    exchange a period carries both, so that what `read` brings was sampled at the last `write`; in
    between, as on average, where the device samples by a clock of its own."""
    longest_wait_s: float = 0.0
    """How long one `read` and the `write` after it may wait for the device at most. The waits of
    all drivers have to fit into the loop's period, also where a driver has a slower one."""
    watchdog_s: float | None = None
    """How long the device goes on without a command at least, before it disables by itself [s];
    infinite where it never does, None where nobody knows. A loop that was stalled for longer is the
    cause of what the device then reports."""
    sampled_apart_s: float = 0.0
    """How far apart the samples of two channels may lie that one `read` brings [s]; 0 where all are
    of one moment, as where one message carries them, or one order makes every device sample. The
    two ends of a beam are compared with each other."""
    medium: str | None = None
    """The bus or line that it has for itself, in words, as in "serial port /dev/ttyUSB0"; two
    drivers of one machine may not have the same."""
    notes: tuple[str, ...] = ()
    """What the last `open` found worth knowing and no reason to refuse, such as a setting that the
    port does not take. It is read once after each `open`, before the next tick; the daemon tells
    each note as it tells what the machine refuses of real time."""
    reopens: ClassVar[bool] = True
    """Whether it can be opened anew in the same process; where not, a device that was lost comes
    back with the daemon's next start."""
    clears_faults: ClassVar[bool] = False
    """Whether a fault of the device stays until `clear_fault` asks the device to forget it."""
    simulated: ClassVar[bool] = False
    """True where no machine moves: measurements then start axes without being told to."""
    safe_sent: bool | None = None
    """Whether the last `safe` could send what zeroes and disables: True where bus or line took all
    of it, and a device that answers such an order has obeyed; False where not; None where the
    driver does not tell. When the loop has died, and this is not True, the daemon says that the
    outputs may not be safe."""
    safe_failed: str = ""
    """Where `safe_sent` is False: why, in one line that names the device."""

    def __init__(
        self, options: DriverOptions, channels: Sequence[Channel], period_s: float
    ) -> None:
        self.options = options
        self.channels = tuple(channels)
        self.period_s = period_s

    @classmethod
    def first_options(cls, axes: Sequence[FirstAxis], period_s: float) -> FirstOptions:
        """Return options with which the configuration of a new machine begins, without any I/O.

        `motorctl init` writes them, with what its user has told besides. They should be complete,
        so that `check` passes; what is only guessed is named.

        Parameters
        ----------
        axes
            What is known of the axes that the driver is to serve.
        period_s
            Of the driver [s].
        """
        return FirstOptions({})

    @classmethod
    def look(cls, options: Mapping[str, Any]) -> FoundDevice:
        """Return what is there, for `motorctl init --from devices`; nothing of it is changed.

        Parameters
        ----------
        options
            Those that the user has told, as they would stand in YAML: which bus to look at.

        Raises
        ------
        NotImplementedError
            Where the device has no way to tell, as of most protocols.
        RunError
            Where nothing answers.
        """
        raise NotImplementedError

    @abstractmethod
    def rate_budget(self) -> RateBudget:
        """Compute the highest possible rate from options and channels, without any I/O."""

    def problems(self) -> Sequence[tuple[tuple[str | int, ...], str]]:
        """Return what is wrong between options and channels, without any I/O.

        Each with the path of the option that is at fault, as in ``(("frames", "command"), "...")``.
        What is wrong with one option alone is the business of their schema.
        """
        return ()

    def advice(self) -> Sequence[str]:
        """Return what the options leave open that a safe machine would want, a sentence each.

        `check` shows it as notes; it is no reason to refuse a configuration.
        """
        return ()

    def switches(self) -> Sequence[Status] | None:
        """Return which switches and marks the device can tell of, without any I/O.

        An entry a channel, of `HOME_SWITCH`, `INDEX_LATCHED`, `LIMIT_NEGATIVE` and
        `LIMIT_POSITIVE`; None where only the device knows. An axis that is homed by what can never
        come is refused.
        """
        return None

    def ways(self) -> Sequence[Way | None] | None:
        """Return how far each channel can go and what it meets there, without any I/O.

        An entry a channel, None where it is not known; None where the driver knows of none, as of
        every real machine. An axis whose program or homing would always trip there, or whose soft
        limits never would, is refused. Only those of a `simulated` driver are asked.
        """
        return None

    def network_interfaces(self) -> Sequence[NetworkInterface]:
        """Return the network interfaces that only it uses, without any I/O.

        ``motorctl service install`` has udev set them up whenever they appear.
        """
        return ()

    def prepare(self) -> None:  # noqa: B027 (most drivers have nothing to prepare)
        """Compile and allocate, without any I/O, what would be slow once real time is entered.

        A daemon that starts does it in a second process, too, which may be ended at any point.
        """

    @abstractmethod
    def open(self) -> None:
        """Connect, check the device and arm its watchdog; outputs stay zero and disabled."""

    @abstractmethod
    def close(self) -> None:
        """Release the device. Called once after `safe`, for each `open`."""

    @abstractmethod
    def read(self, inputs: Inputs) -> None:
        """Fill `inputs` with the newest values."""

    @abstractmethod
    def write(self, outputs: Outputs) -> None:
        """Send `outputs` to the amplifiers."""

    @abstractmethod
    def safe(self) -> None:
        """Zero and disable every channel; callable at any time, also before `open`.

        It never raises; what came of it is told by `safe_sent`.
        """

    @contextmanager
    def telling_safe(self) -> Iterator[None]:
        """Do within it what `safe` does: an error ends that, and is told in `safe_failed`.

        `safe_sent` is False at first; set it where the order could be sent.
        """
        self.safe_sent, self.safe_failed = False, ""
        try:
            yield
        except Exception as error:
            self.safe_sent = False
            self.safe_failed = str(error) or type(error).__name__

    def clear_fault(self, channel: int) -> None:  # noqa: B027 (most devices need no such order)
        """Let the next writes ask a device to forget its fault, for `motorctl reset`.

        Called while the axis is disabled, from another thread than the ticks', which go on: it may
        leave a mark for `write`, and no more. Whether it helped is told by AMPLIFIER_FAULT of the
        reads that follow.

        Parameters
        ----------
        channel
            Which one, in the order of `channels`.
        """

    def start_virtual_time(self) -> None:
        """Switch the device to virtual time, before `open`. Only where it is supported."""
        raise TypeError(f"{type(self).__name__} does not support virtual time")

    def advance(self) -> None:
        """Let one period pass in virtual time, between `write` and the next `read`."""
        raise TypeError(f"{type(self).__name__} does not support virtual time")
