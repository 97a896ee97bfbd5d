"""A part of the moving mass that is not fixed to the carriage: on a spring, or in a clearance.

With r the part's offset from its place on the carriage, m its inertia and a the carriage's
acceleration: m (r'' + a) = -f(r, r'), and f acts on the carriage; the friction of a part on a guide
of its own does not, and holds the part where it can. Without clearance and friction
f = m (omega^2 r + 2 zeta omega r'), so the carriage feels -m a + m s^2/(s^2 + 2 zeta omega s +
omega^2) a.
"""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import NDArray

from motorctl.hal import inner_kernel


@inner_kernel
def sprung_force(part: Any, state: NDArray[Any], h: float) -> float:
    """Return the force on the carriage half a substep on.

    Parameters
    ----------
    part
        A record of SPRUNG.
    state
        (r, r'): offset from the carriage [m] and its rate [m/s].
    h
        Substep [s].

    Returns
    -------
    float
        Force [V].
    """
    r = state[0] + 0.5 * h * state[1]
    beyond = r - min(max(r, -part.half_gap), part.half_gap)
    if part.half_gap > 0.0 and beyond == 0.0:
        return 0.0
    pushed = part.stiffness * beyond + part.damping * state[1]
    if part.half_gap > 0.0 and pushed * beyond < 0.0:
        return 0.0  # a stop pushes, it never holds
    return float(part.inertia * pushed)


@inner_kernel
def advance_sprung(
    part: Any,
    state: NDArray[Any],
    force: float,
    acceleration: float,
    velocity: float,
    h: float,
) -> None:
    """Advance (r, r') by a substep, under the force that `sprung_force` gave.

    Acceleration and velocity are the carriage's, the latter at the substep's beginning.
    """
    rate = state[1] - h * (acceleration + force / part.inertia)
    if part.friction > 0.0:
        carriage = velocity + h * acceleration
        slides, most = carriage + rate, h * part.friction / part.inertia
        rate = -carriage if abs(slides) <= most else rate - math.copysign(most, slides)
    state[0] += 0.5 * h * (state[1] + rate)
    state[1] = rate
