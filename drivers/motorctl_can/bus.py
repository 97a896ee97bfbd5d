"""The options of a CAN bus, whatever its frames mean: interface, channel, bit rates."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from ipaddress import ip_address
from typing import Literal

from pydantic import Field, ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from motorctl.hal import DriverOptions, serial_line
from motorctl_can.checks import Wrong

RESTART_MS = 100
SLCAN_BITRATES = (10000, 20000, 50000, 83300, 100000, 125000, 250000, 500000, 750000, 1000000)


class BusOptions(DriverOptions):
    """A bus of python-can."""

    interface: Literal["socketcan", "virtual", "udp_multicast", "slcan"]
    """What is behind the bus: a Linux CAN interface; a bus within this process; a bus within
    this computer or network; or a serial adapter."""
    channel: str = Field(min_length=1)
    """The interface's own name for it: `can0`; any name (virtual); a multicast group such as
    239.74.163.2; or a serial port (slcan)."""
    bitrate: int = Field(default=1000000, ge=5000, le=1000000)
    """Of the bus [bit/s]. A Linux interface must have been set up with it; a service has udev
    do so from here. Where it differs from the others', the bus goes off."""
    port: int = Field(default=43113, ge=1, le=65535)
    """UDP port of udp_multicast."""
    tty_baudrate: int = Field(default=115200, ge=1200, le=20000000)
    """Baud rate of slcan's serial port."""
    settle_s: float = Field(default=0.0, ge=0, le=10, allow_inf_nan=False)
    """Pause after slcan's port was opened [s]: some adapters restart then and need 2 s."""

    def wrong_in_bus(self) -> Iterator[Wrong]:
        """Tell where interface, channel and bit rate do not fit together."""
        if self.interface == "slcan" and self.bitrate not in SLCAN_BITRATES:
            known = ", ".join(map(str, SLCAN_BITRATES))
            yield Wrong(("bitrate",), self.bitrate, f"is none of slcan's: {known}")
        if self.interface == "udp_multicast" and not _is_multicast(self.channel):
            text = "should be the address of a multicast group, such as 239.74.163.2"
            yield Wrong(("channel",), self.channel, text)

    @property
    def medium(self) -> str:
        """Return the bus in words, the same for all drivers on it."""
        if self.interface == "slcan":
            return serial_line(self.channel.partition("@")[0])
        medium = f"CAN {self.interface} channel '{self.channel}'"
        return f"{medium} port {self.port}" if self.interface == "udp_multicast" else medium


def link_settings(options: BusOptions, fd: bool = False, data_bitrate: int | None = None) -> str:
    """Return what `ip link set ... up` takes besides, for the bit rates of the options.

    A controller that went bus-off restarts by itself.
    """
    if options.channel.startswith("vcan"):
        return "mtu 72" if fd else ""
    words = f"type can bitrate {options.bitrate} restart-ms {RESTART_MS}"
    if fd:
        words += f" dbitrate {data_bitrate or options.bitrate} fd on"
    return words


def refuse(wrong: Iterable[Wrong], title: str) -> None:
    """Raise one error that names the key of each thing that is wrong, if anything is."""
    details = [
        InitErrorDetails(
            type=PydanticCustomError("can_layout", "{text}", {"text": w.message}),
            loc=w.key,
            input=w.found,
        )
        for w in wrong
    ]
    if details:
        raise ValidationError.from_exception_data(title, details)


def _is_multicast(text: str) -> bool:
    try:
        return ip_address(text).is_multicast
    except ValueError:
        return False
