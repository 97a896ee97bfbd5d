"""A bench for tests of compensation: the clean gantry with effects, and a law that knows them.

Machines of one list of effects share one compiled tick, so here is one list with every effect, on
both axes; estimates of nothing are as good as an effect that is not declared.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from loop_bench import Rig, gantry

from motorctl.config import load_resolved
from motorctl.config.machine import Machine
from motorctl.hal import Inputs
from motorctl.model import effect_class, make_effect
from motorctl_sim import SimDriver

NAMES = (
    "inertia",
    "viscous_friction",
    "coulomb_friction",
    "offset",
    "em_quadratic",
    "em_cubic",
)
TRUTH = {
    "x": (0.197, 0.2265, 0.139, 0.012, -0.0122, -0.00104),
    "y": (0.670, 0.296, 0.182, 0.004, -0.0168, -0.00058),
}
"""The axes of the clean gantry."""

EVERY: dict[str, dict[str, Any]] = {
    "cogging": {"pitch_m": 0.05, "orders": [1, 2]},
    "force_ripple": {"pitch_m": 0.06},
    "stribeck": {"velocity_m_s": 0.01},
    "asymmetric_friction": {},
    "presliding": {"displacement_m": 20e-6},
    "position_dependent_friction": {"center_m": 0.05, "degree": 2},
    "position_force": {"center_m": 0.05, "degree": 3},
    "quadratic_drag": {},
    "dead_zone": {"half_width_v": 0.1},
    "gain_drift": {"time_constant_s": 1.0},
    "payload_change": {"time_s": 1.1},
    "cross_axis": {},
    "flexible_mode": {"frequency_hz": 45.0, "damping_ratio": 0.02},
    "periodic_disturbance": {"frequency_hz": 23.0},
    "input_lag": {"time_s": 1e-12},
    "input_delay": {"time_s": 0.1e-3},
    "encoder_error": {"period_m": 17e-6, "sin_m": 0.3e-6},
}
"""What the law declares, unless a test gives other times. A declared delay lets the model act on
time, so that what an effect leaves can be seen."""
FEW = {name: EVERY[name] for name in ("cogging", "dead_zone", "input_delay", "encoder_error")}
"""One effect of the motion, one of the command, and what every plant has: soon compiled."""
PLANT: dict[str, Any] = {
    "input_delay": {"time_s": 0.1e-3},
    "encoder_error": {"amplitude_m": 0.3e-6, "period_m": 17e-6},
}
"""What every plant has, besides the effect that a test puts in."""
NOTHING = 1e-9
SETTLING_S = 0.6
"""Left out after the start: there the law takes over an axis that something pulls at."""


class WatchedSim(SimDriver):
    """Keeps where the carriages truly were at every tick."""

    def open(self) -> None:
        super().open()
        self.true_positions_m: list[np.ndarray] = []

    def read(self, inputs: Inputs) -> None:
        self.true_positions_m.append(self.true_state().position_m)
        super().read(inputs)


def machine(
    plant: Mapping[str, Any],
    estimates: Mapping[str, Mapping[str, float]],
    options: Mapping[str, Mapping[str, Any]] | None = None,
    known: Mapping[str, Mapping[str, Any]] = EVERY,
) -> Machine:
    """Return the gantry with more in the plant of axis x, and a law that knows every effect.

    estimates gives the parameters of x that are not zero; options takes the place of what is known.
    """
    data = copy.deepcopy(dict(gantry().resolved))
    data["drivers"] = {
        "gantry": {
            "type": "compensation_bench:WatchedSim",
            "preset": "published_gantry_clean",
            "plants": {"0": {**PLANT, **plant}, "1": PLANT},
        }
    }
    for name, axis in data["axes"].items():
        model = axis["model"]
        for effect, value in zip(NAMES, TRUTH[name], strict=True):
            model[effect]["initial"] = value
        for effect, given in (dict(known) | dict(options or {})).items():
            own = {"axes": ["y" if name == "x" else "x"]} if effect == "cross_axis" else given
            values = estimates.get(effect, {}) if name == "x" else {}
            model[effect] = {**own, **_estimates(effect, own, values)}
        # What is measured here is compensation alone.
        axis["adaptation"]["enabled"] = False
        axis["gains"]["velocity"] = "matched"
    data["programs"] = {
        "published_x": _to_and_fro("x", 0.1, 0.6, 10.0),
        "published_y": _to_and_fro("y", 0.05, 0.3, 8.0),
    }
    return load_resolved(data, hardware=True)


def _to_and_fro(axis: str, distance_m: float, velocity: float, acceleration: float) -> Any:
    return {
        "kind": "back_and_forth",
        "axis": axis,
        "start_m": 0.0,
        "distance_m": distance_m,
        "max_velocity_m_s": velocity,
        "max_acceleration_m_s2": acceleration,
        "jerk_time_s": 0.004,
        "period_s": 0.7,
        "cycles": 1,
    }


def _estimates(name: str, options: Any, values: Mapping[str, float]) -> dict[str, Any]:
    parameters = {}
    for parameter in make_effect(effect_class(name), options).parameters:
        value = values.get(parameter.name, 0.0)
        reach = 0.02 * abs(value) or NOTHING
        low = max(value - reach, parameter.lower)
        high = min(value + reach, parameter.upper)
        parameters[parameter.name] = {"initial": value, "bounds": [low, high]}
    if not parameters or "" in parameters:
        return parameters.get("", {})
    return {"parameters": parameters}


@dataclass(frozen=True)
class Tracking:
    """How axis x followed its program."""

    error_m: np.ndarray
    """True position less reference, (N,)."""
    rows: np.ndarray

    @property
    def rms_um(self) -> float:
        return 1e6 * float(np.sqrt(np.mean(self.error_m**2)))

    @property
    def largest_step_v(self) -> float:
        """Largest change of the command from one tick to the next."""
        return float(np.abs(np.diff(self.rows["command_v"])).max())


def track(chosen: Machine) -> Tracking:
    """Run the programs and give how axis x followed."""
    with Rig(chosen) as rig:
        rig.start()
        rig.seconds(SETTLING_S)
        settled = rig.ticks
        rig.seconds(rig.follow_programs(chosen.followed_programs) + 0.05)
        rig.raise_faults()
        true_m = np.array(rig.driver.true_positions_m)[:, 0]
        rows = rig.rows("x")
    return Tracking((true_m - rows["reference_m"])[settled:], rows[settled:])
