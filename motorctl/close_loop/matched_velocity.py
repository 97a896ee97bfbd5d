"""The step after the rounds: the published law's velocity matched, and its share told apart.

As published, the measured velocity is half a period older than the desired one it is set against.
Matching the two changes errors without any effect, so it is tried by itself: what the effects are
credited with must not contain it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from motorctl.close_loop.judge import AxisJudgement, judge
from motorctl.close_loop.motion import MotionName, Motions
from motorctl.close_loop.rigs import Rig
from motorctl.close_loop.trial import Progress, Trial, try_out
from motorctl.identify.refine.refinement import moved_text
from motorctl.identify.refine.yaml_text import YamlText


@dataclass(frozen=True)
class VelocityStep:
    """The last configuration, with `gains.velocity` matched where that makes nothing worse."""

    trial: Trial
    judgements: Mapping[str, AxisJudgement]
    """Of the axes whose velocity was as published: what matching it did to each."""
    kept: frozenset[str]
    """The axes on which it was kept."""


def match_velocity(
    before: Trial,
    first: Trial,
    folder: Path,
    names: tuple[MotionName, ...],
    motions: Motions,
    duration_s: float | None,
    rig: Rig,
    progress: Progress,
) -> VelocityStep | None:
    """Try a configuration with a matched velocity, then only on the axes that it does good.

    Parameters
    ----------
    before
        The configuration, tried out.
    first
        That from which everything started.
    folder
        Where the changed one and its logs go.
    names, motions, duration_s
        The motions that are run.
    rig
        Runs them.
    progress
        Told what is being done.

    Returns
    -------
    VelocityStep or None
        None where every axis has it, or the text cannot be changed in place.
    """
    published = {
        name for name, axis in before.machine.axes.items() if axis.gains.velocity == "published"
    }
    if not published or not _written(before, published, folder):
        return None
    trial = try_out(folder / before.config.name, folder, names, motions, duration_s, rig, progress)
    judged = {n: j for n, j in judge(before, trial, first).items() if n in published}
    good = frozenset(name for name, judgement in judged.items() if judgement.accepted)
    if good == published:
        return VelocityStep(trial, judged, good)
    if good and _written(before, good, folder):
        trial = try_out(
            folder / before.config.name, folder, names, motions, duration_s, rig, progress
        )
        if all(judgement.accepted for judgement in judge(before, trial, first).values()):
            return VelocityStep(trial, judged, good)
    return VelocityStep(before, judged, frozenset())


def _written(before: Trial, axes: Collection[str], folder: Path) -> bool:
    """Write the configuration with a matched velocity; return whether its text allows that."""
    config = folder / before.config.name
    text = YamlText(moved_text(before.machine, config))
    try:
        for name in axes:
            text.replace(("axes", name, "gains", "velocity"), "matched")
    except KeyError:
        return False
    folder.mkdir(exist_ok=True)
    config.write_text(text.applied(), encoding="utf-8", newline="")
    return True
