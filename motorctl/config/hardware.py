"""The drivers of a machine: found, their options checked, their channels and rates tried."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from motorctl.config.axis_keys import Encoder, Limits
from motorctl.config.dual_drive_keys import SECOND_END, DualDrive
from motorctl.config.exchange import ask_exchange
from motorctl.config.keys import DriverKeys
from motorctl.config.machine import Axis, DriverSetup
from motorctl.config.seen_rules import check_patience, check_seen
from motorctl.config.validation import read_keys, suggest, validate_options
from motorctl.errors import MotorctlError, Problem, UsageError
from motorctl.hal import Channel, driver_class
from motorctl.located_yaml import Document, KeyPath, holds

WAIT_SHARE = 0.8
"""Of the loop's period: the rest is for computing and for the writes."""

_NO_HOLD = (
    "found 0, guards.no_new_sample would always trip: the device samples by a clock of its own, "
    "which is never quite the loop's, so that now and then a tick finds no new sample; should be "
    "at least 1"
)


@dataclass(frozen=True)
class Wiring:
    """Which driver serves an axis, and on which of its channels."""

    driver: str
    channel: Channel


def wire(
    axis: str,
    driver: str,
    channel: int,
    dual: DualDrive | None,
    encoder: Encoder,
    limits: Limits,
) -> tuple[Wiring, ...]:
    """Return what these keys of an axis say of its channel, or of its two."""
    known = (encoder.resolution_m, encoder.counter_bits, limits.max_voltage_v)
    first = Wiring(driver, Channel(axis, channel, *known))
    if dual is None:
        return (first,)
    return (first, Wiring(driver, Channel(axis + SECOND_END, dual.channel, *known)))


def wirings_of(axes: Iterable[Axis]) -> list[Wiring]:
    """Return the wirings of axes of a machine."""
    return [
        wiring
        for axis in axes
        for wiring in wire(
            axis.name, axis.driver, axis.channel, axis.dual_drive, axis.encoder, axis.limits
        )
    ]


def channels_of(driver: str, wirings: Iterable[Wiring]) -> tuple[Channel, ...]:
    """Return the channels that a driver serves, in the order of its arrays: by their numbers."""
    own = (wiring.channel for wiring in wirings if wiring.driver == driver)
    return tuple(sorted(own, key=lambda channel: channel.number))


def build_drivers(
    document: Document, directory: Path
) -> tuple[dict[str, DriverSetup], list[Problem]]:
    """Find every driver and check its options.

    Returns
    -------
    tuple
        Those without problems, and the problems of the others. Files that options name are looked
        for in `directory`.
    """
    found: dict[str, DriverSetup] = {}
    problems: list[Problem] = []
    for name, part in document.part(("drivers",)).items():
        path = ("drivers", name)
        keys = read_keys(DriverKeys, part)
        if keys is None:
            continue
        try:
            cls = driver_class(keys.type)
        except UsageError as error:
            problems.append(document.problem((*path, "type"), str(error)))
            continue
        also, context = DriverKeys.model_fields, {"directory": directory}
        options, refusals = validate_options(
            document, path, cls.Options, keys.options, also, context
        )
        problems += refusals
        if options is not None:
            found[name] = DriverSetup(name, keys.type, cls, options, keys.late)
    return found, problems


def check_claims(document: Document) -> list[Problem]:
    """Check that every axis names a driver, every channel has one axis, and every driver one."""
    problems: list[Problem] = []
    known = list(document.part(("drivers",)))
    taken: dict[tuple[str, int], tuple[str, KeyPath]] = {}
    for axis, driver, channel, where in _claims(document):
        if driver not in known and where == ("channel",):
            message = f"unknown driver '{driver}'; {suggest(driver, known)}"
            problems.append(document.problem(("axes", axis, "driver"), message))
        if channel is None:
            continue
        first = taken.setdefault((driver, channel), (axis, where))
        if first != (axis, where):
            message = f"found {channel}, which axis '{first[0]}' uses already"
            problems.append(document.problem(("axes", axis, *where), message))
    used = {driver for _, driver, _, _ in _claims(document)}
    message = "serves no axis; name it in an axis or remove it"
    if isinstance(document.at(("axes",)), dict):
        unused = [name for name in known if name not in used]
        problems += [document.problem(("drivers", name), message) for name in unused]
    return problems


