"""What grew where a fit leaves more than before: a wave along the way, by logs before and after.

A log alone may not tell it: what the model always lacked can be larger, and a second wave of a kind
that the model has already is none that a diagnosis tries. Between two times of one machine under
one program all of that is the same, and what is left is the change.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from motorctl.errors import DataError, MotorctlError
from motorctl.fleet.changes import Alarm
from motorctl.fleet.findings import RESIDUAL
from motorctl.fleet.head import Declared
from motorctl.fleet.leftovers import PADDED, Leftovers
from motorctl.fleet.read_again import left_before_and_after
from motorctl.fleet.series import Seen
from motorctl.model import Effect, known_effects

Progress = Callable[[str, float], None]
"""Told what is being done, and the share of it that is, 0 to 1."""

LOGS = 3
"""Logs that are read before the change, and after it. More tells smaller changes and takes time,
fewer leaves more to chance. Chosen by hand: a day's, of three a day."""
ALONG_THE_WAY = frozenset({"wave_over_position", "wave_of_measurement"})
"""Groups of the effects that are tried."""
FEWEST_WAVES = 3.5
"""Waves over the way, at least. Fewer takes slow curves for waves, more misses long ones. Chosen by
hand, as for the waves that a diagnosis seeks."""
SLOW_PERCENTILE = 10.0
"""Of the speeds of rows that move: what at that speed is beyond the fit's band is not sought.
Larger looks for fewer short waves, smaller for ones of which hardly a row tells. Chosen by hand."""
MOST_PLACES = 1 << 20
"""Where the residual is sorted by place, at most: waves that are too short for it are not sought.
More takes memory, fewer leaves out short waves. Chosen by hand: waves of 8 um over a metre."""
PLACES_A_WAVE = 8
"""Places that a wave is told by at least, where the residual is sorted by place. More takes time,
fewer blurs short waves. Chosen by hand: of eight, the strongest is told to 97 %."""
STANDS_OUT = 15.0
"""Times the spectrum's median that a line must have grown by. Larger misses small changes, smaller
tries lines of chance, which do not explain what grew. Arithmetic: of a thousand lines of noise the
strongest is ten medians."""
LINES = 3
"""Lines that are tried. More takes time, fewer misses a change whose second order is its strongest.
Chosen by hand."""
PASSES, STEPS = 2, 9
"""Refinements of a line, and wave numbers tried in each. More takes time, fewer leaves the pitch
vague. Chosen by hand."""
BEYOND_CHANCE = 0.06
"""Share of all that the fit leaves which a wave must take away to be named. Larger misses small
changes, smaller takes chance for a wave. Chosen on simulated machines: in what three logs of four
seconds leave, without a wave, the best one takes away 3 %."""
AS_MUCH = 0.95
"""Share of what a wave takes away that one of half its pitch must take away to be named instead: a
wave of twice the pitch has the true one as its second order. Larger names twice the pitch where
noise helps it, smaller loses a weak first order. Chosen by hand."""
OTHER_SPEED = 1.3
"""Times the speed that three quarters of a wave stay below, over that which one quarter does, at
least: at one speed what follows time, as a load that rings after each ramp, looks like what follows
the way. Larger names less, smaller takes the one for the other. Arithmetic: what follows time has
another pitch by as much, and is out of step within one wave."""
MOST_ALARMS = 20
"""Whose logs are read. More takes time, fewer names less. Chosen by hand: minutes, at logs of
seconds."""
MOST_OF_IT = 0.5
"""Share of the growth that a wave must explain to be named. Larger keeps silent of waves that are
no plain ones, smaller names what is the lesser part. Convention: the greater part."""


@dataclass(frozen=True)
class Grown:
    """A wave along the way that was not there before, or smaller."""

    name: str
    """Of the effect."""
    pitch: float
    """What it repeats after, in the position's unit."""
    position_unit: str
    explained: float
    """The share of what the fit leaves more that it explains."""
    before_rms: float
    """What it adds to the command in the fitted band, in the command's unit."""
    after_rms: float
    command_unit: str

    def to_dict(self) -> dict[str, Any]:
        """Return it as it stands in ``fleet changes --json``."""
        return {**asdict(self), "sentence": self.sentence}

    @property
    def sentence(self) -> str:
        """Say what grew."""
        unit = self.command_unit
        return (
            f"{self.name} that repeats every {self.pitch:.4g} {self.position_unit}: "
            f"{self.after_rms:.2g} {unit} rms in the fitted band, {self.before_rms:.2g} {unit} "
            f"before; it explains {100.0 * self.explained:.0f} % of what the fit leaves more"
        )


def what_grew(
    before: Sequence[Seen], after: Sequence[Seen], axis: str, declared: Declared | None = None
) -> Grown | None:
    """Hold what a fit leaves in windows of logs after a change to what it left before.

    Parameters
    ----------
    before, after
        Windows of one axis of one machine, under one program.
    axis
        Its name.
    declared
        Which model is meant; None: what each log declares.

    Returns
    -------
    Grown or None
        None where what is left did not grow, or no wave along the way explains most of it.

    Raises
    ------
    DataError
        Where a side has no log that can be read, the logs declare different models or programs,
        the axis moved otherwise, or what grew shows at one speed alone.
    """
    earlier, later = left_before_and_after(before, after, axis, declared or Declared())
    growth = later.mean_square - earlier.mean_square
    if growth <= 0.0:
        return None
    classes = [cls for cls in known_effects().values() if cls.groups & ALONG_THE_WAY]
    best: tuple[float, type[Effect], float] | None = None
    for line in _grown_lines(earlier, later):
        cls = max(classes, key=lambda each: later.gain(each, line))
        gain, refined = _refined(later, cls, line)
        if best is None or gain > best[0]:
            best = gain, cls, refined
    if best is None or best[0] < BEYOND_CHANCE * later.mean_square:
        return None
    gain, cls, line = best
    was = earlier.gain(cls, line)
    explained = (gain - was) / growth
    if explained < MOST_OF_IT:
        return None
    if not _at_every_speed(later, cls, line):
        return None
    data = later.data
    return Grown(
        name=cls.name,
        pitch=1.0 / line,
        position_unit=data.position_unit,
        explained=min(explained, 1.0),
        before_rms=math.sqrt(was),
        after_rms=math.sqrt(gain),
        command_unit=data.command_unit,
    )


