"""What physics asks of a whole model: friction that takes energy, and an inertia that can be.

Each effect may be sound by itself and the sum of all not: friction of which one part is positive
and the other negative may drive the axis at some speed, and an inertia may shrink until a lag of
the command does its work.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.diagnose.search.held_out_blocks import RIDGE, SMOOTHING, total_with
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.parameters import robust_covariance, values_of
from motorctl.identify.diagnose.search.smooth_functions import SmoothFunctions
from motorctl.model.knowledge import WAVE_OF_FORCE

Array = NDArray[np.float64]

SURELY = 3.0
"""Standard errors by which friction's power must be negative to be so. Larger lets models pass that
drive themselves, smaller refutes true ones by chance. Convention: three standard deviations."""
GIVES = 0.1
"""Energy that friction gives, over what passes between command and motion, from which a model is
not passive. Larger lets models pass that drive themselves a little, smaller refutes right names on
machines of little friction, whose command is a little late. Chosen by hand: a real drive on a
coupling has 0.03 with its own resonance."""
SPEEDS = (0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0)
"""Quantiles of the speed, of each direction, between which friction's power is told: at slow, usual
and fast travel. More parts are seldom passed, fewer hide a speed at which friction drives. Chosen
by hand."""
RESTS = 0.02
"""Speed over the top speed below which an axis rests, and its friction neither gives nor takes.
Larger overlooks slow travel, smaller counts noise. Chosen by hand."""
FAR_OFF = 2.0
"""Factor by which a model's inertia may be off what is known of it. Larger lets models pass in
which something else carries the mass, smaller refutes true ones where the estimate is poor.
Convention: twofold."""
TELLS = 0.5
"""Squared error that a delay leaves, of what is there without it, up to which it tells what is
inertia, and its time is told. Larger trusts delays that stand for something else, smaller refutes
true ones of axes that friction rules. Convention: half."""
OF_INERTIA = "V*s^2/m"
"""Unit of the parameters that are inertia: a convention of the model."""
TINY = 1e-300
"""Sum of squares of a column that is not there: keeps divisions whole. Any other would do that is
below every signal's and above zero. Convention."""
NUISANCES = ("position", "velocity")
"""Smooth functions beside which the independent estimate of the inertia stands."""


@dataclass(frozen=True)
class FrictionPower:
    """What the friction of a whole model does with energy."""

    given: float
    """Energy that it surely gives, over what passes from command to motion; 0 where none."""
    speed: float
    """Mean velocity where it gives most; its sign is the direction's."""


def friction_power(model: Hypothesis) -> FrictionPower:
    """Return what all the friction of a model does with energy along the recorded motion."""
    signals = model.regressors.signals
    frictions = [
        effect
        for kind in ("input", "state")
        for effect in model.of_kind(kind)
        if "friction" in effect.groups
    ]
    names = {effect.name for effect in frictions}
    own = [i for i, name in enumerate(model.names) if name in names]
    coefficients, covariance = _of_forces(model)
    if not own or coefficients is None:
        return FrictionPower(0.0, 0.0)
    step = signals.decimation
    columns, velocities = [], []
    for s, kept in zip(signals.stretches, signals.kept, strict=True):
        parts = [s.columns(effect, step=step) for effect in frictions]
        columns.append(np.concatenate(parts)[:, kept])
        velocities.append(s.v[::step][kept])
    psi, v = np.concatenate(columns, axis=1), np.concatenate(velocities)
    c, covariance = coefficients[own], covariance[np.ix_(own, own)]
    given, most, where = 0.0, 0.0, 0.0
    for rows in _by_speed(v):
        each = psi[:, rows] @ v[rows]
        power = float(c @ each)  # that the command has to spend on friction
        sure = -power - SURELY * math.sqrt(max(float(each @ covariance @ each), 0.0))
        given += max(sure, 0.0)
        if sure > most:
            most, where = sure, float(np.mean(v[rows]))
    passing = float(np.sum(np.abs(signals.picked(lambda s: s.command) * v)))
    return FrictionPower(given / max(passing, TINY), where)


def _of_forces(model: Hypothesis) -> tuple[Array | None, Array]:
    """Return what each column asks of the command, and its covariance.

    None where the acceleration stands on the left and inertia is not positive: no sign is told.
    """
    covariance = robust_covariance(model.problem, model.solution)
    if model.regressors.side == "command":
        return model.solution.b, covariance
    per_command = float(model.b[0])  # one over the inertia
    if not per_command > 0.0:
        return None, covariance
    return -model.solution.b / per_command, covariance / per_command**2


def _by_speed(v: Array) -> list[NDArray[np.bool_]]:
    """Return the rows of slow, usual and fast travel in each direction."""
    rests = RESTS * float(np.max(np.abs(v), initial=0.0))
    found = []
    for side in (1.0, -1.0):
        moving = side * v > rests
        if not moving.any():
            continue
        edges = np.quantile(side * v[moving], SPEEDS)
        for low, high in pairwise(edges):
            found.append(moving & (side * v >= low) & (side * v <= high))
    return found


@dataclass(frozen=True)
class InertiaRange:
    """Between what values the inertia is known to lie, in units of the command."""

    low: float
    high: float
    declared: bool
    """Whether the model says so, or an estimate that knows no effects."""

    @property
    def hides(self) -> bool:
        """Whether the motion does not show it: then no model of it can be simulated."""
        return self.low <= 0.0 and not self.declared


