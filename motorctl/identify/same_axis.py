"""Whether a recording can be of the axes that a configuration describes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from motorctl.config.machine import Axis, Machine
from motorctl.errors import DataError, UsageError
from motorctl.identify.columns.measured import Measured, measured
from motorctl.identify.columns.signals import BAND_PER_RATE, low_pass_response, make_signals
from motorctl.log import Recording

SAME_RESOLUTION = 0.01
"""Relative difference up to which two resolutions are the same. Larger overlooks another encoder,
smaller trips over rounding. Chosen by hand."""
BEYOND_TRAVEL = 0.05
"""Part of the travel by which a recorded position may lie outside the soft limits. Larger overlooks
another axis, smaller refuses overshoot and a moved zero. Chosen by hand."""
BEYOND_VOLTAGE = 0.05
"""Part of the voltage limit by which a recorded command may exceed it. Larger overlooks another
amplifier, smaller trips over noise. Chosen by hand."""
OFF_GRID = 0.1
"""Counts by which a step may miss a whole number of counts, and below which it is none. Larger
overlooks another encoder, smaller trips over files that round. Chosen by hand."""
OFF_GRID_SHARE = 0.5
"""Share of steps that miss a whole number of counts, from which the recording is of another
encoder. Larger overlooks it, smaller trips over files that round. Chosen by hand."""
FAR_BEYOND_BOUNDS = 4.0
"""Inertia over its upper bound, or the lower bound over it, from which it is that of another axis,
or in another unit. Larger overlooks these, smaller refuses a machine that carries another load.
Chosen by hand."""
ROUGH_BAND_HZ = 60.0
"""Band in which the inertia is told roughly [Hz]. Larger adds noise, smaller leaves little motion.
Chosen by hand."""
INERTIA_EXPLAINS = 0.5
"""Part of the squared acceleration that such a rough model must explain for its inertia to say
anything. Larger keeps silent about other axes, smaller accuses machines whose motion is little but
noise. Chosen by hand."""


def check_belongs(recording: Recording, machine: Machine, axes: Iterable[str]) -> None:
    """Raise DataError where the recording of an axis cannot be of the machine's.

    Axes that the machine lacks, or in other units than a configuration's, cannot be compared.
    """
    problems = []
    for name in axes:
        data = measured(recording, name)
        axis = _axis_of(machine, name)
        if axis is None or not _in_its_units(data, axis):
            continue
        found = against(data, axis) or inertia_against(data, axis)
        problems += [f"axis {name}: {words}" for words in found]
    _refuse(recording, f"{machine.source}, or not in its units", problems)


def declared_inertias(
    recording: Recording, machine: Machine | None, axes: Iterable[str]
) -> dict[str, tuple[float, float]]:
    """Return the bounds that a machine's configuration gives the inertia of some axes.

    Of axes that it describes, recorded in its units.
    """
    if machine is None:
        return {}
    found = {}
    for name in axes:
        axis, data = _axis_of(machine, name), measured(recording, name)
        place = None if axis is None else axis.model.index_of("acceleration")
        if axis is None or place is None or not _in_its_units(data, axis):
            continue
        bounds = axis.estimates[place]
        found[name] = bounds.lower, bounds.upper
    return found


def require_same_machine(recording: Recording, machine: Machine, axes: Iterable[str]) -> None:
    """Raise where a configuration cannot be refined from the recording, with all reasons.

    UsageError where an axis is in other units than a configuration, DataError for axes that the
    machine lacks, another encoder, positions beyond the travel, commands beyond the voltage.
    """
    problems = []
    for name in axes:
        if name not in machine.axes:
            known = ", ".join(machine.axes)
            problems.append(f"axis '{name}' is not in the configuration, which has: {known}")
            continue
        data = measured(recording, name)
        units = machine.axes[name].units
        if not _in_its_units(data, machine.axes[name]):
            raise UsageError(
                f"{data.place} is in {data.position_unit} and {data.command_unit}; axes.{name} is "
                f"{units.kind}, in {units.position} and V, so nothing of it can be refined from "
                "this recording"
            )
        problems += [f"axis {name}: {words}" for words in against(data, machine.axes[name])]
    _refuse(recording, str(machine.source), problems)


def _refuse(recording: Recording, whose: str, problems: list[str]) -> None:
    if problems:
        listed = "".join(f"\n  {problem}" for problem in problems)
        raise DataError(f"{recording.source} is not a recording of the machine in {whose}:{listed}")


def _in_its_units(data: Measured, axis: Axis) -> bool:
    return (data.position_unit, data.command_unit) == (axis.units.position, "V")


def _axis_of(machine: Machine, name: str) -> Axis | None:
    """Return the axis of that name, or the only one, from which the model is taken too."""
    if len(machine.axes) == 1:
        return next(iter(machine.axes.values()))
    return machine.axes.get(name)


def against(data: Measured, axis: Axis) -> list[str]:
    """Return what speaks against a recording: encoder, travel and voltage."""
    found = []
    resolution, count = axis.encoder.resolution_m, data.resolution
    if count is not None and abs(count - resolution) > SAME_RESOLUTION * resolution:
        found.append(
            f"one count of the recording is {count:g} m, encoder.resolution_m is {resolution:g}"
        )
    if not data.usable.any():
        return found
    position, command = data.position[data.usable], data.command[data.usable]
    corrected = any(effect.kind == "measurement" for effect in axis.model.effects)
    if not corrected and (share := _off_grid(position, resolution)) > OFF_GRID_SHARE:
        found.append(
            f"{100 * share:.0f} % of its steps are no whole number of counts (limit "
            f"{100 * OFF_GRID_SHARE:.0f} %), "
            f"encoder.resolution_m is {resolution:g}"
        )
    low, high = axis.limits.travel_m
    lowest, highest = float(np.min(position)), float(np.max(position))
    slack = BEYOND_TRAVEL * (high - low)
    if lowest < low - slack or highest > high + slack:
        found.append(
            f"its position ranges from {lowest:.4g} to {highest:.4g} m, limits.travel_m is "
            f"{low:g} to {high:g}"
        )
    largest, limit = float(np.max(np.abs(command))), axis.limits.max_voltage_v
    if largest > (1.0 + BEYOND_VOLTAGE) * limit:
        found.append(f"its commands reach {largest:.4g} V, limits.max_voltage_v is {limit:g}")
    return [axis.units.words(words) for words in found]


def inertia_against(data: Measured, axis: Axis) -> list[str]:
    """Return what the inertia says against a recording; nothing where it cannot be told."""
    place = axis.model.index_of("acceleration")
    if place is None:
        return []
    bounds, name = axis.estimates[place], axis.model.parameter_names[place]
    inertia = _rough_inertia(data)
    if inertia is None:
        return []
    if bounds.lower / FAR_BEYOND_BOUNDS < inertia < bounds.upper * FAR_BEYOND_BOUNDS:
        return []
    told = f"its inertia is about {inertia:.3g} V*s^2/m, model.{name}.bounds is "
    return [f"{axis.units.words(told)}{bounds.lower:g} to {bounds.upper:g}"]


def _off_grid(position: np.ndarray, resolution: float) -> float:
    """Return the share of steps between samples that are no whole number of counts."""
    counts = np.diff(position) / resolution
    counts = counts[np.abs(counts) > OFF_GRID]
    if len(counts) == 0:
        return 0.0
    return float(np.mean(np.abs(counts - np.round(counts)) > OFF_GRID))


def _rough_inertia(data: Measured) -> float | None:
    """Fit acceleration, velocity, direction and a constant to the command."""
    if not np.all(np.isfinite(data.position) & np.isfinite(data.command)):
        return None
    try:
        signals = make_signals(
            data, band_hz=min(ROUGH_BAND_HZ, BAND_PER_RATE * data.sample_rate_hz)
        )
    except DataError:
        return None
    signals = signals.with_response(low_pass_response(signals.band_hz))
    columns = [
        np.stack([s.command, s.v, np.sign(s.v), np.ones_like(s.v)]) for s in signals.stretches
    ]
    X = signals.filtered(columns)
    b = np.linalg.lstsq(X.T, signals.acceleration(), rcond=None)[0]
    left = signals.acceleration() - b @ X
    explained = 1.0 - float(left @ left) / max(float(np.sum(signals.acceleration() ** 2)), 1e-300)
    return 1.0 / float(b[0]) if b[0] > 0.0 and explained > INERTIA_EXPLAINS else None