def check_rates(
    document: Document,
    drivers: Mapping[str, DriverSetup],
    wirings: Sequence[Wiring],
    rate_hz: float | None,
    divisors: Mapping[str, int],
) -> list[Problem]:
    """Check the rate against every driver's budget, where all of its axes could be read."""
    problems: list[Problem] = []

    def add(name: str, message: str, *where: str | int) -> None:
        problems.append(document.problem(("drivers", name, *where), message))

    claimed = [driver for _, driver, _, _ in _claims(document)]
    waits_s: dict[str, float] = {}
    media: dict[str, str] = {}
    for name, setup in drivers.items():
        channels = channels_of(name, wirings)
        distinct = {channel.number for channel in channels}
        if not channels or not len(distinct) == len(channels) == claimed.count(name):
            continue
        if rate_hz is None or name not in divisors:
            continue
        own_rate_hz = rate_hz / divisors[name]
        try:
            exchange = ask_exchange(setup, channels, 1.0 / own_rate_hz)
        except MotorctlError as error:
            add(name, str(error))
            continue
        for path, message in exchange.problems:
            add(name, message, *path)
        problems += check_seen(document, name, exchange, channels)
        problems += check_patience(
            document, name, exchange, channels, 1.0 / own_rate_hz, setup.late.hold_ticks
        )
        if exchange.own_clock and setup.late.hold_ticks == 0:
            add(name, _NO_HOLD, "late", "hold_ticks")
        if exchange.medium is not None:
            first = media.setdefault(exchange.medium, name)
            if first != name:  # neither could tell what is on it
                add(name, _shared(exchange.medium, first))
        waits_s[name] = exchange.wait_s
        budget = exchange.budget
        if budget and not own_rate_hz <= budget.max_rate_hz:
            own = holds(document.at(("drivers", name)), "rate_hz")
            where: KeyPath = ("drivers", name, "rate_hz") if own else ("rate_hz",)
            message = (
                f"found {own_rate_hz:g}, driver '{name}' carries at most "
                f"{budget.max_rate_hz:.6g} Hz: {budget.arithmetic}"
                + ("" if own else f"; give drivers.{name} a rate_hz of its own, or lower this one")
            )
            problems.append(document.problem(where, message))
    waiting = {name: wait_s for name, wait_s in waits_s.items() if wait_s > 0.0}
    if rate_hz is not None and sum(waiting.values()) > WAIT_SHARE / rate_hz:
        slowest = max(waiting, key=lambda name: waiting[name])
        add(slowest, _too_long(waiting, rate_hz))
    return problems


def _shared(medium: str, first: str) -> str:
    return (
        f"is on {medium}, which driver '{first}' has already: neither could tell what the "
        "other sends there, nor how much; give one of them all axes, or this one another line"
    )


def _too_long(waiting: Mapping[str, float], rate_hz: float) -> str:
    """Return the problem that the waits of all drivers do not fit into one tick."""
    told = ", ".join(f"{name} {1e6 * wait_s:.0f} us" for name, wait_s in waiting.items())
    return (
        f"the drivers may wait for their devices in one tick: {told}; the loop's period at "
        f"{rate_hz:g} Hz leaves {1e6 * WAIT_SHARE / rate_hz:.0f} us for that: shorten wait_s, or "
        "let the slower device answer without being waited for (serial: mode exchange or stream; "
        "CAN: without sync)"
    )


def _claims(document: Document) -> list[tuple[str, str, int | None, KeyPath]]:
    """Return (axis, driver, channel, key of it) of every end of an axis that names a driver."""
    found: list[tuple[str, str, int | None, KeyPath]] = []
    for name, axis in document.part(("axes",)).items():
        driver = axis.get("driver") if isinstance(axis, dict) else None
        if not isinstance(driver, str):
            continue
        dual = axis.get("dual_drive")
        ends: list[tuple[object, KeyPath]] = [(axis.get("channel"), ("channel",))]
        if isinstance(dual, dict):
            ends.append((dual.get("channel"), ("dual_drive", "channel")))
        for channel, where in ends:
            plain = isinstance(channel, int) and not isinstance(channel, bool)
            found.append((name, driver, int(channel) if plain else None, where))  # type: ignore[call-overload]
    return found
