"""Refuse plants that are too stiff for the step of the integration."""

from __future__ import annotations

import math
from collections.abc import Sequence

from motorctl_sim.options.beam import Beam
from motorctl_sim.options.plant import Plant

# Position Verlet is stable up to omega h = 2, the second-order Adams-Bashforth treatment of
# velocity up to lambda h = 1; both stay accurate to a few per cent below these limits.
MAX_OSCILLATION = 0.6
MAX_DECAY = 0.5


def check_stability(where: str, plant: Plant, substep_s: float) -> None:
    """Raise ValueError where a stiffness or a damping is too large for the step."""
    inertia = plant.carriage_inertia_v_s2_m
    if plant.payload_change:
        inertia = min(inertia, inertia + plant.payload_change.inertia_v_s2_m)
    for name, stiffness in _stiffnesses(plant).items():
        omega = math.sqrt(abs(stiffness) / inertia)
        if omega * substep_s > MAX_OSCILLATION:
            raise ValueError(
                f"{where}.{name} is too stiff: {omega:.0f} rad/s, where substep_s {substep_s:g} "
                f"allows {MAX_OSCILLATION / substep_s:.0f} rad/s"
            )
    for name, damping in _dampings(plant).items():
        rate = abs(damping) / inertia
        if rate * substep_s > MAX_DECAY:
            raise ValueError(
                f"{where}.{name} damps too fast: {rate:.0f} 1/s, where substep_s {substep_s:g} "
                f"allows {MAX_DECAY / substep_s:.0f} 1/s"
            )


def check_beam(where: str, beam: Beam, ends: Sequence[Plant], substep_s: float) -> None:
    """Raise ValueError where a beam is too stiff for the step, or its ends have loose parts."""
    for channel, plant in zip(beam.channels, ends, strict=True):
        for name in ("flexible_mode", "backlash"):
            if getattr(plant, name):
                raise ValueError(
                    f"plants.{channel}.{name} has no place on a beam: {where} moves its carriage"
                )
    # Without the beam's own masses, so on the safe side.
    inverse = sum(1.0 / plant.inertia_v_s2_m for plant in ends)
    omega, rate = math.sqrt(beam.stiffness_v_m * inverse), beam.damping_v_s_m * inverse
    if omega * substep_s > MAX_OSCILLATION:
        raise ValueError(
            f"{where}.stiffness_v_m is too stiff: {omega:.0f} rad/s, where substep_s {substep_s:g} "
            f"allows {MAX_OSCILLATION / substep_s:.0f} rad/s"
        )
    if rate * substep_s > MAX_DECAY:
        raise ValueError(
            f"{where}.damping_v_s_m damps too fast: {rate:.0f} 1/s, where substep_s {substep_s:g} "
            f"allows {MAX_DECAY / substep_s:.0f} 1/s"
        )


def _level(plant: Plant) -> float:
    extra = (plant.stribeck, plant.friction_bump, plant.friction_patch)
    return plant.coulomb_friction_v + sum(abs(part.force_v) for part in extra if part)


def _stiffnesses(plant: Plant) -> dict[str, float]:
    found = {"end_stop.stiffness_v_m": plant.end_stop.stiffness_v_m}
    if plant.presliding:
        found["presliding.displacement_m"] = _level(plant) / plant.presliding.displacement_m
    if plant.position_force:
        found["position_force.spring_v_m"] = plant.position_force.spring_v_m
    # a part on a spring, seen by the carriage: its own frequency, raised by the ratio of masses
    for name, part, frequency in (
        ("flexible_mode", plant.flexible_mode, "frequency_hz"),
        ("backlash", plant.backlash, "contact_frequency_hz"),
    ):
        if part:
            omega = 2.0 * math.pi * getattr(part, frequency)
            found[f"{name}.{frequency}"] = omega**2 * plant.inertia_v_s2_m
    return found


def _dampings(plant: Plant) -> dict[str, float]:
    found = {
        "end_stop.damping_v_s_m": plant.end_stop.damping_v_s_m,
        "viscous_friction_v_s_m": plant.viscous_friction_v_s_m,
    }
    if plant.presliding:
        found["presliding.micro_damping_v_s_m"] = plant.presliding.micro_damping_v_s_m
    else:
        slope = 2.0 / math.pi * plant.friction_slope_s_m
        found["friction_slope_s_m"] = _level(plant) * slope
    return found
