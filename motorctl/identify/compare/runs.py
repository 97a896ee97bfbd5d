"""Compare runs: the published measures of each, and how the first stands to the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, astuple, dataclass, fields, replace
from math import inf, isfinite, nan
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

from motorctl.errors import DataError, UsageError
from motorctl.identify.compare.measures import (
    EXPLAINED,
    SYMBOLS,
    MeasuredRun,
    Measures,
    Timing,
    measure_recording,
    measure_timing,
    measured_document,
    table_cells,
    table_headings,
)
from motorctl.json_values import finite
from motorctl.log import Recording
from motorctl.notebook import frame_of_rows, html_lines, html_table

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class ComparedRun:
    """One recording among those compared."""

    label: str
    recording: Recording
    axes: Mapping[str, MeasuredRun]
    timing: Timing


@dataclass(frozen=True)
class Comparison:
    """Runs side by side; the first is the one before."""

    runs: tuple[ComparedRun, ...]
    axes: tuple[str, ...]
    """Axes that every run has."""

    def measures(self, axis: str) -> dict[str, Measures]:
        """Return the measures of one axis by the labels of the runs."""
        return {run.label: run.axes[axis].measures for run in self.runs}

    def ratios(self, axis: str) -> list[dict[str, float]]:
        """Return the first run's measures over each later run's; above 1 the later is better."""
        first, *later = self.measures(axis).values()
        return [ratios(first, other) for other in later]

    def units(self, axis: str) -> tuple[str, str]:
        """Return the units of an axis' position and command."""
        record = self.runs[0].recording.axes[axis]
        return record.position_unit, record.command_unit

    def to_dict(self) -> dict[str, Any]:
        """Return the document of ``compare --json``, without its pictures."""
        return comparison_document(self)

    def to_pandas(self) -> pd.DataFrame:
        """Return a row for each axis and run: its measures, in m or rad and the command's unit.

        Raises UsageError where pandas is not installed.
        """
        rows = [
            {"axis": axis, "run": label, **asdict(measures)}
            for axis in self.axes
            for label, measures in self.measures(axis).items()
        ]
        return frame_of_rows(rows, ["axis", "run", *(field.name for field in fields(Measures))])

    def __repr__(self) -> str:
        labels = ", ".join(run.label for run in self.runs)
        return f"<Comparison of {labels}: axes {', '.join(self.axes)}>"

    def _repr_html_(self) -> str:
        parts = []
        for axis in self.axes:
            first, *later = self.measures(axis).items()
            rows = [(label, *table_cells(measures)) for label, measures in (first, *later)]
            rows += [
                (f"{first[0]} / {label}", *map(told_ratio, ratios(first[1], measures).values()))
                for label, measures in later
            ]
            headings = ("run", *table_headings(*self.units(axis)))
            parts.append(html_table(headings, rows, f"axis {axis}"))
        return "".join((*parts, html_lines((EXPLAINED,))))


def ratios(first: Measures, other: Measures) -> dict[str, float]:
    """Return the first's measures over the other's, by their symbols; NaN over zero."""
    pairs = zip(SYMBOLS, astuple(first), astuple(other), strict=True)
    return {name: value / against if against else nan for name, value, against in pairs}


def told_ratio(ratio: float) -> str:
    """Return a ratio as tables have it."""
    return f"{ratio:.2f}" if isfinite(ratio) else "–"


def compare(recordings: Sequence[Recording], period_s: float | None = None) -> Comparison:
    """Measure one or more recordings.

    Raises DataError where a recording has no reference, where the recordings have no axis in
    common, or where an axis has different units in two of them; UsageError where the period is no
    time.
    """
    if period_s is not None and not 0.0 < period_s < inf:
        raise UsageError(f"period {period_s:g} s (--period): should be a number of seconds above 0")
    runs = []
    for recording in recordings:
        measured = measure_recording(recording, period_s)
        if not measured:
            raise DataError(
                f"{recording.source}: no axis has a reference, so no tracking error can be computed"
            )
        label = _controller(recording, measured) or PurePath(recording.source).stem
        runs.append(ComparedRun(label, recording, measured, measure_timing(recording)))
    common = tuple(name for name in runs[0].axes if all(name in run.axes for run in runs))
    if not common:
        have = "; ".join(f"{run.recording.source}: {', '.join(run.axes)}" for run in runs)
        raise DataError(f"the recordings have no axis in common ({have})")
    comparison = Comparison(tuple(_told_apart(runs)), common)
    for axis in common:
        _require_same_units(comparison, axis)
    return comparison


def comparison_document(comparison: Comparison) -> dict[str, Any]:
    """Return the comparison as the JSON document of `compare --json`."""
    axes: dict[str, Any] = {}
    for axis in comparison.axes:
        position_unit, command_unit = comparison.units(axis)
        axes[axis] = {
            "position_unit": position_unit,
            "command_unit": command_unit,
            "runs": [
                {
                    "source": run.recording.source,
                    "label": run.label,
                    **measured_document(run.axes[axis], position_unit, command_unit),
                }
                for run in comparison.runs
            ],
            "ratios_first_over": [
                {name: finite(value) for name, value in ratio.items()}
                for ratio in comparison.ratios(axis)
            ],
        }
    return {
        "recordings": [
            {
                "source": run.recording.source,
                "label": run.label,
                "duration_s": run.recording.duration_s,
                "timing": asdict(run.timing),
                "notes": list(run.recording.notes),
            }
            for run in comparison.runs
        ],
        "axes": axes,
    }


def _controller(recording: Recording, measured: Mapping[str, MeasuredRun]) -> str | None:
    """Return the law that all axes ran on, where the log tells it."""
    try:
        axes = recording.metadata["config"]["axes"]
        laws = {str(axes[name]["controller"]) for name in measured}
    except (KeyError, TypeError):
        return None
    return laws.pop() if len(laws) == 1 else None


def _told_apart(runs: list[ComparedRun]) -> list[ComparedRun]:
    """Return a label of its own for every run: its law, else its file, its path, or a number."""
    sources = [run.recording.source for run in runs]
    choices = (
        [run.label for run in runs],
        [PurePath(source).stem for source in sources],
        [str(PurePath(source).with_suffix("")) for source in sources],
        [f"{k} {PurePath(source).stem}" for k, source in enumerate(sources, 1)],
    )
    labels = next(labels for labels in choices if len(set(labels)) == len(labels))
    return [replace(run, label=label) for run, label in zip(runs, labels, strict=True)]


def _require_same_units(comparison: Comparison, axis: str) -> None:
    wanted = comparison.units(axis)
    for run in comparison.runs:
        record = run.recording.axes[axis]
        if (record.position_unit, record.command_unit) != wanted:
            raise DataError(
                f"{run.recording.source}: axis {axis} is in {record.position_unit} and "
                f"{record.command_unit}, but in {wanted[0]} and {wanted[1]} in "
                f"{comparison.runs[0].recording.source}: they cannot be compared"
            )
