"""Mistakes that recordings come with: a stuck encoder, signs lost, a reference of another unit.

Each would be taken for physics otherwise, and named as an effect.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.identify.columns.frozen_position import check_encoder
from motorctl.identify.columns.measured import Measured
from motorctl.model import EffectList

Array = NDArray[np.float64]

OPPOSITE = -0.5
"""Correlation of the reference with the position, from which the two run against each other. Nearer
to -1 misses reversed references of poor controllers; nearer to 0 suspects columns that have nothing
to do with each other. Chosen by hand."""
ALIKE = 0.97
"""Correlation of the reference with the position, from which one is the other but for a factor.
Nearer to 1 misses wrong units of poor controllers; smaller takes an axis that does not follow for
one. Chosen by hand."""
ANOTHER_SCALE = 1.4
"""That factor, or one over it, from which it is no error of following. Larger misses wrong pitches,
smaller refuses soft axes: one that answers at 0.7 of what is asked is late, too, and less alike.
Chosen by hand."""
FACTORS = {
    1e3: "millimetres for metres",
    1e6: "micrometres for metres",
    180.0 / np.pi: "degrees for radians",
    2.0 * np.pi: "radians for turns",
    360.0: "degrees for turns",
    25.4: "millimetres for inches",
}
"""What a factor between two columns of the same thing comes from. Arithmetic."""
JUST_SO = 0.02
"""Relative distance up to which a factor is such a one. Larger names units for wrong pitches,
smaller misses them where the axis follows softly. Chosen by hand."""

WORDS = (16, 32)
"""Bits of the numbers whose sign may be lost. Smaller ones are left out, as a duty cycle of 0 and
255 is one that switches; larger ones no number here holds exactly. Arithmetic."""
FEWEST_VALUES = 20
"""Different values at both ends together. Larger misses small commands, smaller takes a switch that
is read back with noise for lost signs. Chosen by hand: a converter's noise has some."""
ON_GRID = 1e-3
"""Steps by which a value of whole numbers may be off. Larger takes any column for whole numbers,
smaller trips over what a unit's factor rounds. Chosen by hand."""


def check_columns(data: Measured, declared: EffectList | None = None) -> None:
    """Raise DataError where a column cannot be what it is said to be, with what to do.

    A command in proportion to the position is what drives an axis against a stiff spring, where the
    declared model has a force of the position.
    """
    check_encoder(data)
    check_signs(data)
    with np.errstate(all="ignore"):  # nothing is claimed of what is no number
        _check_reference(data)
        if declared is None or not has_spring(declared):
            _check_command(data)


def has_spring(declared: EffectList) -> bool:
    """Return whether a model has a force of the position: then a command may follow the place."""
    return any("force_of_position" in effect.groups for effect in declared.effects)


def check_signs(data: Measured) -> None:
    """Raise DataError where a command's negative values stand there as large positive ones.

    As of -1 read as 65535: whole numbers, many of them at both ends of their range, and nothing in
    the middle.
    """
    command = data.command[data.usable]
    if not command.min() >= 0.0:  # as of most, which need no sorting then
        return
    values = np.unique(command)
    low = values[values < 0.5 * values[-1]]
    if len(low) < 2 or len(values) < FEWEST_VALUES:
        return
    with np.errstate(all="ignore"):  # nothing is claimed of what is no number
        step = float(np.diff(low).min())
        step = float(low[-1] / np.round(low[-1] / step))
        counts = values / step
    if not np.isfinite(counts).all() or np.abs(counts - np.round(counts)).max() > ON_GRID:
        return
    for bits in WORDS:
        whole = 2.0**bits
        between = (counts > 0.25 * whole) & (counts <= 0.75 * whole)
        if 0.75 * whole < counts[-1] < whole and not between.any():
            unit = data.command_unit
            raise DataError(
                f"{data.place}: the command has values from {values[0]:.4g} to {values[-1]:.4g} "
                f"{unit}, {bits}-bit numbers at both ends of their range and none between, as "
                "where negative ones were read without a sign. Write the column with its signs: "
                f"take {whole * step:.9g} {unit} off what is above {0.5 * whole * step:.4g}"
            )


def _check_reference(data: Measured) -> None:
    if data.reference is None:
        return
    position, reference = data.position[data.usable], data.reference[data.usable]
    if not np.all(np.isfinite(reference)) or np.ptp(reference) == 0.0 or np.ptp(position) == 0.0:
        return
    likeness, factor = _likeness(reference, position)
    if likeness < OPPOSITE:
        raise DataError(
            f"{data.place}: the reference runs against the position (correlation {likeness:.2f}): "
            "the sign of one of the two is reversed; give it scale: -1 in the description"
        )
    if likeness > ALIKE and factor > 0.0 and not 1.0 / ANOTHER_SCALE < factor < ANOTHER_SCALE:
        raise DataError(
            f"{data.place}: the position is {factor:.4g} times the reference"
            f"{_unit_of(factor)}: the unit or the pitch of one of the two is wrong; give it its "
            f"unit, or a scale of {1.0 / factor:.4g} to the position or {factor:.4g} to the "
            "reference, in the description"
        )


def _check_command(data: Measured) -> None:
    """Find a command that is where the axis is, or is sent to, and not what drives it there."""
    position, command = data.position[data.usable], data.command[data.usable]
    if np.ptp(position) == 0.0 or np.ptp(command) == 0.0:
        return
    likeness, factor = _likeness(position, command)
    beside = abs(float(np.mean(command)) - factor * float(np.mean(position)))
    same = any(abs(factor / known - 1.0) < JUST_SO for known in (1.0, *FACTORS))
    if likeness > ALIKE and same and beside < JUST_SO * float(np.ptp(command)):
        raise DataError(
            f"{data.place}: the command is the position (correlation {likeness:.3f}, factor "
            f"{factor:.4g}), as one is that says where the axis is or is sent to, not what drives "
            "it there: then give the current, force, torque or voltage as its command, and this "
            "column as its reference. A stage that a stiff spring holds, such as a piezo, gives "
            "the same where it is driven slowly: then declare a force of the position in its "
            "model, and record motion that is quick enough to show more than the spring"
        )


def _likeness(column: Array, other: Array) -> tuple[float, float]:
    """Return the correlation of two columns, and by which factor the other one follows the first.

    Of columns within one, as the squares of what a broken file holds may overflow.
    """
    unit, other_unit = float(np.abs(column).max()), float(np.abs(other).max())
    column, other = column / unit, other / other_unit
    likeness = float(np.corrcoef(column, other)[0, 1])
    return likeness, likeness * float(np.std(other)) / float(np.std(column)) * other_unit / unit


def _unit_of(factor: float) -> str:
    """Return which units were taken for each other, in brackets, where a factor tells."""
    for known, words in FACTORS.items():
        if abs(factor / known - 1.0) < JUST_SO or abs(factor * known - 1.0) < JUST_SO:
            return f" (as of {words})"
    return ""
