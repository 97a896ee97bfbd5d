"""A command that says where an axis is sent to, or how fast: what drives it there is not recorded.

A loop that leaves no error at rest answers to a lasting set-point with just that, so such a column
is the position or the velocity, in its own unit, and what the loop takes to follow: no dry friction
is in it, and nothing beside zero. A loop without an integral stands off by friction and weight over
its stiffness: then next to all of the column has to be the place, with a factor of about one. A
spring of just one unit of force a unit of way that is slack at
the origin of the encoder is rare, and is declared where there is one. A friction of just one,
without any other, is what textbooks have: where the speed is followed, nothing is refused, and
nothing is claimed of the machine.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.identify.columns.signals import Signals
from motorctl.identify.columns.usual_mistakes import FACTORS, JUST_SO, has_spring
from motorctl.identify.diagnose.result import AxisDiagnosis
from motorctl.identify.diagnose.search.whole_model import TINY
from motorctl.model import EffectList

Array = NDArray[np.float64]

OF_SPEED = (60.0 / (2.0 * np.pi), 60.0, 6.0, 60e3)
"""What a speed's own units add to the factors between columns: rpm for rad/s, turns and degrees
a minute, mm/min for m/s. Arithmetic."""
FOLLOWS = 0.9
"""Part of the command that motion and place must explain together, squared. Larger misses loops
that something disturbs, smaller takes a chance likeness for one. Chosen by hand."""
MOST_OF_IT = 0.5
"""Rms of the place's or velocity's own part over the command's. Larger misses loops that follow
softly, smaller asks a factor of what hardly shows. Chosen by hand: more than all else."""
NOTHING_BESIDE = 0.03
"""Dry friction, or a constant, over the command's rms, up to which there is none. Larger accuses
motors whose friction is mostly viscous, smaller misses loops that are recorded roughly. Chosen by
hand: motors of the recordings of other hands have 0.06 and more."""
FOLLOWED_HZ = 10.0
"""Band in which it is asked [Hz]: any loop follows there, and slower than its own poles. Larger
asks what a loop adds of higher order, smaller leaves too little motion. Chosen by hand."""
NEARLY_ONE = 0.1
"""How far from one the place's factor may be where one does as well. Larger accuses springs that
are slack at the origin, smaller misses loops that follow one slow wave, or give way to a weight.
Chosen by hand: a real loop that was sent a single sine has 0.96, as acceleration is the place
there, but for its sign; legs and arms held by soft loops have 0.955 to 1.04."""
AS_WELL = 4.0
"""Squared error with a factor of just one, over that with a free one, up to which it does as well.
Larger accuses such springs, smaller misses loops that are recorded roughly. Chosen by hand."""
HARDLY = 1e-4
"""Part of the command's variance that a factor of just one may leave where a free one leaves next
to nothing. Larger accuses such springs, smaller misses loops whose acceleration drowns in noise.
Chosen by hand: that real loop leaves 4e-6, a noisy one 3e-5, a spring of 0.95 under two sines
7e-4."""
STIFF_LEFT = 0.005
"""Part of the command's variance that may be left where friction and a constant are in it, as of a
loop without an integral. Larger accuses springs that are held by friction, smaller misses soft
loops. Chosen by hand: legs and arms of others leave 1e-4 to 4e-3 of their set-points."""
STIFF_FRICTION = 0.25
"""Dry friction over the command's spread, up to which such a loop is stiff. Larger accuses springs
with friction, smaller misses soft loops. Chosen by hand: those have 0.02 to 0.15."""
ROUGHLY_ONE, ROUGHLY_LEFT = 0.2, 0.03
"""How far from one the place's factor may be, and part of the command's variance that may be left,
where it is told that the command looks like a set-point. Larger tells it of weights and springs,
smaller leaves soft loops untold. Chosen by hand: a dog's knees, sent to angles, have 1.09 to 1.16
and leave 0.003, a knee that follows 40 ms late 0.86 and 0.011."""
QUICK = 0.05
"""Part of the usual speed at which friction has turned over, for asking whether there is any.
Larger blends it with viscous friction, smaller asks the noise. Chosen by hand."""


@dataclass(frozen=True)
class _Part:
    """What may be followed: a column of `_motion`, beside others that must be small."""

    of: int
    beside: tuple[int, ...]
    factors: tuple[float, ...]

    def followed(self, b: Array, parts: Array) -> bool:
        """Return whether most of the command is this column, in a unit that there is."""
        known = any(abs(abs(b[self.of]) / k - 1.0) < JUST_SO for k in self.factors)
        small = all(parts[other] < NOTHING_BESIDE for other in self.beside)
        return bool(known and small and parts[self.of] > MOST_OF_IT)


_KNOWN = (1.0, *FACTORS, *(1.0 / factor for factor in FACTORS))
_PLACE = _Part(0, (), _KNOWN)
_SPEED = _Part(1, (0,), (*_KNOWN, *OF_SPEED))


def check_no_set_point(plain: Signals, declared: EffectList) -> str | None:
    """Find a command that is the position or velocity that the axis is sent to.

    Parameters
    ----------
    plain
        The signals in the band in which motion outweighs the encoder's noise.
    declared
        The declared model: one with a spring may follow its command.

    Returns
    -------
    str or None
        Why nothing can be told of the machine, where the command is as a velocity is that the axis
        was sent with; None where it is not.

    Raises
    ------
    DataError
        The command is the position that the axis is sent to.
    """
    rows, command, b, left = _as_followed(plain)
    size = float(np.std(command))
    if size == 0.0 or left > (1.0 - FOLLOWS) * size**2:
        return None
    parts = np.abs(b) * np.array([*(np.std(row) for row in rows[:-1]), 1.0]) / size
    exact = max(parts[-2], parts[-1]) <= NOTHING_BESIDE  # neither dry friction nor a constant
    told = (
        f"and what a loop takes to follow ({100.0 * (1.0 - left / size**2):.1f} % of it is told by "
        f"this{', without any dry friction or constant force' if exact else ''})"
    )
    if exact:
        followed = _PLACE.followed(b, parts) or _could_be_one(rows, command, b, parts, left)
    else:
        followed = _stands_off(b, parts, left / size**2)
    if followed and not has_spring(declared):
        raise DataError(
            f"{plain.data.place}: the command is {b[0]:.4g} times the position {told}: it is the "
            "position that the axis was sent to, not what drives it there. Give the current, "
            "force, torque or voltage as its command, and this column as its reference. Where a "
            "spring holds the axis, declare a force of the position in its model"
        )
    if exact and _SPEED.followed(b, parts):
        return (
            f"its command is {b[1]:.4g} times the velocity {told}, as one is that says how fast "
            "the axis shall go, not what drives it: then give the current, force, torque or "
            "voltage instead. A machine whose friction is just that would look the same"
        )
    return None


def like_a_set_point(axis: AxisDiagnosis, plain: Signals) -> str | None:
    """Return that a command looks like where the axis is sent to, unless more than that is named.

    Parameters
    ----------
    axis
        What was found.
    plain
        The signals in the band in which motion outweighs the encoder's noise.

    Returns
    -------
    str or None
        What it may be and what to do; None where it does not.
    """
    others = [e.name for e in axis.effects if "force_of_position" not in e.effect.groups]
    if others or has_spring(axis.declared):
        return None
    rows, command, b, left = _as_followed(plain)
    left /= max(float(np.var(command)), TINY)
    near = any(abs(b[0] / factor - 1.0) < ROUGHLY_ONE for factor in _KNOWN)
    mostly = float(np.std(b[0] * rows[0])) > MOST_OF_IT * float(np.std(command))
    if not (near and mostly and left < ROUGHLY_LEFT):
        return None
    return (
        f"the command is {b[0]:.4g} times the position and what a soft loop stands off, to "
        f"{100.0 * (1.0 - left):.1f} %: it may say where the axis was sent to. Then give the "
        "current, force, torque or voltage as its command, and this column as its reference; a "
        "spring or a weight would look the same"
    )


def _stands_off(b: Array, parts: Array, left: float) -> bool:
    """Return whether it is the set-point of a loop that stands off by friction and weight.

    `left` is the part of the command's variance that is left.
    """
    near = abs(b[0] - 1.0) < NEARLY_ONE and parts[0] > MOST_OF_IT
    return bool(near and left < STIFF_LEFT and parts[-2] < STIFF_FRICTION)


def _could_be_one(rows: Array, command: Array, b: Array, parts: Array, left: float) -> bool:
    """Return whether most of the command is the place, and a factor of just one fits as well.

    In a motion of one frequency the loop's own acceleration is a part of the place, and takes that
    part off its factor. `left` is the mean square that a free factor leaves.
    """
    if parts[0] <= MOST_OF_IT or abs(b[0] - 1.0) > NEARLY_ONE:
        return False
    rest, others = command - rows[0], rows[1:]
    held = rest - np.linalg.lstsq(others.T, rest, rcond=None)[0] @ others
    return bool(np.mean(held**2) <= max(AS_WELL * left, HARDLY * np.var(command)))


def _as_followed(plain: Signals) -> tuple[Array, Array, Array, float]:
    """Return `_motion` in the band in which any loop follows, and its fit to the command.

    That is the factors of the motion, and the mean square that they leave.
    """
    rows, command = _motion(plain.plain(min(FOLLOWED_HZ, plain.band_hz)))
    b: Array = np.linalg.lstsq(rows.T, command, rcond=None)[0].astype(np.float64)
    return rows, command, b, float(np.mean((command - b @ rows) ** 2))


def _motion(plain: Signals) -> tuple[Array, Array]:
    """Return what a loop of second order makes of motion, at the rows, and the command.

    That is place, velocity, acceleration and its change; and the direction and one, of which a loop
    knows nothing.
    """
    usual = QUICK * max(float(np.sqrt(np.mean(np.square(plain.picked(lambda s: s.v))))), 1e-300)
    columns = plain.filtered(
        [
            np.stack(
                [
                    s.x,
                    s.v,
                    change := np.gradient(s.v, plain.period_s),
                    np.gradient(change, plain.period_s),
                    np.tanh(s.v / usual),
                    np.ones_like(s.v),
                    s.command,
                ]
            )
            for s in plain.stretches
        ]
    )
    return columns[:-1], columns[-1]
