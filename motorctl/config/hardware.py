"""The drivers of a machine: found, their options checked, their channels and rates tried."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from motorctl.config.document import Document, holds
from motorctl.config.exchange import ask_exchange
from motorctl.config.machine import Axis, DriverSetup
from motorctl.config.shape import DriverShape, options_of
from motorctl.config.validation import suggest, validate, validate_options
from motorctl.errors import MotorctlError, UsageError
from motorctl.hal import Channel, driver_class

WAIT_SHARE = 0.8
"""Of the loop's period: the rest is for computing and for the writes."""


@dataclass(frozen=True)
class Wiring:
    """What an axis says of its channel."""

    axis: str
    driver: str
    channel: int
    resolution_m: float
    counter_bits: int
    max_voltage_v: float


def wiring_of(axis: Axis) -> Wiring:
    """Take an axis' wiring out of it."""
    return Wiring(
        axis.name,
        axis.driver,
        axis.channel,
        axis.encoder.resolution_m,
        axis.encoder.counter_bits,
        axis.limits.max_voltage_v,
    )


def channels_of(driver: str, wirings: Iterable[Wiring]) -> tuple[Channel, ...]:
    """Give the channels that a driver serves, in the order of its arrays: by their numbers."""
    return tuple(
        Channel(w.axis, w.channel, w.resolution_m, w.counter_bits, w.max_voltage_v)
        for w in sorted(wirings, key=lambda w: w.channel)
        if w.driver == driver
    )


def build_drivers(document: Document, directory: Path) -> dict[str, DriverSetup]:
    """Find every driver and check its options; those with problems are noted and left out.

    Files that options name are looked for in `directory`.
    """
    found: dict[str, DriverSetup] = {}
    parts = document.at(("drivers",))
    for name, part in (parts if isinstance(parts, dict) else {}).items():
        path = ("drivers", name)
        shape = validate(document, path, DriverShape, part, quiet=True)
        if shape is None:
            continue
        try:
            cls = driver_class(shape.type)
        except UsageError as error:
            document.add((*path, "type"), str(error))
            continue
        options = validate_options(
            document,
            path,
            cls.Options,
            options_of(shape),
            DriverShape.model_fields,
            {"directory": directory},
        )
        if options is not None:
            late = shape.late
            found[name] = DriverSetup(name, shape.type, cls, options, late.hold_ticks, late.predict)
    return found


def check_claims(document: Document) -> None:
    """Check that every axis names a driver, every channel has one axis, and every driver one."""
    drivers = document.at(("drivers",))
    known = list(drivers) if isinstance(drivers, dict) else []
    taken: dict[tuple[str, int], str] = {}
    for axis, driver, channel in _claims(document):
        if driver not in known:
            message = f"unknown driver '{driver}'; {suggest(driver, known)}"
            document.add(("axes", axis, "driver"), message)
        if channel is None:
            continue
        first = taken.setdefault((driver, channel), axis)
        if first != axis:
            message = f"found {channel}, which axis '{first}' uses already"
            document.add(("axes", axis, "channel"), message)
    used = {driver for _, driver, _ in _claims(document)}
    for name in known:
        if name not in used and isinstance(document.at(("axes",)), dict):
            document.add(("drivers", name), "serves no axis; name it in an axis or remove it")


def check_rates(
    document: Document,
    drivers: Mapping[str, DriverSetup],
    wirings: Sequence[Wiring],
    rate_hz: float | None,
    divisors: Mapping[str, int],
) -> None:
    """Check the rate against every driver's budget, where all of its axes could be read."""
    claimed = [driver for _, driver, _ in _claims(document)]
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
            document.add(("drivers", name), str(error))
            continue
        for path, message in exchange.problems:
            document.add(("drivers", name, *path), message)
        _check_medium(document, name, exchange.medium, media)
        waits_s[name] = exchange.wait_s
        budget = exchange.budget
        if budget and not own_rate_hz <= budget.max_rate_hz:
            own = holds(document.at(("drivers", name)), "rate_hz")
            document.add(
                ("drivers", name, "rate_hz") if own else ("rate_hz",),
                f"found {own_rate_hz:g}, driver '{name}' carries at most "
                f"{budget.max_rate_hz:.6g} Hz: {budget.arithmetic}"
                + ("" if own else f"; give drivers.{name} a rate_hz of its own, or lower this one"),
            )
    if rate_hz is not None:
        _check_waits(document, waits_s, rate_hz)


def _check_medium(document: Document, name: str, medium: str | None, media: dict[str, str]) -> None:
    """Check that no other driver has the same bus: neither could tell what is on it."""
    if medium is None:
        return
    first = media.setdefault(medium, name)
    if first != name:
        message = (
            f"is on {medium}, which driver '{first}' has already: neither could tell what the "
            "other sends there, nor how much; give one of them all axes, or this one another line"
        )
        document.add(("drivers", name), message)


def _check_waits(document: Document, waits_s: Mapping[str, float], rate_hz: float) -> None:
    """Check that all waits of one tick fit into it, those of slower drivers too."""
    waiting = {name: wait_s for name, wait_s in waits_s.items() if wait_s > 0.0}
    total_s = sum(waiting.values())
    if total_s <= WAIT_SHARE / rate_hz:
        return
    told = ", ".join(f"{name} {1e6 * wait_s:.0f} us" for name, wait_s in waiting.items())
    slowest = max(waiting, key=lambda name: waiting[name])
    document.add(
        ("drivers", slowest),
        f"the drivers may wait for their devices in one tick: {told}; the loop's period at "
        f"{rate_hz:g} Hz leaves {1e6 * WAIT_SHARE / rate_hz:.0f} us for that: shorten wait_s, or "
        "let the slower device answer without being waited for (serial: mode exchange or stream; "
        "CAN: without sync)",
    )


def _claims(document: Document) -> list[tuple[str, str, int | None]]:
    """Give (axis, driver, channel) of every axis that names a driver."""
    axes = document.at(("axes",))
    found = []
    for name, axis in (axes if isinstance(axes, dict) else {}).items():
        driver = axis.get("driver") if isinstance(axis, dict) else None
        if isinstance(driver, str):
            channel = axis.get("channel")
            plain = isinstance(channel, int) and not isinstance(channel, bool)
            found.append((name, driver, channel if plain else None))
    return found
