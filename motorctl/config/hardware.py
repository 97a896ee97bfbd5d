"""The drivers of a machine: found, their options checked, their channels and rates tried."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from motorctl.config.document import Document
from motorctl.config.machine import Axis, DriverSetup
from motorctl.config.shape import DriverShape, options_of
from motorctl.config.validation import suggest, validate, validate_options
from motorctl.errors import MotorctlError, UsageError
from motorctl.hal import Channel, Driver, RateBudget, driver_class


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


def rate_budget(setup: DriverSetup, channels: tuple[Channel, ...], period_s: float) -> RateBudget:
    """Ask a driver for its budget. Raises UsageError where it refuses options or channels."""
    try:
        driver: Driver = setup.cls(setup.options, channels, period_s)
        return driver.rate_budget()
    except MotorctlError:
        raise
    except Exception as error:
        raise UsageError(f"{type(error).__name__}: {error}") from error


def build_drivers(document: Document) -> dict[str, DriverSetup]:
    """Find every driver and check its options; those with problems are noted and left out."""
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
        options = validate_options(document, path, cls.Options, options_of(shape), ["type"])
        if options is not None:
            found[name] = DriverSetup(name, shape.type, cls, options)
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
) -> None:
    """Check the rate against every driver's budget, where all of its axes could be read."""
    claimed = [driver for _, driver, _ in _claims(document)]
    for name, setup in drivers.items():
        channels = channels_of(name, wirings)
        distinct = {channel.number for channel in channels}
        if not channels or not len(distinct) == len(channels) == claimed.count(name):
            continue
        if rate_hz is None:
            continue
        try:
            budget = rate_budget(setup, channels, 1.0 / rate_hz)
        except MotorctlError as error:
            document.add(("drivers", name), str(error))
            continue
        if not rate_hz <= budget.max_rate_hz:
            document.add(
                ("rate_hz",),
                f"found {rate_hz:g}, driver '{name}' carries at most {budget.max_rate_hz:.6g} Hz: "
                f"{budget.arithmetic}",
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
