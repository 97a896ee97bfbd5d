"""Friction of the guideway: viscous, Coulomb and everything that changes Coulomb's level."""

from __future__ import annotations

import math
from typing import Any

from motorctl.hal import inner_kernel
from motorctl_sim.physics.plant_records import FROZEN
from motorctl_sim.physics.shapes import dahl, profile

DAHL = FROZEN["DAHL"]
LUGRE = FROZEN["LUGRE"]
STRIBECK = FROZEN["STRIBECK"]
POSITION_FRICTION = FROZEN["POSITION_FRICTION"]
FRICTION_PATCH = FROZEN["FRICTION_PATCH"]
FRICTION_BUMP = FROZEN["FRICTION_BUMP"]
LEVEL_CHANGES = STRIBECK | POSITION_FRICTION | FRICTION_PATCH | FRICTION_BUMP


@inner_kernel
def sliding_level(plant: Any, x: float, v: float) -> float:
    """Return the force of steady sliding without viscous friction [V]; never negative."""
    terms = plant.terms
    level: float = plant.coulomb
    if terms & LEVEL_CHANGES == 0:
        return level
    speed = abs(v)
    if terms & STRIBECK:
        ratio = (speed / plant.stribeck_velocity) ** plant.stribeck_exponent
        level += plant.stribeck_force * math.exp(-ratio)
    if terms & POSITION_FRICTION:
        d = x - plant.friction_center
        level += plant.friction_linear * d + plant.friction_quadratic * d * d
        level += profile(plant.friction_profile, x)
    if terms & FRICTION_PATCH:
        d = (x - plant.patch_position) / plant.patch_width
        w = v / plant.patch_velocity
        level += plant.patch_force * math.exp(-d * d - w * w)
    if terms & FRICTION_BUMP:
        d = (speed - plant.bump_velocity) / plant.bump_width
        level += plant.bump_force * math.exp(-d * d)
    return max(level, 0.0)


@inner_kernel
def friction(plant: Any, state: Any, x: float, v: float, moved: float) -> float:
    """Advance presliding by the motion `moved` [m]; return the force against motion [V].

    The direction s of the Coulomb part is (2/pi) arctan(slope v), or the presliding state:
    Dahl's dz/dt = v - |v| z/x_s, s = z/x_s; or LuGre (Canudas de Wit et al. 1995),
    dz/dt = v - sigma0 |v| z/g(v), force sigma0 z + sigma1 dz/dt with sigma0 = theta3/x_s and
    g(v) the sliding level, so that a Stribeck term enters g.

    Parameters
    ----------
    plant, state
        Records of PLANT and STATE.
    x, v
        Position [m] and velocity [m/s].
    moved
        Motion over the substep [m].

    Returns
    -------
    float
        Force [V].
    """
    level = sliding_level(plant, x, v)
    if plant.terms & DAHL:
        state.bristle = dahl(state.bristle, moved, plant.displacement)
        direction = state.bristle
        force = level * direction
    elif plant.terms & LUGRE:
        # the bristle yields at g/sigma0, that is level/theta3 displacements
        reach = max(level / plant.coulomb, 1e-9)
        direction = dahl(state.bristle / reach, moved, plant.displacement * reach)
        state.bristle = direction * reach
        rate = v - abs(v) * direction
        force = level * direction + plant.micro_damping * rate
    else:
        direction = 2.0 / math.pi * math.atan(plant.slope * v)
        force = level * direction
    force += plant.viscous * v + plant.drag * v * abs(v)
    force += plant.asymmetric_coulomb * abs(direction) + plant.asymmetric_viscous * abs(v)
    return float(force)
