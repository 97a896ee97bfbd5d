"""How long a period's frames take on the line, and so how many periods a second it carries."""

from __future__ import annotations

from motorctl.hal import RateBudget
from motorctl_serial.frames import OVERHEAD_BYTES
from motorctl_serial.options import SerialOptions
from motorctl_serial.protocol import (
    BARE_BYTES,
    COMMAND_CHANNEL_BYTES,
    COMMAND_HEAD_BYTES,
    STATE_CHANNEL_BYTES,
    STATE_HEAD_BYTES,
    STATE_INDEX_BYTES,
)

BITS_A_BYTE = 10
"""Start bit, 8 data bits, stop bit."""
SHARE_OF_PERIOD = 0.8
HALF_DUPLEX_BYTE_TIMES = 4
"""Two changes of direction of two byte times each."""
UART_TURNAROUND_S = 0.1e-3
USB_TURNAROUND_S = 1e-3
# Measured with a peer in another process on two busy cores: 80 to 140 us in the median, 300 to
# 370 us in one exchange of a hundred.
PTY_TURNAROUND_S = 0.4e-3
DEFAULT_WAIT_PERIODS = 0.7

POLL_WIRE_BYTES = BARE_BYTES + OVERHEAD_BYTES


def command_wire_bytes(channels: int) -> int:
    """Return the number of bytes of COMMAND or EXCHANGE on the wire."""
    return COMMAND_HEAD_BYTES + COMMAND_CHANNEL_BYTES * channels + OVERHEAD_BYTES


def state_wire_bytes(channels: int) -> int:
    """Return the bytes of the longest STATE on the wire: an index mark on each channel."""
    a_channel = STATE_CHANNEL_BYTES + STATE_INDEX_BYTES
    return STATE_HEAD_BYTES + a_channel * channels + OVERHEAD_BYTES


def byte_s(options: SerialOptions) -> float:
    """Return the time of a byte [s]; 0 where there is no bit rate."""
    return BITS_A_BYTE / options.baud if options.baud else 0.0


def turnaround_s(options: SerialOptions) -> tuple[float, str]:
    """Return how long an answer takes beside its bytes [s], and why."""
    if options.turnaround_s is not None:
        return options.turnaround_s, "turnaround_s"
    # By-id names of adapters begin with usb-; ttyUSB and ttyACM hold it in capitals.
    if any(word in options.port.lower() for word in ("usb", "ttyacm", "ttygs")):
        why = "USB: a latency timer of 1 ms at best, or a full-speed frame, at any baud rate"
        return USB_TURNAROUND_S, why
    if options.baud is None:
        return PTY_TURNAROUND_S, "pseudo-terminal: two changes of process, the order measured"
    return UART_TURNAROUND_S, "UART and firmware"


def round_trip_s(options: SerialOptions, channels: int) -> float:
    """Return the time from a request to the end of the longest STATE [s]."""
    request = POLL_WIRE_BYTES if options.mode == "poll" else command_wire_bytes(channels)
    pause = HALF_DUPLEX_BYTE_TIMES / 2 if options.one_pair else 0
    wire = (request + pause + state_wire_bytes(channels)) * byte_s(options)
    return wire + turnaround_s(options)[0]


def rate_budget(options: SerialOptions, channels: int, period_s: float) -> RateBudget:
    """Compute the highest rate of a session.

    Parameters
    ----------
    options
        The driver's options.
    channels
        Channels in the session.
    period_s
        Of the loop [s]; for the explanation alone.
    """
    state, command = state_wire_bytes(channels), command_wire_bytes(channels)
    pause_s, pause_why = turnaround_s(options)
    frames = {
        "poll": f"POLL {POLL_WIRE_BYTES} + STATE {state} + COMMAND {command}",
        "exchange": f"EXCHANGE {command} + STATE {state}",
        "stream": f"the longer of STATE {state} and COMMAND {command}, which overlap",
    }[options.mode]
    count = {
        "poll": POLL_WIRE_BYTES + state + command,
        "exchange": command + state,
        "stream": max(state, command),
    }[options.mode]
    if options.one_pair:
        count += HALF_DUPLEX_BYTE_TIMES
        frames += f" + {HALF_DUPLEX_BYTE_TIMES} byte times for two changes of direction"
    wire_s = count * byte_s(options)
    overlaps = options.mode == "stream"
    cost_s = max(wire_s, pause_s) if overlaps else wire_s + pause_s
    if options.baud is None:
        line = f"{count} bytes; the port has no bit rate, so they take no time that counts"
    else:
        line = (
            f"{count} bytes x {BITS_A_BYTE} bits (8N1) at {options.baud} baud = "
            f"{wire_s * 1e6:.0f} us"
        )
    arithmetic = (
        f"mode {options.mode}, {channels} channel{'' if channels == 1 else 's'}: {frames} = "
        f"{line} (frames with CRC, COBS byte and delimiter; STATE with index marks); "
        f"{'or, if longer,' if overlaps else 'and'} {pause_s * 1e6:.0f} us of turnaround "
        f"({pause_why}): {cost_s * 1e6:.0f} us, {cost_s / period_s:.0%} of a period of "
        f"{period_s * 1e6:.0f} us; at most {SHARE_OF_PERIOD:.0%} may be used"
    )
    return RateBudget(SHARE_OF_PERIOD / cost_s, arithmetic)
