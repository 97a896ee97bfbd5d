"""At which rate each driver of a new machine can run, and with which options it begins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from motorctl.config.exchange import Exchange, ask_exchange
from motorctl.config.hardware import WAIT_SHARE
from motorctl.config.keys import LateSamples
from motorctl.config.machine import DriverSetup
from motorctl.errors import MotorctlError, UsageError
from motorctl.hal import Channel, Driver, FirstAxis, FirstOptions, driver_class
from motorctl.init.known import driver_key

USUAL_HZ = (5000, 4000, 2500, 2000, 1000, 500, 400, 250, 200, 100, 50, 25, 20, 10)
"""Rates that are tried, the highest first. Five thousand is what the published gantry has."""
BUDGET_SHARE = 0.8
"""Of the highest rate that a driver carries by its arithmetic. More leaves nothing for a repeated
frame or a slow reply, less gives phase away. By hand."""
ABOUT = "--driver-option"


@dataclass(frozen=True)
class FirstDriver:
    """A driver with the options that it begins with."""

    name: str
    cls: type[Driver]
    rate_hz: float
    first: FirstOptions
    options: Mapping[str, Any]
    """Those of `first`, and over them what was told."""
    exchange: Exchange


def first_drivers(
    axes: Mapping[str, tuple[FirstAxis, ...]],
    given: Mapping[str, Mapping[str, Any]],
    rate_hz: float | None,
    found: Mapping[str, Mapping[str, Any]] | None = None,
) -> dict[str, FirstDriver]:
    """Return every driver at the highest usual rate that it carries beside the others.

    Parameters
    ----------
    axes
        What each driver serves, by its type.
    given
        Options that were told, by the driver's type.
    rate_hz
        Of the loop, as it was told [Hz]; None: the highest usual one.
    found
        Options that a device itself has told, by the driver's type, in the place of first ones.

    Raises
    ------
    UsageError
        Where a driver does not exist, refuses its options, or carries none of the rates.
    """
    classes = {name: driver_class(name) for name in axes}
    refusal = ""
    for loop_hz in USUAL_HZ if rate_hz is None else (rate_hz,):
        drivers: dict[str, FirstDriver] = {}
        for name, served in axes.items():
            told = given.get(name, {}), (found or {}).get(name)
            driver, refusal = _fastest(name, classes[name], served, told, loop_hz)
            if driver is None:
                break
            drivers[name] = driver
        waits_s = sum(driver.exchange.wait_s for driver in drivers.values())
        # The loop ticks as fast as its fastest driver: what none of them needs is not asked for.
        fastest = max((driver.rate_hz for driver in drivers.values()), default=0.0)
        if len(drivers) == len(axes) and fastest == loop_hz and waits_s <= WAIT_SHARE / loop_hz:
            return drivers
    whose = "" if rate_hz is None else f"--rate {rate_hz:g}Hz: "
    raise UsageError(f"{whose}{refusal or 'the drivers wait too long for their devices'}")


def _fastest(
    name: str,
    cls: type[Driver],
    axes: tuple[FirstAxis, ...],
    told: tuple[Mapping[str, Any], Mapping[str, Any] | None],
    loop_hz: float,
) -> tuple[FirstDriver | None, str]:
    """Return a driver at the highest whole part of the loop's rate, or why there is none.

    told: options by a person, and by the device.
    """
    given, found = told
    refusal = ""
    rates = (loop_hz, *(usual for usual in USUAL_HZ if usual < loop_hz and not loop_hz % usual))
    for rate_hz in rates:
        first = cls.first_options(axes, 1.0 / rate_hz) if found is None else FirstOptions(found)
        options = merged(first.options, given)
        exchange, refusal = _ask(name, cls, axes, options, rate_hz)
        if exchange is not None:
            return FirstDriver(name, cls, rate_hz, first, options, exchange), ""
    return None, refusal


def _ask(
    name: str,
    cls: type[Driver],
    axes: tuple[FirstAxis, ...],
    options: Mapping[str, Any],
    rate_hz: float,
) -> tuple[Exchange | None, str]:
    own = {key: value for key, value in options.items() if key != "late"}
    try:
        read = cls.Options.model_validate(own, context={"directory": Path.cwd()})
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, (driver_key(name), *first["loc"])))
        raise UsageError(f"{ABOUT} {where}: {first['msg']}") from error
    setup = DriverSetup(name, name, cls, read, LateSamples())
    channels = tuple(
        Channel(a.name, a.channel, a.resolution_m, a.counter_bits, a.max_voltage_v) for a in axes
    )
    try:
        exchange = ask_exchange(setup, channels, 1.0 / rate_hz)
    except MotorctlError as error:
        return None, f"driver {name}: {error}"
    if exchange.problems or exchange.budget is None:
        path, words = exchange.problems[0]
        return None, f"driver {name}: {'.'.join(map(str, path))}: {words}"
    if rate_hz > BUDGET_SHARE * exchange.budget.max_rate_hz:
        return None, (
            f"driver {name} carries at most {exchange.budget.max_rate_hz:.6g} Hz, and "
            f"{1.0 - BUDGET_SHARE:.0%} of it are kept free: {exchange.budget.arithmetic}"
        )
    return exchange, ""


def merged(base: Mapping[Any, Any], over: Mapping[Any, Any]) -> dict[Any, Any]:
    """Return options with others over them, key by key; None in `over` takes a key away."""
    result = dict(base)
    for key, value in over.items():
        before = result.get(key)
        if isinstance(value, Mapping) and isinstance(before, Mapping):
            result[key] = merged(before, value)
        elif value is None:
            result.pop(key, None)
        else:
            result[key] = value
    return result
