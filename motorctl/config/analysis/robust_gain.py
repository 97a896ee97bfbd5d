"""The sufficient condition on the robust gain, and the decay that it guarantees."""

from __future__ import annotations

import math
from dataclasses import dataclass

Range = tuple[float, float]


@dataclass(frozen=True)
class GainCondition:
    """What the guarantee of Chen, Yao, Wang 2013, eq. 24, asks of ks1, and what ks leaves."""

    required_ks1_v_s_m: float
    k2_v_s_m: float
    """ks - required_ks1; the condition holds where it is positive."""
    decay_1_s: float | None
    """lambda = min{2 k2 / theta1max, k1} of eq. 24; None where the condition fails."""

    @property
    def satisfied(self) -> bool:
        """Whether the guarantee holds. The loop may be stable all the same where it does not."""
        return self.k2_v_s_m > 0.0


def required_ks1(theta1: float, k1_1_s: float, friction_slope: Range) -> float:
    """Return theta1 k1 - G + G^2 / (2 theta1 k1), at the worse end of G's range.

    Our reconstruction: with this ks1 the error dynamics of eq. 16 have the lambda of eq. 24. Convex
    in G, so its maximum stands at an end.

    Parameters
    ----------
    theta1
        Inertia [V s^2/m], above 0.
    k1_1_s
        Gain k1 of the position error [1/s], above 0.
    friction_slope
        Least and largest G = theta2 + theta3 g [V s/m].

    Returns
    -------
    float
        ks1 [V s/m]; infinite where an end of G is.
    """
    stiffness = theta1 * k1_1_s
    return max(_at(stiffness, g) for g in friction_slope)


def gain_condition(
    theta1: Range, theta2: Range, theta3: Range, slope_s_m: float, k1_1_s: float, ks_v_s_m: float
) -> GainCondition:
    """Test ks over a box of inertia, viscous and Coulomb friction (a point: both ends equal).

    g ranges over 0 to 2 slope / pi. The condition is convex in theta1 as well, so both its ends are
    tested.

    Parameters
    ----------
    theta1
        Least and largest inertia [V s^2/m], above 0.
    theta2
        Least and largest viscous friction [V s/m].
    theta3
        Least and largest Coulomb friction [V].
    slope_s_m
        Slope of Sf at rest divided by 2/pi [s/m].
    k1_1_s
        Gain k1 of the position error [1/s].
    ks_v_s_m
        The robust gain ks that is tested [V s/m].

    Returns
    -------
    GainCondition
        The gain that is needed, what ks leaves of it, and the decay that follows.
    """
    steepest = 2.0 / math.pi * slope_s_m if theta3[1] > 0.0 else 0.0
    friction = (theta2[0], theta2[1] + (theta3[1] * steepest if steepest else 0.0))
    required = max(required_ks1(t, k1_1_s, friction) for t in theta1)
    k2 = ks_v_s_m - required
    decay = min(2.0 * k2 / theta1[1], k1_1_s) if k2 > 0.0 else None
    return GainCondition(required, k2, decay)


def _at(stiffness: float, g: float) -> float:
    if math.isinf(g):
        return math.inf
    return stiffness - g + g * g / (2.0 * stiffness)
