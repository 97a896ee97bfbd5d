"""Pictures of runs: tracking error and command of each, one above the other, as PNG files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import UsageError
from motorctl.identify.compare.contour_picture import pairs_of, plot_contour
from motorctl.identify.compare.estimates_picture import plot_estimates
from motorctl.identify.compare.measures import table_cells, table_headings
from motorctl.identify.compare.runs import ComparedRun, Comparison
from motorctl.identify.compare.turnaround_picture import plot_turnaround
from motorctl.picture_style import colour, draw_curve, panels_in_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "plot_command",
    "plot_comparison",
    "plot_contour",
    "plot_estimates",
    "plot_tracking_error",
    "plot_turnaround",
]

Array = NDArray[np.float64]

MARGIN = 1.1
"""Height of the scale over the largest value. Only looks depend on it. Chosen by hand."""


def plot_comparison(comparison: Comparison, folder: Path) -> list[Path]:
    """Draw every picture of a comparison into `folder` and return the files.

    Raises UsageError where they cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return _pictures(comparison, folder)
    except OSError as error:
        raise UsageError(f"{folder}: pictures cannot be written: {error.strerror}") from error


def _pictures(comparison: Comparison, folder: Path) -> list[Path]:
    made = []
    for axis in comparison.axes:
        made.append(plot_tracking_error(comparison, axis, folder / f"tracking_error_{axis}.png"))
        made.append(plot_command(comparison, axis, folder / f"command_{axis}.png"))
        if any(run.recording.axes[axis].theta_hat for run in comparison.runs):
            made.append(plot_estimates(comparison, axis, folder / f"estimates_{axis}.png"))
    made += [
        plot_contour(comparison, pair, folder / f"contour_{pair[0]}_{pair[1]}.png")
        for pair in pairs_of(comparison)
    ]
    measured = {
        run.label: run.recording.turnaround_s
        for run in comparison.runs
        if run.timing.turnaround is not None and run.recording.turnaround_s is not None
    }
    if measured:
        made.append(plot_turnaround(measured, folder / "turnaround.png", _deadline_s(comparison)))
    return made


def _deadline_s(comparison: Comparison) -> float | None:
    """Return the loops' period, where all runs have the same."""
    periods = {run.recording.period_s for run in comparison.runs}
    return periods.pop() if len(periods) == 1 else None


def plot_tracking_error(comparison: Comparison, axis: str, path: Path) -> Path:
    """Draw the tracking errors one above the other, on the same scale."""
    worst = max(m.eM_m for m in comparison.measures(axis).values()) * 1e6
    headings = table_headings(*comparison.units(axis))
    unit = comparison.units(axis)[0]
    longest_s = max(float(_time(run, axis)[-1]) for run in comparison.runs)
    with panels_in_file(len(comparison.runs) + 1, path, height=1.9) as (figure, panels):
        for k, (panel, run) in enumerate(zip(panels[:-1], comparison.runs, strict=True)):
            error = run.recording.axes[axis].following_error
            assert error is not None
            time_s = _time(run, axis)
            draw_curve(panel, time_s, error[run.axes[axis].rows] * 1e6, colour(k))
            panel.set_ylim(*((-MARGIN * worst, MARGIN * worst) if worst > 0.0 else (-1.0, 1.0)))
            panel.set_ylabel(f"{run.label}\nerror [µ{unit}]")
            last = run.axes[axis].last_rows
            start = run.axes[axis].rows.start
            panel.axvspan(
                float(time_s[last.start - start]),
                float(time_s[last.stop - start - 1]),
                color="black",
                alpha=0.06,
                lw=0,
            )
            told = zip(headings[:3], table_cells(run.axes[axis].measures), strict=False)
            words = ",   ".join(_told(*pair) for pair in told)
            panel.set_title(words, loc="right", fontsize=8)
            panel.set_xlim(0.0, longest_s)
            panel.tick_params(labelbottom=False)
        _draw_references(panels[-1], comparison, axis)
        panels[-1].set_xlabel("time [s]   (shaded: where eF is taken)")
        figure.suptitle(f"Tracking error, axis {axis}", x=0.01, ha="left")
    return path


def _draw_references(panel: Axes, comparison: Comparison, axis: str) -> None:
    """Draw what each run was to follow; once, where it is the same."""
    unit = comparison.units(axis)[0]
    scale, shown = (1e3, "mm") if unit == "m" else (1.0, unit)
    drawn: list[Array] = []
    for k, run in enumerate(comparison.runs):
        reference = run.recording.axes[axis].reference
        assert reference is not None  # else nothing was measured
        taken = reference[run.axes[axis].rows]
        if not any(len(taken) == len(other) and np.array_equal(taken, other) for other in drawn):
            draw_curve(panel, _time(run, axis), taken * scale, "black" if k == 0 else colour(k))
            drawn.append(taken)
    panel.set_ylabel(f"reference [{shown}]")


def plot_command(comparison: Comparison, axis: str, path: Path) -> Path:
    """Draw the commands on the same scale, over the run and over its last period."""
    unit = comparison.units(axis)[1]
    most = max(m.uM_V for m in comparison.measures(axis).values())
    with panels_in_file(len(comparison.runs), path, height=1.9, columns=2) as (figure, panels):
        pairs = zip(panels[0::2], panels[1::2], strict=True)
        for k, ((whole, close), run) in enumerate(zip(pairs, comparison.runs, strict=True)):
            rows = run.axes[axis].rows
            command = run.recording.axes[axis].command[rows]
            time_s = _time(run, axis)
            draw_curve(whole, time_s, command, colour(k))
            end = run.axes[axis].last_rows.stop - rows.start
            length_s = run.axes[axis].period_s or time_s[-1] / 10
            begin = int(time_s[:end].searchsorted(time_s[end - 1] - length_s))
            draw_curve(close, time_s[begin:end], command[begin:end], colour(k))
            for panel in (whole, close):
                panel.set_ylim(*((-MARGIN * most, MARGIN * most) if most > 0.0 else (-1.0, 1.0)))
            whole.set_ylabel(f"{run.label}\ncommand [{unit}]")
            uM = run.axes[axis].measures.uM_V
            whole.set_title(f"uM = {uM:.2f} {unit}", loc="right", fontsize=8)
        panels[-2].set_xlabel("time [s]")
        panels[-1].set_xlabel("time [s], last period")
        figure.suptitle(f"Control input, axis {axis}", x=0.01, ha="left")
    return path


def _time(run: ComparedRun, axis: str) -> Array:
    """Return the times of an axis' run, from its beginning."""
    time_s = run.recording.time_s[run.axes[axis].rows]
    return time_s - float(time_s[0])


def _told(heading: str, value: str) -> str:
    name, _, unit = heading.partition(" ")
    return f"{name} = {value} {unit}"
