"""The tables of a diagnosis, as cells: errors before and after, parameters, tracking errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from motorctl.identify.columns.measured import Measured
from motorctl.identify.compare.measures import Measures, table_cells
from motorctl.identify.compare.runs import ratios
from motorctl.identify.diagnose.report.parameter_text import (
    Value,
    as_force,
    declared_alone_values,
    force_values,
    option_document,
    percent,
    prefixed,
    pretty,
    whole_model_values,
)
from motorctl.identify.diagnose.result import AxisDiagnosis
from motorctl.model import Effect, wave_end
from motorctl.model.sign_function import SlopeOptions

NO_VALUE = "–"
SPLINES = ("knot_", "height_")
"""How the names of a spline's coefficients end, before their number."""
Rows = list[tuple[str, ...]]


@dataclass(frozen=True)
class TrackedAxis:
    """The tracking error of one axis on one trajectory, before and after a change of its model."""

    label: str
    """The trajectory."""
    axis: str
    measures_before: Measures
    measures_after: Measures
    position_unit: str = "m"
    command_unit: str = "V"


@dataclass(frozen=True)
class TrackingComparison:
    """Tracking errors before and after, by axis and trajectory."""

    rows: tuple[TrackedAxis, ...]
    before: str = "before"
    after: str = "after"


def stretch_rows(axis: AxisDiagnosis) -> tuple[tuple[str, ...], Rows]:
    """Return headings and rows of what was read of a long log; no rows where all of it was."""
    if axis.read is None:
        return (), []
    stretches = axis.read.stretches
    several = len({stretch.log for stretch in stretches}) > 1
    headings = ("from", "to", "rows", "read, as", "told least")
    rows: Rows = [
        (
            f"{stretch.begin_s:.1f} s",
            f"{stretch.end_s:.1f} s",
            str(stretch.rows),
            stretch.why,
            f"{stretch.vaguest}, to {100.0 * stretch.vagueness:.2g} % of the command"
            if math.isfinite(stretch.vagueness)
            else "nothing is told",
            *((Path(stretch.log).name,) if several else ()),
        )
        for stretch in stretches
    ]
    return (*headings, "log") if several else headings, rows


def error_rows(axis: AxisDiagnosis) -> tuple[tuple[str, ...], Rows]:
    """Return headings and rows of the errors of the declared model alone and of the whole model.

    No rows where nothing could be fitted.
    """
    error, data = axis.error, axis.data
    if not math.isfinite(error.held_out_before_rms):
        return (), []
    more = _more(axis)
    before, after = error.held_out_before_rms, error.held_out_after_rms
    three = (before, after, error.noise_floor_rms) if more else (before, error.noise_floor_rms)
    headings = ["held-out rows", "declared alone", *([_after(axis)] if more else []), "noise floor"]
    rows: Rows = [("error rms", *(_amount(value, error.unit) for value in three))]
    if data.force_per_command is not None:
        gain = abs(data.force_per_command)
        forces = (_amount(gain * value, data.force_unit) for value in three)
        rows.append(("error rms, as a force", *forces))
    if error.command_rms > 0.0:
        shares = (_amount(100.0 * value / error.command_rms, "%") for value in three)
        rows.append(("part of the command", *shares))
    simulated = [error.simulated_position_before_rms, error.simulated_position_after_rms]
    if any(value is not None for value in simulated):
        window = "" if error.window_s is None else f", windows of {error.window_s:g} s"
        told = [_position(value, data.position_unit) for value in simulated]
        rows.append(
            (f"simulated position{window}", *(told if more else told[:1]), NO_VALUE),
        )
    if more and math.isfinite(error.explained_fraction):
        share = percent(error.explained_fraction)
        rows.append(("part of the explainable error explained", NO_VALUE, share, NO_VALUE))
    return tuple(headings), rows


