"""What a driver says of its exchange with the device, whoever wrote it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from motorctl.config.machine import DriverSetup
from motorctl.errors import MotorctlError, UsageError
from motorctl.hal import Channel, Driver, RateBudget, Status, Way
from motorctl.located_yaml import KeyPath


@dataclass(frozen=True)
class Exchange:
    """What a driver says of its exchange with the device."""

    problems: tuple[tuple[KeyPath, str], ...]
    budget: RateBudget | None
    """None where there are problems."""
    delay_s: float
    """How much later than in a direct exchange a command acts on what was read."""
    wait_s: float
    """How long the loop may have to wait for it in a tick."""
    watchdog_s: float | None
    """How long the device goes on without a command; None where nobody knows."""
    medium: str | None
    """The bus or line that it has for itself."""
    advice: tuple[str, ...]
    """What it leaves open that a safe machine would want."""
    own_clock: bool
    """Whether the device samples by a clock of its own."""
    sampled_apart_s: float
    """How far apart in time the samples of two channels may lie that come together."""
    switches: tuple[Status, ...] | None
    """Which switches and marks of each channel the device tells; None where nobody knows."""
    ways: tuple[Way | None, ...] | None
    """How far each channel can go, and what it meets there; None where nobody knows."""


def has_own_clock(delay_periods: float) -> bool:
    """Return whether a device samples by a clock of its own, by its driver's exchange delay.

    Samples that are taken when the loop asks are as old as whole periods; others are, on average,
    half a period older than that.
    """
    return delay_periods != round(delay_periods)


def is_one_exchange(delay_periods: float) -> bool:
    """Return whether one exchange a period carries command and sample, by the exchange delay.

    After skipped periods what it brings first may have been sampled before them.
    """
    return delay_periods >= 1.0


def ask_exchange(setup: DriverSetup, channels: tuple[Channel, ...], period_s: float) -> Exchange:
    """Ask a driver about its exchange; no I/O. Raises UsageError where it fails to answer."""
    try:
        driver: Driver = setup.cls(setup.options, channels, period_s)
        problems = tuple(_problem(told) for told in driver.problems())
        budget = None if problems else _budget(driver.rate_budget())
        delay_periods = _amount("exchange_delay_periods", driver.exchange_delay_periods)
        wait_s = _amount("longest_wait_s", driver.longest_wait_s)
        watchdog_s = _watchdog(driver.watchdog_s)
        medium = _medium(driver.medium)
        apart_s = _amount("sampled_apart_s", driver.sampled_apart_s)
        switches = None if problems else _switches(driver.switches(), len(channels))
        ways = _ways(driver.ways(), len(channels)) if driver.simulated and not problems else None
    except MotorctlError:
        raise
    except (Exception, SystemExit) as error:  # a driver of a third party may fail in any way
        raise UsageError(f"{type(error).__name__}: {error}") from error
    advice = () if problems else _advice(driver)
    delay_s, own_clock = delay_periods * period_s, has_own_clock(delay_periods)
    return Exchange(
        problems,
        budget,
        delay_s,
        wait_s,
        watchdog_s,
        medium,
        advice,
        own_clock,
        apart_s,
        switches,
        ways,
    )


def _wrong(what: str, told: Any, right: str) -> UsageError:
    return UsageError(f"the driver's {what} is {told!r}, should be {right}")


def _problem(told: Any) -> tuple[KeyPath, str]:
    if isinstance(told, tuple) and len(told) == 2:
        path, text = told
        keys = isinstance(path, tuple) and all(isinstance(key, (str, int)) for key in path)
        if keys and isinstance(text, str):
            return path, text
    raise _wrong("problems()", told, 'pairs as in (("frames", "command"), "what is wrong")')


def _medium(told: Any) -> str | None:
    if told is None or isinstance(told, str):
        return told
    raise _wrong("medium", told, "words, or None")


def _switches(told: Any, channels: int) -> tuple[Status, ...] | None:
    if told is None:
        return None
    if isinstance(told, list | tuple) and len(told) == channels:
        with suppress(TypeError, ValueError):
            return tuple(Status(bits) for bits in told)
    raise _wrong("switches()", told, f"bits of Status for each of {channels} channels, or None")


def _ways(told: Any, channels: int) -> tuple[Way | None, ...] | None:
    if told is None:
        return None
    whole = isinstance(told, list | tuple) and len(told) == channels
    if whole and all(way is None or isinstance(way, Way) for way in told):
        return tuple(told)
    raise _wrong("ways()", told, f"a Way or None for each of {channels} channels, or None")


def _budget(told: Any) -> RateBudget:
    if not isinstance(told, RateBudget):
        raise _wrong("rate_budget()", told, "a RateBudget")
    if not (_is_number(told.max_rate_hz) and told.max_rate_hz > 0):
        raise _wrong("rate_budget().max_rate_hz", told.max_rate_hz, "a number above 0")
    return told


def _amount(what: str, told: Any) -> float:
    if not (_is_number(told) and 0 <= told < math.inf):
        raise _wrong(what, told, "a finite number, 0 or more")
    return float(told)


def _watchdog(told: Any) -> float | None:
    if told is None or (_is_number(told) and told > 0):
        return None if told is None else float(told)
    raise _wrong("watchdog_s", told, "a number above 0, or None")


def _is_number(told: Any) -> bool:
    return isinstance(told, (int, float, np.number)) and not isinstance(told, bool)


def _advice(driver: Driver) -> tuple[str, ...]:
    """Return its advice; where there is none to be had is no reason to refuse a configuration."""
    try:
        told: Iterable[str] = driver.advice()
        return (told,) if isinstance(told, str) else tuple(map(str, told))
    except (Exception, SystemExit) as error:
        return (f"its advice failed: {type(error).__name__}: {error}",)
