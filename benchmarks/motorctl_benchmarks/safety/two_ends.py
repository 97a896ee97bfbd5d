"""A beam's numbers, from the simulated gantry's options and the axis' keys."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from motorctl_benchmarks.safety.setting import Beam, Plant
from motorctl_sim import SimOptions


def plant_of(options: SimOptions, channel: int) -> Plant:
    """Take a carriage's numbers from the simulated gantry's options."""
    plant = options.plant(channel)
    return Plant(
        plant.inertia_v_s2_m,
        plant.coulomb_friction_v,
        plant.viscous_friction_v_s_m,
        plant.offset_v,
        plant.em_quadratic_1_v,
        plant.em_cubic_1_v2,
    )


def beam_of(options: SimOptions, keys: Mapping[str, Any], end: int) -> Beam:
    """Take a beam's numbers, one of its ends the broken one.

    Parameters
    ----------
    options
        Of the simulated gantry, with one beam.
    keys
        The axis', as plain data.
    end
        Which one: 0 or 1.
    """
    (beam,) = options.beams
    dual, skew = keys["dual_drive"], keys["dual_drive"]["skew"]
    lever = beam.load.position_m / beam.spacing_m if beam.load else 0.0
    load = beam.load.inertia_v_s2_m if beam.load else 0.0
    shares = (0.5 + lever, 0.5 - lever)
    half, turn = beam.inertia_v_s2_m / 4.0, beam.rotary_inertia_v_s2_m
    masses = [
        options.plant(channel).inertia_v_s2_m + half + turn + load * share**2
        for channel, share in zip(beam.channels, shares, strict=True)
    ]
    other = 1 - end
    own_plant, other_plant = (options.plant(beam.channels[k]) for k in (end, other))
    switch = other_plant.home_switch
    edge_m = switch.to_m if switch and switch.to_m is not None else 0.0
    return Beam(
        own=masses[end],
        cross=half - turn + load * shares[0] * shares[1],
        other=masses[other],
        own_end=plant_of(options, beam.channels[end]),
        other_end=plant_of(options, beam.channels[other]),
        own_ratio=own_plant.force_constant_ratio,
        other_ratio=other_plant.force_constant_ratio,
        stiffness=beam.stiffness_v_m,
        damping=beam.damping_v_s_m,
        limit_m=keys["guards"]["skew"]["limit_m"],
        full_v=keys["limits"]["max_voltage_v"],
        skew_v=skew["max_voltage_v"],
        to_switch_m=other_plant.initial_position_m - edge_m,
        apart_m=dual["max_out_of_square_m"] + abs(dual["square_offset_m"]),
    )
