"""Forces that depend on position: cogging, springs, end effects, cable, end stops."""

from __future__ import annotations

import math
from typing import Any

from motorctl.hal import inner_kernel
from motorctl_sim.physics.plant_records import FROZEN
from motorctl_sim.physics.shapes import dahl, harmonics, profile

POSITION_FORCE = FROZEN["POSITION_FORCE"]
END_EFFECT = FROZEN["END_EFFECT"]
CABLE = FROZEN["CABLE"]


@inner_kernel
def position_force(plant: Any, state: Any, x: float, moved: float) -> float:
    """Return the force of position x [m] on the carriage [V]; `moved` [m] drives the cable."""
    terms = plant.terms
    force = 0.0
    if plant.cogging.count > 0:
        force += harmonics(plant.cogging, x)
    if terms & POSITION_FORCE:
        d = x - plant.force_center
        force -= plant.spring * d + plant.cubic_spring * d * d * d
        force += profile(plant.cogging_profile, x) + profile(plant.force_profile, x)
    if terms & END_EFFECT:
        length = plant.end_effect_length
        lower = math.exp(-(x - plant.lower_end) / length)
        upper = math.exp(-(plant.upper_end - x) / length)
        force += plant.end_effect_force * (lower - upper)
    if terms & CABLE:
        state.cable = dahl(state.cable, moved, plant.cable_length)
        force -= plant.cable_force * state.cable
    return force


@inner_kernel
def end_stop_force(plant: Any, x: float, v: float) -> float:
    """Return the force of the rubber end stops [V]; it pushes inwards or not at all."""
    if x > plant.upper_end:
        pushed = plant.end_stiffness * (x - plant.upper_end) + plant.end_damping * v
        return -max(float(pushed), 0.0)
    if x < plant.lower_end:
        pushed = plant.end_stiffness * (plant.lower_end - x) - plant.end_damping * v
        return max(float(pushed), 0.0)
    return 0.0
