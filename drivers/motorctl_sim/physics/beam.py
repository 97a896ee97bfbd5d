"""A stiff beam between two carriages: it moves and turns with them, and they with each other.

With x1, x2 the carriages' places, L their distance and r a place on the beam from its middle
towards the first end, x(r) = (x1 + x2)/2 + (r/L)(x1 - x2). The kinetic energy of a beam of mass m
and rotary inertia J, and of a point load m_l at r, gives in (x1, x2)

    M = diag(m1, m2) + m/4 [1 1; 1 1] + J/L^2 [1 -1; -1 1] + m_l [w1 w1, w1 w2; w1 w2, w2 w2]

with w1 = 1/2 + r/L, w2 = 1/2 - r/L; skew pulls with k (x1 - x2) + c (v1 - v2) at the first end and
pushes so at the second. Angles are small.
"""

from __future__ import annotations

from typing import Any

from motorctl.hal import inner_kernel


@inner_kernel
def couple_ends(beam: Any, states: Any, h: float) -> None:
    """Change the ends' accelerations, found for each alone, to those with the beam between them."""
    first, second = states[beam.first], states[beam.second]
    skew = first.middle - second.middle
    rate = first.velocity - second.velocity
    rate += 0.5 * h * (first.acceleration - second.acceleration)
    pull = beam.stiffness * skew + beam.damping * rate
    force1 = first.inertia * first.next_acceleration - pull
    force2 = second.inertia * second.next_acceleration + pull
    m11, m22 = first.inertia + beam.m11, second.inertia + beam.m22
    determinant = m11 * m22 - beam.m12 * beam.m12
    first.next_acceleration = (m22 * force1 - beam.m12 * force2) / determinant
    second.next_acceleration = (m11 * force2 - beam.m12 * force1) / determinant
