"""How fast one exchange a period can be, from the bytes on the wire alone."""

from __future__ import annotations

from motorctl.hal import RateBudget
from motorctl_modbus.options import Rtu

SHARE_OF_PERIOD = 0.9
"""The rest is for jitter: a reply that misses its `read` is a stale period."""
HOST_S = 150e-6
"""Both ways through network stack and interpreter; on loopback 40 to 90 us were measured in the
median, 130 us in one exchange of a hundred."""
ETHERNET_BIT_S = 10e-9
HEADERS = 90
"""Preamble 8, Ethernet 14 + 4, gap 12, IP 20, TCP 20 + 12 of time stamps."""


def tcp_exchange_s(written: int, read: int, turnaround_s: float) -> float:
    """Return the time of one exchange on TCP, this machine's part included.

    Parameters
    ----------
    written, read
        Registers in a request and in its reply.
    turnaround_s
        From the end of a request to the start of its reply, in the device [s].

    Returns
    -------
    float
        Time [s].
    """
    return _tcp_wire_s(written, read) + turnaround_s + HOST_S


def rtu_exchange_s(rtu: Rtu, written: int, read: int, turnaround_s: float) -> float:
    """Return the time from one request to the earliest start of the next.

    Parameters
    ----------
    rtu
        The line's settings.
    written, read
        Registers in a request and in its reply.
    turnaround_s
        From the end of a request to the start of its reply, in the device [s].

    Returns
    -------
    float
        Time [s].
    """
    characters = _rtu_request(written) + _rtu_reply(read)
    return characters * rtu.character_s + 2 * rtu.t35_s + turnaround_s


def tcp_budget(written: int, read: int, turnaround_s: float) -> RateBudget:
    """Return the highest rate on TCP."""
    exchange_s = tcp_exchange_s(written, read, turnaround_s)
    return _budget(
        exchange_s,
        f"request {_tcp_request(written)} and reply {_tcp_reply(read)} bytes of Modbus TCP with "
        f"{HEADERS} bytes of headers each, and two acknowledgements, at 100 Mbit/s are "
        f"{_tcp_wire_s(written, read) * 1e6:.0f} us; device_turnaround_s "
        f"{turnaround_s * 1e6:.0f} us; this machine {HOST_S * 1e6:.0f} us",
    )


def rtu_budget(rtu: Rtu, written: int, read: int, turnaround_s: float) -> RateBudget:
    """Return the highest rate on RTU."""
    exchange_s = rtu_exchange_s(rtu, written, read, turnaround_s)
    characters = _rtu_request(written) + _rtu_reply(read)
    return _budget(
        exchange_s,
        f"request {_rtu_request(written)} and reply {_rtu_reply(read)} characters of "
        f"{rtu.character_s * rtu.baud:.0f} bit at {rtu.baud} baud are "
        f"{characters * rtu.character_s * 1e3:.2f} ms; twice t3.5 of {rtu.t35_s * 1e3:.2f} ms; "
        f"device_turnaround_s {turnaround_s * 1e3:.2f} ms",
    )


def _budget(exchange_s: float, parts: str) -> RateBudget:
    rate_hz = SHARE_OF_PERIOD / exchange_s
    return RateBudget(
        rate_hz,
        f"one exchange of function code 23 a period: {parts}; together "
        f"{exchange_s * 1e3:.3f} ms, which may take {SHARE_OF_PERIOD:.0%} of a period: "
        f"{rate_hz:.0f} Hz",
    )


def _tcp_request(written: int) -> int:
    return 17 + 2 * written


def _tcp_reply(read: int) -> int:
    return 9 + 2 * read


def _tcp_wire_s(written: int, read: int) -> float:
    size = _tcp_request(written) + _tcp_reply(read) + 4 * HEADERS
    return size * 8 * ETHERNET_BIT_S


def _rtu_request(written: int) -> int:
    return 13 + 2 * written


def _rtu_reply(read: int) -> int:
    return 5 + 2 * read