def known_inertias(base: Hypothesis) -> tuple[InertiaRange, ...]:
    """Return what is known of the inertia apart from any effect; `base` is the declared model."""
    declared, seen = base.regressors.signals.data.inertia, seen_inertia(base)
    known = () if declared is None else (InertiaRange(*declared, declared=True),)
    return known if seen is None else (*known, seen)


def seen_inertia(base: Hypothesis) -> InertiaRange | None:
    """Return what the motion says of the inertia beside any function of place and any of speed.

    Of the two regressions, of the acceleration on the command and of the command on the
    acceleration, one is too large and one too small by whatever else is in them: what they leave
    unexplained widens the range between them. None where the two have no common sign.

    Parameters
    ----------
    base
        The declared model alone, or as `beside_what_hides_it` returns it.
    """
    smooth = SmoothFunctions(base.regressors.signals)
    total = total_with(base.problem, smooth.columns_apart(NUISANCES, base.undone))
    lengths = np.sqrt(np.maximum(total.diagonal(), TINY))
    gram = total / np.outer(lengths, lengths)
    size = len(total) - 1
    two, others = np.array([0, size]), np.arange(1, size)
    ridge = np.full(size, SMOOTHING)
    ridge[: base.problem.size] = np.where(base.problem.soft, SMOOTHING, RIDGE)
    beside, cross = gram[np.ix_(others, others)], gram[np.ix_(others, two)]
    by = np.linalg.solve(beside + np.diag(ridge[1:]), cross)
    # Of what is left as it is: the ridge would leave a part of what the others explain.
    rest = gram[np.ix_(two, two)] - by.T @ cross - cross.T @ by + by.T @ beside @ by
    right, both, left = rest[0, 0], rest[0, 1], rest[1, 1]
    scale = float(lengths[0] / lengths[-1])
    if left <= 0.0:
        return None
    if both <= 0.0:
        return _hidden_inertia(base, right, both, left, scale)
    ends = [scale * float(right / both), scale * float(both / left)]
    if base.regressors.side == "command":  # the acceleration stands on the right there
        ends = [1.0 / end for end in ends]
    return InertiaRange(min(ends), max(ends), declared=False)


def _hidden_inertia(
    base: Hypothesis, right: float, both: float, left: float, scale: float
) -> InertiaRange | None:
    """Return that an inertia which does not show is no larger than chance hides of it.

    Parameters
    ----------
    base
        The declared model alone.
    right, both, left
        Products of what is left of acceleration and command beside any function of place and speed.
    scale
        Of these, from the command's to the acceleration's.

    Returns
    -------
    InertiaRange or None
        None where the acceleration stands on the left, whose noise hides any inertia, and where
        a force that is not known outweighs it.
    """
    if base.regressors.side != "command" or right <= 0.0:
        return None
    rows = base.regressors.signals.rows
    chance = math.sqrt(max(left - both**2 / right, 0.0) / right / rows)
    plain = base.solution.covariance[0, 0] * base.solution.sse / max(rows - base.problem.size, 1)
    robust = robust_covariance(base.problem, base.solution)[0, 0]
    most = both / right + SURELY * chance * math.sqrt(robust / max(plain, TINY))
    return InertiaRange(0.0, most / scale, declared=False) if most > 0.0 else None


def beside_what_hides_it(base: Hypothesis, model: Hypothesis) -> Hypothesis:
    """Return the declared model with what of another one would otherwise pass for its inertia.

    Waves over position are functions of place, too, but finer than any that is smooth. And a
    velocity that follows its command late may be one that inertia keeps: a delay that explains much
    of the command tells which of the two it is.
    """
    kept = [e for e in model.added if e.groups >= WAVE_OF_FORCE]
    late = [e for e in model.added if e.kind == "command" and e.delay_s > 0.0]
    kept += [e for e in late if left_with(model, e.name) < TELLS]
    return Hypothesis(base.regressors, (*base.added, *kept), base.acceleration)


def left_with(model: Hypothesis, name: str) -> float:
    """Return the squared error of held-out rows with an effect, over that without it."""
    return model.held_out / max(model.without(name).refreshed().held_out, TINY)


def inertia_of(model: Hypothesis) -> float:
    """Return a model's inertia in units of the command; infinite where none acted in motion."""
    per_command = float(model.b[0])
    return 1.0 / per_command if per_command else math.inf


def can_move(model: Hypothesis, known: Sequence[InertiaRange]) -> bool:
    """Return whether a model has an inertia with which its command can move it.

    One that is far heavier than what is known goes on as it goes, whatever acts on it: over a short
    window of a slow motion nothing comes nearer, and that says nothing of any force.
    """
    inertia = inertia_of(model)
    return 0.0 < inertia < math.inf and all(inertia <= FAR_OFF * by.high for by in known)


def inertia_off(model: Hypothesis, known: InertiaRange) -> float:
    """Return by what factor a model's inertia is outside what is known of it; 1 within.

    A part that hangs on a spring or behind a gap, or that is put on later, need not be seen all the
    time.
    """
    values = values_of(model)
    whole, apart, start = math.nan, 0.0, 0
    for effect in values.model.effects:
        own = values.theta[start : start + len(effect.parameters)]
        start += len(own)
        if effect.proportional_to == "acceleration":
            whole = float(own[0])
        elif "coupling" not in effect.groups:
            units = [parameter.unit for parameter in effect.parameters]
            apart += sum(abs(v) for v, unit in zip(own, units, strict=True) if unit == OF_INERTIA)
    if not whole > 0.0:
        return 1.0  # its sign is asked for itself
    return max(known.low / (whole + apart), (whole - apart) / known.high, 1.0)
