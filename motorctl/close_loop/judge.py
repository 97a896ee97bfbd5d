"""Whether a changed configuration is better: no error may have become larger."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import astuple, dataclass, replace

from motorctl.axis_units import LINEAR, AxisUnits
from motorctl.close_loop.motion import MotionName
from motorctl.close_loop.trial import Trial, model_error_v
from motorctl.identify.compare.measures import SYMBOLS, Measures

MOTION_WORDS: Mapping[str, str] = {
    "own": "its own motion",
    "rich": "the rich motion",
    "telling": "telling motions",
    "unused": "a motion that was not used",
}
JUDGED = ("eF", "L2[e]")
"""Measures of which none may be worse; eM has its own allowance, uM is no error."""
SPLINE_GAIN = 0.1
"""Part of L2[e] that a spline without a name must take away. Chosen by hand."""
EM_ALLOWANCE = 0.02
"""The largest error of a run is that of one sample: noise alone changes it by so much,"""
EM_COUNTS = 1.0
"""or by so many counts of the encoder."""


@dataclass(frozen=True)
class AxisJudgement:
    """How one axis did with a changed configuration."""

    axis: str
    accepted: bool
    against: tuple[str, ...]
    """What became worse, in words."""
    tracking: Mapping[MotionName, tuple[Measures, Measures]]
    """Before and after on each motion."""
    model_error_v: tuple[float, float]
    """Before and after: what the start values leave of the command on the motion that no
    diagnosis has seen; rms."""
    units: AxisUnits = LINEAR


def judge(before: Trial, after: Trial, first: Trial) -> dict[str, AxisJudgement]:
    """Compare two trials axis by axis.

    An error counts as larger where runs of one configuration do not differ by as much. Model
    errors are those on the motion that no diagnosis has seen, as it was recorded at `first`:
    the same for every round, so that they can be compared from one to the next.
    """
    old, new = (
        model_error_v(trial.machine, first.recordings["unused"], first.machine)
        for trial in (before, after)
    )
    return {
        name: _judged(before, after, name, (old[name], new[name])) for name in before.machine.axes
    }


def without_gain(judgement: AxisJudgement, spline: str) -> AxisJudgement:
    """Turn a spline without a name down where it gains little: it costs time in every tick."""
    if not spline or not judgement.accepted or "unused" not in judgement.tracking:
        return judgement
    before, after = judgement.tracking["unused"]
    gain = 1.0 - after.L2_m / before.L2_m if before.L2_m > 0.0 else 0.0
    if gain >= SPLINE_GAIN:
        return judgement
    why = f"{spline} takes no more than {100.0 * max(gain, 0.0):.0f} % off L2[e]; at least "
    why += f"{100.0 * SPLINE_GAIN:.0f} % are required"
    return replace(judgement, accepted=False, against=(why,))


def _judged(
    before: Trial, after: Trial, axis: str, model_errors: tuple[float, float]
) -> AxisJudgement:
    tracking = {
        motion: (measures[axis], after.measures[motion][axis])
        for motion, measures in before.measures.items()
        if axis in measures and axis in after.measures.get(motion, {})
    }
    count_m = before.machine.axes[axis].encoder.resolution_m
    against = [f"tripped on {after.tripped}"] if after.tripped else []
    for motion, (first, second) in tracking.items():
        against += [
            f"{words} on {MOTION_WORDS[motion]}"
            for words in _worse(first, second, count_m, before.repeats_within)
        ]
    old, new = model_errors
    if new > old or (math.isnan(new) and not math.isnan(old)):
        against.append(f"model error {old:.4g} -> {new:.4g} V rms on {MOTION_WORDS['unused']}")
    units = before.machine.axes[axis].units
    told = tuple(map(units.words, against))
    return AxisJudgement(axis, not against, told, tracking, model_errors, units)


def _worse(
    before: Measures, after: Measures, count_m: float, repeats_within: float
) -> Iterator[str]:
    spare_m = count_m if repeats_within else 0.0
    pairs = dict(zip(SYMBOLS, zip(astuple(before), astuple(after), strict=True), strict=True))
    for name in JUDGED:
        first, second = pairs[name]
        if not second <= first + max(repeats_within * first, spare_m):
            yield f"{name} {1e6 * first:.4g} -> {1e6 * second:.4g} um"
    first, second = pairs["eM"]
    allowance = max(EM_ALLOWANCE, repeats_within)
    if not second <= first + max(allowance * first, EM_COUNTS * count_m):
        yield f"eM {1e6 * first:.4g} -> {1e6 * second:.4g} um"
