"""An identification in words: the JSON document, and tables for people."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console
from rich.table import Table

from motorctl.identify.fit.result import AxisFit, FitError, FitEstimate, RecordingFit
from motorctl.identify.fit.settings import Segment
from motorctl.json_values import finite
from motorctl.log.units import unit_for
from motorctl.notebook import frame_of_rows, html_lines, html_table

if TYPE_CHECKING:
    import pandas as pd

FAR_PERCENT = 1000.0
"""Difference from which the other estimate is told by its value, no longer as a percentage [%].
Only looks depend on it. Chosen by hand."""
_ESTIMATORS = {
    "least_squares": "least squares with the {} on the left",
    "instruments": "instruments built from the reference",
}


def fit_document(fit: RecordingFit) -> dict[str, Any]:
    """Return the document of ``fit --json``."""
    return {
        "source": fit.source,
        "sample_rate_hz": fit.sample_rate_hz,
        "duration_s": fit.duration_s,
        "notes": list(fit.notes),
        "axes": {name: _axis_document(axis) for name, axis in fit.axes.items()},
        "refused": dict(fit.refused),
    }


def print_fit(console: Console, fit: RecordingFit) -> None:
    """Print a table an axis: values, standard errors, instruments, error, delay, notes."""
    console.print(f"{fit.source}: {fit.duration_s:.6g} s at {fit.sample_rate_hz:g} Hz")
    for note in fit.notes:
        console.print(f"  note: {note}", markup=False)
    for name, axis in fit.axes.items():
        console.print(_table(name, axis))
        for line in _lines(axis):
            console.print(f"  {line}", markup=False, soft_wrap=True)
    for reason in fit.refused.values():
        console.print(f"not identified: {reason}", markup=False, soft_wrap=True)


def fit_html(fit: RecordingFit) -> str:
    """Return what `print_fit` prints as HTML."""
    heading = f"{fit.source}: {fit.duration_s:.6g} s at {fit.sample_rate_hz:g} Hz"
    parts = [html_lines((f"note: {note}" for note in fit.notes), heading)]
    for name, axis in fit.axes.items():
        parts += [html_table(*_parameter_rows(axis), f"axis {name}"), html_lines(_lines(axis))]
    parts.append(html_lines(f"not identified: {reason}" for reason in fit.refused.values()))
    return "".join(parts)


def fit_frame(fit: RecordingFit) -> pd.DataFrame:
    """Return a row a parameter; those of forces are NaN where no force constant is known."""
    rows = [
        {"axis": name, "parameter": parameter, **entry}
        | {f"force_{key}": value for key, value in (forces or {}).get(parameter, {}).items()}
        for name, axis in fit.axes.items()
        for forces in (force_values(axis),)
        for parameter, entry in parameter_values(axis).items()
    ]
    values = ("value", "std_error", "unit")
    return frame_of_rows(rows, ["axis", "parameter", *values, *(f"force_{key}" for key in values)])


def parameter_values(
    fit: AxisFit, estimate: FitEstimate | None = None
) -> dict[str, dict[str, Any]]:
    """Return value, standard error and unit of every parameter in units of the command."""
    taken = estimate or fit.estimate
    values = zip(fit.model.parameter_names, taken.theta, taken.std_error, _units(fit), strict=True)
    found = {
        name: {"value": float(value), "std_error": float(error), "unit": unit}
        for name, value, error, unit in values
    }
    for name, bound in taken.at_bound.items():
        found[name]["at_bound"] = bound
    return found


def force_values(fit: AxisFit) -> dict[str, dict[str, Any]] | None:
    """Return the parameters as forces on the load's side; None without a force constant.

    In newtons the force balance is written with every term on the load's side, F = M a + Fv v +
    Fc Sf(v) + offset, as the literature on identification has it: the offset in newtons is minus
    theta4 times the force constant.
    """
    gain = fit.data.force_per_command
    if gain is None:
        return None
    found: dict[str, dict[str, Any]] = {}
    signs = [effect.load_sign for effect in fit.model.effects for _ in effect.parameters]
    entries = zip(parameter_values(fit).items(), signs, _force_units(fit), strict=True)
    for (name, entry), sign, unit in entries:
        value = sign * gain * entry["value"]
        found[name] = {"value": value, "std_error": abs(gain) * entry["std_error"], "unit": unit}
        if sign < 0.0:
            found[name]["side"] = "load"
    return found


def _axis_document(fit: AxisFit) -> dict[str, Any]:
    document: dict[str, Any] = {"model": list(fit.model.names), "parameters": parameter_values(fit)}
    if (forces := force_values(fit)) is not None:
        document["parameters_force"] = forces
    held_out = fit.held_out
    document |= {
        "input_delay_s": _delay(fit.estimate),
        "error": {
            "unit": fit.data.command_unit,
            "rms": fit.error.rms,
            "relative": finite(fit.error.relative),
            "held_out_rms": None if held_out is None else held_out.rms,
            "held_out_relative": None if held_out is None else finite(held_out.relative),
            "held_out_source": None if held_out is None else held_out.source,
        },
        "estimator": fit.estimator,
        "least_squares": _estimate_document(fit, fit.least_squares),
        "instruments": _instruments_document(fit),
        "condition": fit.condition,
        "options": {key: _plain(value) for key, value in fit.options.model_dump().items()},
        "notes": list(fit.notes),
    }
    return document


def _delay(estimate: FitEstimate) -> dict[str, float]:
    return {"value": estimate.delay_s, "std_error": estimate.delay_std_error_s}


def _estimate_document(fit: AxisFit, estimate: FitEstimate) -> dict[str, Any]:
    return {"parameters": parameter_values(fit, estimate), "input_delay_s": _delay(estimate)}


def _instruments_document(fit: AxisFit) -> dict[str, Any] | None:
    """Compare with least squares, in percent of it."""
    if fit.instruments is None:
        return None
    document = _estimate_document(fit, fit.instruments)
    weak, differs = fit.weak(), fit.disagreement()
    for i, entry in enumerate(document["parameters"].values()):
        entry["difference_percent"] = _percent(entry["value"], float(fit.least_squares.theta[i]))
        entry["weak"] = bool(weak[i])
        entry["disagrees"] = bool(differs[i])
    return {"agree": not bool(differs.any())} | document


def _plain(value: object) -> object:
    """Make a value fit for JSON, which has no infinity."""
    return str(value) if isinstance(value, float) and math.isinf(value) else value


def _percent(value: float, reference: float) -> float | None:
    return 100.0 * (value / reference - 1.0) if reference else None


def _units(fit: AxisFit) -> list[str]:
    data = fit.data
    return [data.unit(p.unit) for p in fit.model.parameters]


def _force_units(fit: AxisFit) -> list[str]:
    """Multiply each unit by force per command."""
    units = []
    for effect in fit.model.effects:
        for parameter in effect.parameters:
            force, command = fit.data.force_unit, fit.data.command_unit
            if effect.kind == "state":
                unit = parameter.unit.replace("V", "#", 1)
                unit = unit_for(unit, fit.data.position_unit, command).replace("#", force)
            else:
                # 1/V becomes N/V^2, 1/V^2 becomes N/V^3
                power = parameter.unit.partition("/V^")[2]
                unit = f"{force}/{command}^{int(power or 1) + 1}"
            units.append(unit)
    return units


def _table(name: str, fit: AxisFit) -> Table:
    headings, rows = _parameter_rows(fit)
    table = Table(title=f"axis {name}", title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in headings:
        table.add_column(heading, overflow="fold")
    for cells in rows:
        table.add_row(*cells)
    return table


def _parameter_rows(fit: AxisFit) -> tuple[list[str], list[list[str]]]:
    """Return headings and rows of the parameters: values, as forces, by the other estimate."""
    forces = force_values(fit)
    other = fit.least_squares if fit.estimator == "instruments" else fit.instruments
    headings = ["parameter", "value ± std. error"]
    if forces is not None:
        headings.append("as a force")
    if other is not None:
        headings.append("least sq." if other is fit.least_squares else "instr.")
    rows = []
    for i, (parameter, entry) in enumerate(parameter_values(fit).items()):
        bound = f", {entry['at_bound']} bound" if "at_bound" in entry else ""
        cells = [parameter, _amount(entry) + bound]
        if forces is not None:
            cells.append(_amount(forces[parameter]))
        if other is not None:
            cells.append(_compared(fit, other, i))
        rows.append(cells)
    return headings, rows


def _compared(fit: AxisFit, other: FitEstimate, i: int) -> str:
    percent = _percent(float(other.theta[i]), float(fit.theta[i]))
    if percent is None or fit.weak()[i]:
        return "weak"
    told = f"{percent:+.2f} %" if abs(percent) < FAR_PERCENT else f"{other.theta[i]:.4g}"
    return told + (" !" if fit.disagreement()[i] else "")


def _amount(entry: dict[str, Any]) -> str:
    return f"{entry['value']:.6g} ± {entry['std_error']:.2g} {entry['unit']}"


def _lines(fit: AxisFit) -> list[str]:
    lines = [f"error: {_told(fit.error, fit)}"]
    if fit.held_out is not None:
        where = "" if fit.held_out.source == fit.data.source else f", on {fit.held_out.source}"
        lines.append(f"held out: {_told(fit.held_out, fit)}{where}")
    if fit.options.estimate_delay:
        lines.append(
            f"input delay: {1e3 * fit.delay_s:.4f} ms, std. error "
            f"{1e3 * fit.estimate.delay_std_error_s:.4f} ms (positive: the command acts later)"
        )
    elif fit.delay_s:
        lines.append(f"input delay: {1e3 * fit.delay_s:.4f} ms, as given")
    options = fit.options
    assert options.decimation is not None
    lines.append(
        f"{_ESTIMATORS[fit.estimator].format(options.left)}; {options.filter_kind} of order "
        f"{options.filter_order} at {options.filter_hz:.4g} Hz on the {options.filter_target}, "
        f"every {options.decimation}. sample: {len(fit.residual)} rows; "
        f"condition {fit.condition:.3g}"
    )
    if options.fit_segments:
        lines.append(f"fitted on {_spans(options.fit_segments)}")
    if options.held_out_segments:
        lines.append(f"held-out part: {_spans(options.held_out_segments)}")
    if options.rest_velocity:
        speed = f"{options.rest_velocity:.3g} {fit.data.position_unit}/s"
        lines.append(f"rows slower than {speed} are left out")
    lines += [f"note: {note}" for note in fit.notes]
    return lines


def _told(error: FitError, fit: AxisFit) -> str:
    return (
        f"{error.rms:.4g} {fit.data.command_unit} rms, {100 * error.relative:.4f} % of the "
        f"command, over {error.duration_s:.4g} s"
    )


def _spans(segments: tuple[Segment, ...]) -> str:
    return ", ".join(f"{begin:g} to {end:g} s" for begin, end in segments)