def named(alarm: Alarm) -> Grown | str | None:
    """Return what grew where an alarm is of what the fit leaves, or why that is not told.

    None of alarms that have a parameter's name.
    """
    if alarm.series.name != RESIDUAL:
        return None
    if alarm.change.after.value <= alarm.change.before.value:
        return "the model tells more than before"
    try:
        found = what_grew(*alarm.around(LOGS), alarm.series.axis)
    except MotorctlError as error:
        return f"not named: {error}"
    return found or f"no wave along the way explains it; look at it: motorctl diagnose {alarm.log}"


def names_of(alarms: Sequence[Alarm], progress: Progress) -> dict[int, Grown | str]:
    """Return what `named` tells of alarms, by their place; of the first `MOST_ALARMS` it asks."""
    found: dict[int, Grown | str] = {}
    asked = [k for k, alarm in enumerate(alarms) if alarm.series.name == RESIDUAL]
    for number, k in enumerate(asked):
        if number >= MOST_ALARMS:
            found[k] = (
                f"not named: its logs were not read, only those of the first {MOST_ALARMS} "
                "changes of what the fit leaves"
            )
            continue
        series = alarms[k].series
        share = number / min(len(asked), MOST_ALARMS)
        progress(f"reading logs of {series.machine} {series.axis} before and after", share)
        name = named(alarms[k])
        if name is not None:
            found[k] = name
    return found


def _grown_lines(earlier: Leftovers, later: Leftovers) -> list[float]:
    """Return the wave numbers [1/m] of what grew most along the way."""
    way = later.way
    if way <= 0.0 or not later.moving.any():
        return []
    slow = float(np.percentile(later.speed[later.moving], SLOW_PERCENTILE))
    most = min(later.band_hz / slow, MOST_PLACES / (PLACES_A_WAVE * way))
    places = math.ceil(PLACES_A_WAVE * most * way)
    step = way / places
    origin = float(np.min(later.position))
    # what was there before has the same phase: it goes
    now, then = (each.spectrum(origin, step, places) for each in (later, earlier))
    grown = np.abs(now - then) ** 2
    lines = np.arange(len(grown)) / (PADDED * places * step)
    inside = (lines >= FEWEST_WAVES / way) & (lines <= most)
    if not inside.any():
        return []
    floor = STANDS_OUT * float(np.median(grown[inside]))
    found: list[float] = []
    for k in np.argsort(-np.where(inside, grown, -np.inf)):
        if grown[k] < floor or len(found) == LINES or not inside[k]:
            break
        if all(abs(lines[k] - line) > 1.0 / way for line in found):
            found.append(float(lines[k]))
    return found


def _refined(later: Leftovers, cls: type[Effect], line: float) -> tuple[float, float]:
    """Return what a wave near a line takes away at best, and its wave number."""
    best = _nearest(later, cls, line)
    while later.gain(cls, 2.0 * best[1]) > AS_MUCH * best[0]:
        best = _nearest(later, cls, 2.0 * best[1])
    return best


def _nearest(later: Leftovers, cls: type[Effect], line: float) -> tuple[float, float]:
    reach = 0.5 / later.way
    best = later.gain(cls, line), line
    for _ in range(PASSES):
        tried = best[1] + reach * np.linspace(-1.0, 1.0, STEPS)
        best = max(best, *((later.gain(cls, float(k)), float(k)) for k in tried if k > 0.0))
        reach *= 2.0 / (STEPS - 1)
    return best


def _at_every_speed(later: Leftovers, cls: type[Effect], line: float) -> bool:
    """Return whether one wave explains as much where the axis is slow as where it is fast.

    Slow and fast rows have half of what the wave should explain each. Raises DataError where they
    have one speed.
    """
    explained = later.explained(cls, line)[later.moving]
    order = np.argsort(later.speed[later.moving])
    speed, wave = later.speed[later.moving][order], explained[order]
    left = later.left[later.moving][order]
    power = np.cumsum(wave**2)
    slow, middle, fast = np.searchsorted(power, np.array([0.25, 0.5, 0.75]) * power[-1])
    if speed[fast] < OTHER_SPEED * speed[slow]:
        raise DataError(
            f"one speed: a wave grew, which shows at {speed[slow]:.3g} to {speed[fast]:.3g} "
            f"{later.data.position_unit}/s alone; what follows the way and what follows time, as a "
            "load that rings after each ramp, look alike there"
        )
    # what is no wave of this pitch is not made smaller by it
    taken = 2.0 * wave * left - wave**2
    halves = (slice(None, middle), slice(middle, None))
    return all(np.sum(taken[half]) >= MOST_OF_IT * np.sum(wave[half] ** 2) for half in halves)
