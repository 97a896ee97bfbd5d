"""Candidates over what they settle in a second, and the motion that was chosen."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from motorctl.errors import UsageError
from motorctl.experiment.candidates import Candidate
from motorctl.experiment.outlook import Outlook
from motorctl.experiment.session import Experiment
from motorctl.identify.diagnose.report.motion_advice import Reach
from motorctl.picture_style import STYLE, colour, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHOWN = 12
"""Candidates in the picture, the most telling first; only looks depend on it."""
POINTS = 3000
"""Of the motion that is drawn; only looks depend on it."""
TITLE_WIDTH = 90
"""Letters of a line above the motion; only looks depend on it."""
LONGEST_WORDS = 66
"""Letters of a candidate's name in the picture; only looks depend on it."""


def draw_outlook(
    look: Outlook, chosen: Experiment, reaches: Mapping[str, Reach], path: Path
) -> Path:
    """Draw the candidates of one axis and the chosen motion into a PNG file and return it.

    Raises UsageError where it cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 7.2), layout="constrained")
        FigureCanvasAgg(figure)
        bars, motion = figure.subplots(2, 1, height_ratios=[1.7, 1.0])
        _draw_bars(bars, look)
        _draw_motion(motion, chosen.candidate, reaches)
        title = f"Axis {look.open.axis}: what each motion is expected to settle"
        figure.suptitle(title, x=0.01, ha="left")
        try:
            save(figure, path)
        except OSError as error:
            raise UsageError(f"{path}: cannot be written: {error.strerror}") from error
    return path


def _draw_bars(panel: Axes, look: Outlook) -> None:
    shown = look.prospects[:SHOWN]
    place = np.arange(len(shown))[::-1]
    left = np.zeros(len(shown))
    for k, question in enumerate(look.open.questions):
        if question.words in look.lost:
            continue
        part = np.array([each.shares[k] / each.duration_s for each in shown])
        panel.barh(place, part, left=left, height=0.7, color=colour(k), label=question.words)
        left += part
    words = [each.candidate.words for each in shown]
    cut = [w if len(w) <= LONGEST_WORDS else w[: LONGEST_WORDS - 1] + "…" for w in words]
    panel.set_yticks(
        place, [f"{w} ({p.duration_s:.1f} s)" for w, p in zip(cut, shown, strict=True)]
    )
    panel.tick_params(axis="y", labelsize=7)
    panel.set_xlabel("questions settled in a second of motion")
    panel.grid(axis="y", visible=False)
    if left.any():
        panel.legend(frameon=False, fontsize=8, loc="lower right")


def _draw_motion(panel: Axes, candidate: Candidate, reaches: Mapping[str, Reach]) -> None:
    for k, (axis, path) in enumerate(candidate.trajectories(reaches).items()):
        time_s = np.linspace(0.0, path.duration_s, POINTS)
        x = path.sample(time_s)[0]
        place = reaches[axis].units.place
        panel.plot(time_s, place.factor * (x - x[0]), color=colour(k), lw=1.0, label=f"axis {axis}")
    panel.set_xlabel("time [s]")
    units = ", ".join(dict.fromkeys(reach.units.place.unit for reach in reaches.values()))
    panel.set_ylabel(f"way from the start [{units}]")
    panel.set_title(textwrap.fill(candidate.words, TITLE_WIDTH), fontsize=8, loc="left")
    panel.legend(frameon=False, fontsize=8)
