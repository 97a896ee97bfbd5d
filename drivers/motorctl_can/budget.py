"""How long frames take on a bus, and so how many periods a second it carries.

The worst case of bit stuffing is counted everywhere: a stuff bit after every four bits that follow
the first.
"""

from __future__ import annotations

from dataclasses import dataclass

from motorctl.hal import RateBudget
from motorctl_can.bus import BusOptions
from motorctl_can.layout import Layout
from motorctl_can.options import CanOptions

SHARE_OF_BUS = 0.8
WHY_SHARE = "the rest is for repeating a disturbed frame within its period and for jitter"
SHARE_OF_HOST = 0.5
# Sending or receiving one frame and its part of the codec. `virtual`: measured on one core of a
# virtual machine at about half of that. `udp_multicast`: a third of what an exchange of three
# frames takes, 65 us in the median and 150 us in one of a hundred, the device's work included.
HOST_COST_S = {"virtual": 15e-6, "udp_multicast": 160e-6}
# With SYNC the answers have to come back through the adapter within the period.
ADAPTER_TURNAROUND_S = 0.5e-3
USB_TURNAROUND_S = 1e-3
USB_WORDS = ("usb", "ttyacm", "ttygs")
BITS_A_CHARACTER = 10  # 8N1
ANSWER_CHARACTERS = 2  # of a slcan adapter to a frame sent

# classic: start, identifier, remote, extension, reserved, length, CRC are stuffed
CLASSIC_STUFFED = {False: 34, True: 54}
CLASSIC_UNSTUFFED = 13  # CRC delimiter, acknowledge and its delimiter, end, interframe space
# FD: start, identifier, remote, extension, format, reserved, rate switch at the nominal rate
FD_ARBITRATION = {False: 17, True: 36}
FD_CONTROL = 5  # error state, length
FD_CHECK = {False: 4 + 17 + 6, True: 4 + 21 + 7}  # stuff count, CRC, their fixed stuff bits


@dataclass(frozen=True)
class Wire:
    """The rates of a bus, and whether its frames are CAN FD."""

    bitrate: int
    fd: bool = False
    data_bitrate: int | None = None

    def frame_s(self, length: int, extended: bool = False) -> float:
        """Return the longest time that a frame occupies the bus, with interframe space [s]."""
        if not self.fd:
            return classic_bits(length, extended) / self.bitrate
        nominal, data = fd_bits(length, extended)
        return nominal / self.bitrate + data / (self.data_bitrate or self.bitrate)


@dataclass(frozen=True)
class Sent:
    """A frame of a period."""

    name: str
    length: int
    extended: bool = False


@dataclass(frozen=True)
class Traffic:
    """What a bus carries in a period."""

    options: BusOptions
    wire: Wire
    commands: tuple[Sent, ...]
    states: tuple[Sent, ...]
    sync: Sent | None = None
    wait_s: float = 0.0
    """How long a read may wait for the answers to SYNC."""


def traffic(options: CanOptions, layout: Layout) -> Traffic:
    """Return what a bus with this layout carries in a period."""
    commands = tuple(Sent(f.name, f.length, f.extended) for f in layout.commands)
    states = tuple(Sent(f.name, f.length, f.extended) for f in layout.states)
    wire = Wire(options.bitrate, options.fd, options.data_bitrate)
    if options.sync is None:
        return Traffic(options, wire, commands, states)
    sync = Sent("SYNC", 0, options.sync.extended)
    return Traffic(options, wire, commands, states, sync, options.sync.wait_s)


def classic_bits(length: int, extended: bool = False, stuffed: bool = True) -> int:
    """Count the bits of a classic frame, with the most stuff bits or with none."""
    open_to_stuffing = CLASSIC_STUFFED[extended] + 8 * length
    stuff = (open_to_stuffing - 1) // 4 if stuffed else 0
    return open_to_stuffing + stuff + CLASSIC_UNSTUFFED


def fd_bits(length: int, extended: bool = False) -> tuple[int, int]:
    """Count the most bits of an FD frame at the nominal rate and at the data rate."""
    arbitration = FD_ARBITRATION[extended]
    stuff_before = (arbitration - 1) // 4
    stuff = (arbitration + FD_CONTROL + 8 * length - 1) // 4
    nominal = arbitration + stuff_before + CLASSIC_UNSTUFFED
    return nominal, FD_CONTROL + 8 * length + stuff - stuff_before + FD_CHECK[length > 16]