def parameter_rows(axis: AxisDiagnosis, *, forces: bool = True) -> tuple[tuple[str, ...], Rows]:
    """Return headings and rows of the parameters: declared alone, in the whole model, as forces.

    No rows where nothing could be fitted.
    """
    if len(axis.declared_theta) == 0:
        return (), []
    alone, together = declared_alone_values(axis), whole_model_values(axis)
    as_forces = force_values(axis) if forces else {}
    more = _more(axis)
    headings = ["parameter", "declared alone"]
    headings += [_after(axis)] if more else []
    headings += [f"as a force ({axis.data.force_unit})"] if as_forces else []
    rows: Rows = []
    everything = alone | together
    for name in everything:
        cells = [name, _told(alone.get(name))]
        cells += [_told(together.get(name))] if more else []
        cells += [_told(as_forces.get(name))] if as_forces else []
        rows.append(tuple(cells))
    return tuple(headings), _splines_in_one(rows, everything)


def effect_rows(data: Measured, effect: Effect, values: Mapping[str, Value]) -> Rows:
    """Return name, value and, where that is known, force of what was found of an effect.

    Amplitude and phase stand for sine and cosine, and one line for all coefficients of a spline.
    Options that are no numbers, such as the side of a stop, come last where they say what is new.
    """
    shown = {
        name: value
        for name, value in values.items()
        if (end := wave_end(name)) is None or f"amplitude{end}" not in values
    }
    rows: Rows = []
    for name, value in shown.items():
        force = as_force(data, effect, value)
        told = value.told()
        if name.startswith("phase"):
            name = name.removesuffix("_rad")  # noqa: PLW2901
            told = Value(math.degrees(value.value), math.degrees(value.std_error), "°").told()
        rows.append((name, told, "" if force is None else force.told()))
    usual = SlopeOptions().model_dump(mode="json").items()
    for name, option in option_document(effect).items():
        parts = option if isinstance(option, list) else ["yes" if option is True else option]
        known = all(f"amplitude_{part}" in values for part in parts) or (name, option) in usual
        if (option is True or isinstance(option, str | list)) and not known:
            rows.append((name, ", ".join(map(str, parts)), ""))
    return _splines_in_one(rows, shown)


def tracking_rows(comparison: TrackingComparison) -> list[list[list[str]]]:
    """Return a group of rows for every tracked axis: before, after and their ratio.

    A row is trajectory and axis, which only the first of a group names, the run, and its cells.
    """
    groups = []
    for row in comparison.rows:
        ratio = [_ratio(r) for r in ratios(row.measures_before, row.measures_after).values()]
        groups.append(
            [
                [row.label, row.axis, comparison.before, *table_cells(row.measures_before)],
                ["", "", comparison.after, *table_cells(row.measures_after)],
                ["", "", f"{comparison.before} / {comparison.after}", *ratio],
            ]
        )
    return groups


def _splines_in_one(rows: Rows, values: Mapping[str, Value]) -> Rows:
    """Put the coefficients of a spline, which tell nothing one by one, into one row."""
    found: dict[str, tuple[str, ...]] = {}
    for row in rows:
        stem = row[0].rstrip("0123456789")
        if not stem.endswith(SPLINES):
            found[row[0]] = row
        elif stem not in found:
            own = {name: value for name, value in values.items() if name.startswith(stem)}
            sizes = [value.value for value in own.values()]
            unit = pretty(next(iter(own.values())).unit)
            told = f"{len(own)} from {min(sizes):.3g} to {max(sizes):.3g} {unit}"
            # the declared model alone may have no spline
            at = 1 if row[1] != NO_VALUE else 2
            cells = [told if k == at else NO_VALUE for k in range(1, len(row))]
            last = next(reversed(own)).removeprefix(stem)
            found[stem] = (f"{row[0]}…{last}", *cells)
    return list(found.values())


def _more(axis: AxisDiagnosis) -> bool:
    """Return whether the whole model is more than the declared one."""
    return bool(axis.effects) or axis.model.names != axis.declared.names


def _after(axis: AxisDiagnosis) -> str:
    if len(axis.effects) == 1:
        return f"with {axis.effects[0].name}"
    return "with what was found" if axis.effects else "with the spline"


def _amount(value: float, unit: str) -> str:
    return f"{value:.3g} {pretty(unit)}" if math.isfinite(value) else NO_VALUE


def _position(value: float | None, unit: str) -> str:
    if value is None or not math.isfinite(value):
        return NO_VALUE
    scale, told = prefixed(value, unit)
    return f"{value / scale:.3g} {told}"


def _told(value: Value | None) -> str:
    return NO_VALUE if value is None else value.told()


def _ratio(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else NO_VALUE
