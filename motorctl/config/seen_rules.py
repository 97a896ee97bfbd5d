"""What axes need of a driver: switches that are told, both ends of one moment, patience."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from motorctl.config.dual_drive_keys import SECOND_END
from motorctl.config.exchange import Exchange, is_one_exchange
from motorctl.config.guard_keys import Guards
from motorctl.config.validation import read_keys
from motorctl.errors import Problem
from motorctl.hal import Channel, Status
from motorctl.located_yaml import Document

ROUNDING_S = 1e-9
"""How far a time may be above another that it stands for [s]: periods have no end as decimals. Any
other would do that is small beside a period. Chosen by hand."""
_SOUGHT = {
    "switch": (Status.HOME_SWITCH,),
    "index": (Status.INDEX_LATCHED,),
    "switch_index": (Status.HOME_SWITCH, Status.INDEX_LATCHED),
}
"""What each method of homing waits for."""
_LIMITS = Status.LIMIT_NEGATIVE | Status.LIMIT_POSITIVE
_WORDS = {
    Status.HOME_SWITCH: "home switch (home_switch)",
    Status.INDEX_LATCHED: "index mark (index_latched)",
}


def check_seen(
    document: Document, driver: str, exchange: Exchange, channels: Sequence[Channel]
) -> Iterator[Problem]:
    """Check that a driver tells what its axes are homed by, and both ends of a beam at once."""
    for i, channel in enumerate(channels):
        axis, second = channel.axis.removesuffix(SECOND_END), channel.axis.endswith(SECOND_END)
        if exchange.switches is not None:
            path = ("axes", axis, "homing", "method")
            method = document.at(path)
            for sought in _SOUGHT.get(method if isinstance(method, str) else "", ()):
                if not exchange.switches[i] & sought:
                    whose = f"'{channel.axis}', the second end" if second else f"'{channel.axis}'"
                    message = (
                        f"found '{method}', but driver '{driver}' is told of no {_WORDS[sought]} "
                        f"of {whose}: homing would never find it; name it among the driver's "
                        "signals (of a simulated plant: home_switch, encoder.index_marks_m), or "
                        "home by another method"
                    )
                    yield document.problem(path, message)
        if not second and exchange.switches is not None:
            own = [i for i, c in enumerate(channels) if c.axis.removesuffix(SECOND_END) == axis]
            if not any(exchange.switches[i] & _LIMITS for i in own):
                yield from _check_limit_switch(document, driver, axis)
        if second and exchange.sampled_apart_s:
            yield from _check_moments(document, driver, exchange.sampled_apart_s, axis)


def _check_limit_switch(document: Document, driver: str, axis: str) -> Iterator[Problem]:
    """Refuse a reaction to limit switches that nothing tells of; silent ones alone are noted."""
    path = ("axes", axis, "guards")
    guards = read_keys(Guards, document.part(path))
    if guards is None or guards.limit_switch == Guards().limit_switch:
        return
    message = (
        f"can never trip: driver '{driver}' is told of no limit switch of '{axis}'; give it "
        "limit_negative and limit_positive (or a simulated plant limit_switches_m), or remove the "
        "guard here"
    )
    yield document.problem((*path, "limit_switch"), message)


def _check_moments(document: Document, driver: str, apart_s: float, axis: str) -> Iterator[Problem]:
    path = ("axes", axis, "guards", "skew", "limit_m")
    limit_m = document.at(path)
    speed_m_s = document.at(("axes", axis, "limits", "max_velocity_m_s"))
    if not (isinstance(limit_m, int | float) and isinstance(speed_m_s, int | float)):
        return
    passed_m = speed_m_s * apart_s
    if limit_m <= passed_m:
        message = (
            f"found {limit_m:g}, would trip in ordinary motion: the samples of the two ends that "
            f"driver '{driver}' brings may lie {apart_s * 1e3:g} ms apart, in which a beam goes "
            f"{passed_m:.3g} m at limits.max_velocity_m_s {speed_m_s:g}; let the device sample "
            "both at once (CAN: sync, or both counts in one frame)"
        )
        yield document.problem(path, message)


def check_patience(
    document: Document,
    driver: str,
    exchange: Exchange,
    channels: Sequence[Channel],
    period_s: float,
    hold_ticks: int,
) -> Iterator[Problem]:
    """Check that a pause of the computer for which an axis would wait is one that a driver bears.

    Beyond its device's watchdog, and where one exchange a period carries command and sample beyond
    `late.hold_ticks`, the guard trips whatever is written.
    """
    limits = []
    if exchange.watchdog_s is not None:
        limits.append((exchange.watchdog_s, "which its device's watchdog goes on for"))
    if is_one_exchange(round(exchange.delay_s / period_s, 6)):
        told = f"late.hold_ticks {hold_ticks} of driver '{driver}' at {1.0 / period_s:g} Hz"
        limits.append((hold_ticks * period_s, told))
    for axis in dict.fromkeys(channel.axis.removesuffix(SECOND_END) for channel in channels):
        path = ("axes", axis, "guards", "host_frozen", "time_s")
        time_s = document.at(path)
        if not limits or not isinstance(time_s, int | float):
            continue
        most_s, why = min(limits)
        if time_s > most_s + ROUNDING_S:
            message = (
                f"found {time_s:g}, does nothing: guards.host_frozen trips after {most_s:g} s "
                f"already, {why}; should be at most that, or be removed"
            )
            yield document.problem(path, message)
