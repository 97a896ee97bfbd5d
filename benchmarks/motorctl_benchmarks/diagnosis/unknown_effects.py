"""Effects outside the list at full strength: what is drawn for each, as the simulator's options."""

from __future__ import annotations

from motorctl_benchmarks.diagnosis.draw import Draw
from motorctl_benchmarks.diagnosis.known_effects import Drawer
from motorctl_benchmarks.diagnosis.plants import AxisPlant, Options


def _backlash(draw: Draw, _: AxisPlant) -> Options:
    """Draw 15 to 30 % of the mass in a clearance of 20 to 80 um."""
    return {
        "gap_m": draw.uniform(20e-6, 80e-6),
        "fraction": draw.uniform(0.15, 0.30),
        "contact_frequency_hz": draw.uniform(150.0, 300.0),
        "damping_ratio": draw.uniform(0.1, 0.3),
    }


def _friction_patch(draw: Draw, axis: AxisPlant) -> Options:
    """Draw a place of 40 to 100 mm that sticks below 0.1 to 0.3 m/s: half to all of Coulomb."""
    return {
        "force_v": draw.uniform(0.5, 1.0) * axis.coulomb,
        "position_m": axis.low_m + draw.uniform(0.3, 0.7) * axis.travel_m,
        "width_m": draw.uniform(0.04, 0.10),
        "velocity_m_s": draw.uniform(0.1, 0.3),
    }


def _friction_bump(draw: Draw, axis: AxisPlant) -> Options:
    """Draw a seal that rattles at a tenth to a half of full speed with 40 to 80 % of Coulomb."""
    speed = draw.uniform(0.1, 0.5) * axis.max_velocity_m_s
    return {
        "force_v": draw.uniform(0.4, 0.8) * axis.coulomb,
        "velocity_m_s": speed,
        "width_m_s": draw.uniform(0.15, 0.35) * speed,
    }


def _wandering_force(draw: Draw, _: AxisPlant) -> Options:
    """Draw 0.04 to 0.12 V rms that wander within 0.05 to 1 s."""
    return {"rms_v": draw.uniform(0.04, 0.12), "time_constant_s": draw.log_uniform(0.05, 1.0)}


def _cable_hysteresis(draw: Draw, _: AxisPlant) -> Options:
    """Draw a cable chain of 0.08 to 0.15 V that turns over 5 to 30 mm."""
    return {"force_v": draw.uniform(0.08, 0.15), "length_m": draw.uniform(0.005, 0.030)}


def _force_steps(draw: Draw, _: AxisPlant) -> Options:
    """Draw 3 to 6 pushes of 0.08 to 0.2 V, each of half a second to two, at any time."""
    return {
        "steps": [
            {
                "at_s": draw.uniform(1.0, 21.0),
                "duration_s": draw.uniform(0.5, 2.0),
                "force_v": draw.sign() * draw.uniform(0.08, 0.20),
            }
            for _ in range(draw.whole(3, 6))
        ]
    }


UNKNOWN: dict[str, Drawer] = {
    "backlash": _backlash,
    "friction_patch": _friction_patch,
    "friction_bump": _friction_bump,
    "wandering_force": _wandering_force,
    "cable_hysteresis": _cable_hysteresis,
    "force_steps": _force_steps,
}
"""By the simulator's names; cable_hysteresis is its cable alone, force_steps its faults."""