def slcan_characters(length: int, extended: bool = False) -> int:
    """Count the characters in which an adapter writes a frame, with its line end."""
    return (1 + 8 if extended else 1 + 3) + 1 + 2 * length + 1


def answer_s(traffic: Traffic) -> float:
    """Return the longest time that SYNC and all answers take on the bus [s]."""
    frames = [*traffic.states, *([traffic.sync] if traffic.sync else [])]
    return sum(traffic.wire.frame_s(f.length, f.extended) for f in frames)


def rate_budget(traffic: Traffic) -> RateBudget:
    """Compute the highest rate at which all frames of a period fit."""
    if traffic.options.interface in HOST_COST_S:
        budget = _host_budget(traffic)
    else:
        budget = _bus_budget(traffic)
        if traffic.options.interface == "slcan":
            line = _line_budget(traffic)
            lower = line if line.max_rate_hz < budget.max_rate_hz else budget
            both = f"{budget.arithmetic}; {line.arithmetic}"
            budget = RateBudget(lower.max_rate_hz, both)
    if traffic.sync is None:
        return budget
    rate = SHARE_OF_BUS / traffic.wait_s
    if rate >= budget.max_rate_hz:
        return budget
    text = (
        f"a read may wait sync.wait_s = {traffic.wait_s * 1e6:g} us for answers, and that at "
        f"most {SHARE_OF_BUS:.0%} of a period: at most {rate:.0f} Hz; {budget.arithmetic}"
    )
    return RateBudget(rate, text)


def _bus_budget(traffic: Traffic) -> RateBudget:
    wire = traffic.wire
    parts, total_s = [], 0.0
    for frame in _frames(traffic):
        time_s = wire.frame_s(frame.length, frame.extended)
        parts.append(f"{frame.name} ({frame.length} B) {time_s * 1e6:.1f} us")
        total_s += time_s
    rate = SHARE_OF_BUS / total_s
    kind = f"CAN{' FD' if wire.fd else ''} at {wire.bitrate / 1e6:g}"
    if wire.fd and wire.data_bitrate:
        kind += f"/{wire.data_bitrate / 1e6:g}"
    text = (
        f"{kind} Mbit/s, worst-case stuffing: {' + '.join(parts)} = {total_s * 1e6:.1f} us a "
        f"period, and may take {SHARE_OF_BUS:.0%} of one ({WHY_SHARE}): at most {rate:.0f} Hz; a "
        "USB adapter collects frames for up to 1 ms, which is not counted"
    )
    return RateBudget(rate, text)


def _line_budget(traffic: Traffic) -> RateBudget:
    options = traffic.options
    out = [slcan_characters(f.length, f.extended) for f in traffic.commands]
    if traffic.sync is not None:
        out.append(slcan_characters(0, traffic.sync.extended))
    sent = sum(out)
    received = sum(slcan_characters(f.length, f.extended) for f in traffic.states)
    received += ANSWER_CHARACTERS * len(out)
    total_s = max(sent, received) * BITS_A_CHARACTER / options.tty_baudrate
    text = (
        f"slcan writes {sent} characters a period and gets {received}, of 10 bits at "
        f"{options.tty_baudrate} baud: {total_s * 1e6:.0f} us"
    )
    if traffic.sync is not None:
        usb = any(word in options.channel.lower() for word in USB_WORDS)
        pause_s = USB_TURNAROUND_S if usb else ADAPTER_TURNAROUND_S
        total_s += pause_s
        text += (
            f", and {'USB and adapter' if usb else 'the adapter'} may keep the answers to SYNC "
            f"for {pause_s * 1e6:.0f} us"
        )
    rate = SHARE_OF_BUS / total_s
    text += f", {SHARE_OF_BUS:.0%} of a period: at most {rate:.0f} Hz"
    return RateBudget(rate, text)


def _host_budget(traffic: Traffic) -> RateBudget:
    interface = traffic.options.interface
    frames = len(_frames(traffic))
    cost_s = HOST_COST_S[interface]
    rate = SHARE_OF_HOST / (frames * cost_s)
    text = (
        f"no bus ({interface}); the host itself takes about {cost_s * 1e6:.0f} us a frame "
        f"x {frames} frames = {frames * cost_s * 1e6:.0f} us a period, and may take "
        f"{SHARE_OF_HOST:.0%} of one: at most {rate:.0f} Hz"
    )
    return RateBudget(rate, text)


def _frames(traffic: Traffic) -> list[Sent]:
    sync = [traffic.sync] if traffic.sync else []
    return [*sync, *traffic.commands, *traffic.states]
