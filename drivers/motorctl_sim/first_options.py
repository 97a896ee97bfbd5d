"""The simulated machine that a new configuration begins with, and what the simulation tells."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

from motorctl.hal import FirstAxis, FirstOptions, FoundAxis, FoundDevice
from motorctl_sim.options import Plant, SimOptions

PRESET = "published_gantry_clean"
"""What a model of inertia, friction and offset describes exactly: nothing that nobody has told."""
ROOM = 0.05
"""Travel between a soft limit and the end stop, as a part of the travel. More is as good."""
STIFFNESS_1_S2, DAMPING_1_S = 2e6, 750.0
"""Of the end stops, over the inertia: those of the published gantry."""
SWITCH_SHARE = 0.5
"""Where in that room the limit switches are."""
FORCE_NOISE = 1e-4
"""White noise of the force, as a part of the full command: that of the published gantry."""
CARRIAGES_SHARE, UNIFORM = 0.5, 1.0 / 12.0
"""Of what a beam with two motors moves: half is in its carriages, half uniform between them. By
hand."""
FREE_SHARE = 0.1
"""Part of the travel, from its middle, at which an axis that has to be homed is found."""


def first_options(axes: Sequence[FirstAxis]) -> FirstOptions:
    """Return a simulated machine of what is known, an axis a channel."""
    plants = {axis.channel: _plant(_carriage(axis)) for axis in axes}
    told: dict[tuple[str | int, ...], str] = {
        ("plants",): "as it was told to init, and nothing besides; docs/init.md adds an effect"
    }
    options = {"preset": PRESET, "seed": 1, "plants": plants}
    beams = [
        _beam(first, second)
        for first, second in pairwise(axes)
        if first.end_of is not None and first.end_of == second.end_of
    ]
    if beams:
        options["beams"] = beams
        told["beams",] = "half of the mass in the carriages, half uniform between them: a guess"
    return FirstOptions(options, told)


def _carriage(axis: FirstAxis) -> FirstAxis:
    """Return one end of a beam: over one motor's force, and without the beam."""
    if axis.end_of is None:
        return axis
    # Of two motors' force each has half: what they share is twice as much over one of them.
    return replace(axis, inertia_v_s2_m=_rounded(CARRIAGES_SHARE * axis.inertia_v_s2_m))


def _beam(first: FirstAxis, second: FirstAxis) -> dict[str, Any]:
    inertia = 2.0 * (1.0 - CARRIAGES_SHARE) * first.inertia_v_s2_m
    return {
        "channels": [first.channel, second.channel],
        "spacing_m": 1.0,  # counts for a load beside the middle alone
        "inertia_v_s2_m": _rounded(inertia),
        "rotary_inertia_v_s2_m": _rounded(UNIFORM * inertia),
    }


def _plant(axis: FirstAxis) -> dict[str, Any]:
    low, high = axis.travel_m
    room = ROOM * (high - low)
    inertia = axis.inertia_v_s2_m
    home = axis.home_position_m

    def place(value: float) -> float:
        return _rounded_to(value, room)

    plant: dict[str, Any] = {
        "inertia_v_s2_m": inertia,
        "viscous_friction_v_s_m": axis.viscous_friction_v_s_m,
        "coulomb_friction_v": axis.coulomb_friction_v,
        "offset_v": 0.0,
        "em_quadratic_1_v": 0.0,
        "em_cubic_1_v2": 0.0,
        "force_noise_rms_v": _rounded(FORCE_NOISE * axis.max_voltage_v),
        "travel_m": [place(low - room), place(high + room)],
        "limit_switches_m": [place(low - SWITCH_SHARE * room), place(high + SWITCH_SHARE * room)],
        "initial_position_m": place(0.5 * (low + high)),
        "end_stop": {
            "stiffness_v_m": _rounded(STIFFNESS_1_S2 * inertia),
            "damping_v_s_m": _rounded(DAMPING_1_S * inertia),
        },
        "amplifier": {"max_voltage_v": axis.max_voltage_v, "resolution_bits": 16},
        "home_switch": None,
        "encoder": {"absolute": axis.absolute, "index_marks_m": []},
    }
    if axis.friction_slope_s_m is not None:
        plant["friction_slope_s_m"] = axis.friction_slope_s_m
    if axis.homing.startswith("switch"):
        edge = home if axis.homing == "switch" else home - SWITCH_SHARE * FREE_SHARE * (high - low)
        plant["home_switch"] = {"to_m": place(edge)}
    if axis.homing.endswith("index"):
        plant["encoder"]["index_marks_m"] = [home]
    if axis.homing == "index":  # it is searched upwards, so from below the mark
        plant["initial_position_m"] = place(home - FREE_SHARE * (home - low))
    if axis.delay_s:
        plant["input_delay"] = {"time_s": axis.delay_s}
    return plant


def look(options: Mapping[str, Any]) -> FoundDevice:
    """Return the plants of a preset, and what differs from it."""
    sim = SimOptions.model_validate(dict(options))
    axes = tuple(_found(number, sim.plants[number]) for number in sorted(sim.plants))
    return FoundDevice(axes, dict(options))


def _found(number: int, plant: Plant) -> FoundAxis:
    low, high = plant.limit_switches_m or plant.travel_m
    inside = ROOM * (high - low)
    home, homing = None, "absolute"
    marks, switch = plant.encoder.index_marks_m, plant.home_switch
    if not plant.encoder.absolute:
        homing = "switch" if not marks else "switch_index" if switch else "index"
        if marks:
            home = marks[0]
        elif switch is not None:
            home = switch.to_m if switch.to_m is not None else switch.from_m
    travel_m = _rounded(low + inside), _rounded(high - inside)
    return FoundAxis(
        channel=number,
        inertia_v_s2_m=plant.inertia_v_s2_m,
        travel_m=travel_m,
        max_voltage_v=plant.amplifier.max_voltage_v,
        homing=homing,
        home_position_m=home,
        remarks=(f"end stops at {plant.travel_m[0]:g} and {plant.travel_m[1]:g} m",),
    )


def _rounded(value: float) -> float:
    """Return a number of four digits: nobody has told more."""
    return float(f"{value:.4g}")


def _rounded_to(place_m: float, room_m: float) -> float:
    """Return a place to a thousandth of the room around it: a short travel may lie far from 0."""
    return round(place_m, 3 - math.floor(math.log10(room_m)))
