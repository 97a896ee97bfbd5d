"""How far a plant can go, and what it meets there."""

from __future__ import annotations

import math

from motorctl.hal import Way
from motorctl_sim.options import Plant


def way(plant: Plant) -> Way:
    """Return what is known of a plant's way.

    What the amplifier's full voltage brings in over the whole travel, an end stop takes up at most:
    stiffness d^2 / 2 = voltage travel, and it stands against the voltage besides.
    """
    low, high = plant.travel_m
    push_v = plant.force_constant_ratio * plant.amplifier.max_voltage_v + abs(plant.offset_v)
    stiffness = plant.end_stop.stiffness_v_m
    into_m = math.sqrt(2.0 * push_v * (high - low) / stiffness) + 2.0 * push_v / stiffness
    switch = plant.home_switch
    home_m = None
    if switch is not None:
        from_m, to_m = switch.from_m, switch.to_m
        home_m = (
            -math.inf if from_m is None else from_m,
            math.inf if to_m is None else to_m,
        )
    return Way(
        reach_m=(low - into_m, high + into_m),
        limit_switches_m=plant.limit_switches_m,
        home_switch_m=home_m,
        index_marks_m=plant.encoder.index_marks_m,
        absolute=plant.encoder.absolute,
    )
