"""A bench for tests of the law: lists of effects, filled records, a plant to close the loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from motorctl.config.axis_keys import Adaptation
from motorctl.control import fill_settings, fill_state, law_settings, law_state
from motorctl.kernels import kernels_cached, load_generated, source_digest
from motorctl.model import EffectList, effect_class, make_effect

with kernels_cached():
    from law_kernels.closed_loop import project_all, violating

__all__ = [
    "C1_NAMES",
    "C2_NAMES",
    "X_TRUTH",
    "Law",
    "effects",
    "multisine",
    "project_all",
    "violating",
]

C1_NAMES = ("inertia", "viscous_friction", "coulomb_friction", "offset")
C2_NAMES = (*C1_NAMES, "em_quadratic", "em_cubic")

# CONTROL figures of the published X axis (Chen, Yao, Wang 2013) and a plant that comes close.
X_LOWER = (0.05, 0.08, 0.05, -0.5, -0.015, -0.002)
X_UPPER = (0.35, 0.5, 0.4, 0.5, 0.0, 0.0)
X_START = (0.19, 0.25, 0.1, 0.0, -0.005, -0.0005)
X_COVARIANCE = (2.0, 50.0, 100.0, 500.0, 0.05, 0.005)
X_TRUTH = (0.197, 0.2265, 0.139, 0.012, -0.0122, -0.00104)

# The kernels of a list of effects are bound by name, so that numba can keep what it compiled.
RUN = """from numba import njit

import {effects}
from law_kernels.closed_loop import run_law


@njit(cache=True)
def run(settings, state, plants, reference, push, rows, theta, gamma):
    run_law(
        {effects}.state_columns, {effects}.input_columns, {effects}.feedforward,
        {effects}.input_map, {effects}.input_slope, {effects}.advance_context,
        {effects}.advance_inputs, settings, state, plants, reference, push, rows, theta, gamma,
    )
"""

PLANT = np.dtype(
    [
        ("inertia", "f8"),
        ("viscous", "f8"),
        ("coulomb", "f8"),
        ("offset", "f8"),
        ("quadratic", "f8"),
        ("cubic", "f8"),
        ("slope", "f8"),
        ("start_m", "f8"),
        ("start_m_s", "f8"),
        ("resolution_m", "f8"),
        ("substeps", "i8"),
    ]
)
ROW = np.dtype([(name, "f8") for name in ("x", "v", "y", "u", "virtual", "d0")] + [("flags", "i8")])


def effects(*names: str) -> EffectList:
    """Return a list of known effects with their default options."""
    return EffectList([make_effect(effect_class(name)) for name in names])


@dataclass
class Run:
    """What a run of the law gave."""

    rows: np.ndarray
    theta: np.ndarray
    gamma: np.ndarray


def fill_law(record: np.void, model: EffectList, settings: dict[str, Any]) -> None:
    """Fill the law's record; what the settings leave out is as the configuration has it."""
    lists = ("period_s", "lower", "upper", "covariance")
    named = {key: settings[key] for key in lists}
    given = Adaptation().flat() | {"velocity": "matched"} | settings
    own = settings.get("command_filter")
    fill_settings(record, model, **named, given=given, command_filter=own)


class Law:
    """The law over a list of effects, its records filled; the published X by default."""

    def __init__(self, model: EffectList, **settings: Any) -> None:
        n = len(model)
        given = {
            "period_s": 0.2e-3,
            "k1_1_s": 250.0,
            "ks_v_s_m": 95.0,
            "gamma_d": 500.0,
            "d_hat_max_v": 1.0,
            "max_voltage_v": 10.0,
            "velocity": "published",
            "lower": X_LOWER[:n],
            "upper": X_UPPER[:n],
            "covariance": X_COVARIANCE[:n],
            "forgetting_1_s": 1.1,
            "normalisation": 0.06,
            "filter_rad_s": 166.0,
            "theta": X_START[:n],
        } | settings
        theta = given.pop("theta")
        self.model = model
        self.period_s: float = given["period_s"]
        self.settings = np.zeros(1, law_settings(n))
        self.state = np.zeros(1, law_state(n))
        fill_law(self.settings[0], model, given)
        fill_state(self.state[0], theta, given["covariance"])

    def track(
        self,
        reference: np.ndarray,
        truth: Any = X_TRUTH,
        *,
        push: Any = 0.0,
        start: tuple[float, float] | None = None,
        resolution_m: float = 0.0,
        substeps: int = 4,
        slope: float = 900.0,
        estimates: bool = True,
        covariances: bool = False,
    ) -> Run:
        """Track reference (N, 3): position, velocity, acceleration, on a plant of theta `truth`."""
        n, length = len(self.model), len(reference)
        plants = np.zeros(1, PLANT)
        places = ("inertia", "viscous", "coulomb", "offset", "quadratic", "cubic")
        for name, value in zip(places, truth, strict=False):
            plants[name] = value
        plants["slope"], plants["substeps"], plants["resolution_m"] = slope, substeps, resolution_m
        plants["start_m"], plants["start_m_s"] = start or (reference[0, 0], reference[0, 1])
        rows = np.zeros(length, ROW)
        theta = np.zeros((length if estimates else 0, n))
        gamma = np.zeros((length if covariances else 0, n, n))
        source = RUN.format(effects=self.model.kernels.__name__)
        load_generated(f"law_bench_{source_digest(source)}", source).run(
            self.settings, self.state, plants, np.ascontiguousarray(reference),
            np.broadcast_to(np.asarray(push, float), (length,)).copy(), rows, theta, gamma,
        )  # fmt: skip
        return Run(rows, theta, gamma)


def multisine(
    duration_s: float, period_s: float = 0.2e-3, *, peak_m_s2: float = 40.0
) -> np.ndarray:
    """Return a reference (N, 3) that starts at rest and holds several frequencies."""
    t = np.arange(int(duration_s / period_s)) * period_s
    total = np.zeros((len(t), 3))
    for hz, share, phase in ((1.3, 0.15, 0.0), (2.9, 0.3, 1.0), (5.3, 0.3, 2.0), (8.7, 0.25, 0.5)):
        w = 2 * np.pi * hz
        angle = w * t + phase
        amplitude = share * peak_m_s2
        total[:, 0] += -amplitude / w**2 * np.sin(angle)
        total[:, 1] += -amplitude / w * np.cos(angle)
        total[:, 2] += amplitude * np.sin(angle)
    # Faded in over a second, so that it begins at rest: x -> x f with f a smooth step.
    s = np.minimum(t, 1.0)
    f, f1, f2 = (
        s**3 * (10 - 15 * s + 6 * s**2),
        30 * s**2 * (1 - s) ** 2,
        60 * s * (1 - s) * (1 - 2 * s),
    )
    x, v, a = total.T
    return np.column_stack([x * f, v * f + x * f1, a * f + 2 * v * f1 + x * f2])
