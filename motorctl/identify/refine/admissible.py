"""Make refined values such that the configuration accepts them, changing as little as possible.

A fit may say more than its recording showed: an input map that is sound over the commands that
were used may turn back before the voltage limit, and then it has no inverse (Chen, Yao, Wang
2013, Assumption 2). So the start values of the input map are drawn towards those that the
configuration had until it is monotonic up to the limit and the programs can be run, what was
fitted together with it follows, and bounds are narrowed until the projection can keep it so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motorctl.config.analysis import required_command, smallest_slope
from motorctl.config.machine import Axis, Estimate
from motorctl.control import input_indices, monotonicity_half_planes
from motorctl.errors import UsageError
from motorctl.identify.refine.start_values import moved, rounded
from motorctl.model import EffectList, Parameter
from motorctl.motion import AxisLimits, Program, check_program

Array = NDArray[np.float64]

CLEAR_OF_MARGIN = 1e-3
"""Room of the input map's slope dv/du above the margin at the start values [V/V]. Larger gives away
more of the estimates, smaller lets the rounding of what is written break the margin. Chosen by
hand: start values have six digits."""
CLEAR_SHARE = 1e-4
"""Part by which the largest sound share is reduced. Larger gives away more of the estimates,
smaller lets the rounding of what is written make them unsound again. Chosen by hand: start values
have six digits."""
STEPS = 20
"""Halvings of the interval in which the largest sound share is sought: 2^-20 is a millionth. Fewer
give away more of the estimates. Chosen by hand."""
HALVINGS = 12
"""Times that the bounds are narrowed around the start values, at most. Fewer may end before the
input map stays monotonic within them. Chosen by hand."""


def admissible(
    axis: Axis,
    model: EffectList,
    estimates: Sequence[Estimate],
    before: Sequence[Estimate | None],
    programs: Sequence[Program],
    made_up: Callable[[Array], Array] = np.asarray,
) -> tuple[list[Estimate], list[str]]:
    """Return estimates that the axis can start with, and in words what had to be changed.

    What the input map cannot mend, such as a program that needs too much voltage for its inertia,
    is left for the configuration to refuse.

    Parameters
    ----------
    axis
        Its limits and margins.
    model
        Its effects, with n parameters.
    estimates
        What was fitted, n of them.
    before
        What the configuration had, n of them; None: nothing.
    programs
        Those that it follows.
    made_up
        Given a change of the input map's parameters, (n,), returns that of all, (n,): the others
        may make up for it. By default they stay.
    """
    notes: list[str] = []
    found = list(estimates)
    indices = input_indices(model)
    if not indices:
        return found, notes
    limits = axis.limits
    u_max, travel = limits.max_voltage_v, limits.travel_m
    margin = axis.adaptation.monotonicity_margin + CLEAR_OF_MARGIN

    def monotonic(theta: Array) -> bool:
        return smallest_slope(model, theta, u_max, travel)[0] >= margin

    def can_run(theta: Array) -> bool:
        return monotonic(theta) and not _too_much_voltage(axis, model, theta, programs)

    for sound, why in (
        (monotonic, f"the fitted input map is not monotonic up to {u_max:g} V"),
        (can_run, f"a program would need more than {u_max:g} V"),
    ):
        theta = np.array([e.initial for e in found])
        if sound(theta):
            continue
        back = np.zeros_like(theta)
        back[indices] = [(e.initial if (e := before[i]) else 0.0) - theta[i] for i in indices]
        for change, made in ((made_up(back), ", and the others make up for it"), (back, "")):
            share = _largest_share(sound, theta, change)
            if share is None:
                continue
            drawn = (1.0 - share) * change
            found = [
                _drawn(e, p, float(drawn[i]), before[i] if i in indices else None)
                if i in indices or drawn[i]
                else e
                for i, (e, p) in enumerate(zip(found, model.parameters, strict=True))
            ]
            origin = "those of the configuration" if np.any((theta + back)[indices]) else "zero"
            notes.append(
                f"{why}: its parameters start at {100.0 * share:.0f} % of the way from {origin} to "
                f"their estimates{made}"
            )
            break
    for _ in range(HALVINGS):
        if _can_be_kept(model, found, u_max, axis.adaptation.monotonicity_margin, travel):
            break
        found = [_narrowed(e) if i in indices else e for i, e in enumerate(found)]
        words = "the bounds of the input map were narrowed so that it stays monotonic within them"
        notes += [] if words in notes else [words]
    return found, notes


def _largest_share(sound: Callable[[Array], bool], theta: Array, back: Array) -> float | None:
    """Find which part of the way is still sound; None where not even its beginning is.

    Parameters
    ----------
    sound
        Judges parameters, (n,).
    theta
        Where the way ends, (n,): not sound.
    back
        From there to its beginning, (n,).
    """

    def at(share: float) -> Array:
        return np.asarray(theta + (1.0 - share) * back)

    if not sound(at(0.0)):
        return None
    low, high = 0.0, 1.0
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if sound(at(middle)) else (low, middle)
    return low * (1.0 - CLEAR_SHARE)


def _too_much_voltage(
    axis: Axis, model: EffectList, theta: Array, programs: Sequence[Program]
) -> bool:
    limits = axis.limits
    needed = required_command(model, theta, limits.max_voltage_v)
    wide = AxisLimits((-np.inf, np.inf), np.inf, np.inf, np.inf, limits.max_voltage_v)
    return any(
        violation.quantity == "voltage"
        for program in programs
        for violation in check_program(
            program, dict.fromkeys(program.axes, wide), {axis.name: needed}
        )
    )


def _can_be_kept(
    model: EffectList,
    estimates: Sequence[Estimate],
    u_max: float,
    margin: float,
    travel: tuple[float, float],
) -> bool:
    lower = np.array([e.lower for e in estimates])
    upper = np.array([e.upper for e in estimates])
    theta = np.array([e.initial for e in estimates])
    try:
        normals, offsets = monotonicity_half_planes(model, lower, upper, u_max, margin, travel)
    except UsageError:
        return False
    return bool(np.all(normals @ theta >= offsets))


def _drawn(
    estimate: Estimate, parameter: Parameter, change: float, before: Estimate | None
) -> Estimate:
    """Return an estimate that was changed; its bounds go along, and hold what was before."""
    drawn = moved(estimate, parameter, change)
    if before is None:
        return drawn
    lower, upper = min(before.lower, drawn.initial), max(before.upper, drawn.initial)
    return replace(drawn, lower=lower, upper=upper)


def _narrowed(estimate: Estimate) -> Estimate:
    initial = estimate.initial
    lower = min(rounded(0.5 * (estimate.lower + initial)), initial)
    upper = max(rounded(0.5 * (estimate.upper + initial)), initial)
    return replace(estimate, lower=lower, upper=upper)
