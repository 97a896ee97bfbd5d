"""Forms of every effect, and their formulas once more, in plain numpy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import BSpline

from motorctl.model import Effect, effect_class, make_effect

Array = np.ndarray


def form(name: str, **options: object) -> Effect:
    """Make an effect with options, as a configuration would."""
    return make_effect(effect_class(name), options)


def sf(v: Array, slope: float = 900.0) -> Array:
    return 2.0 / np.pi * np.arctan(slope * v)


def splines(x: Array, low: float, high: float, count: int) -> Array:
    """Return scipy's uniform cubic B-splines but the last, constant beyond the ends."""
    width = (high - low) / (count - 3)
    knots = low + width * np.arange(-3, count + 1)
    inside = np.clip(x, low, high)
    return np.array([BSpline(knots, np.eye(count)[j], 3)(inside) for j in range(count - 1)])


def waves(x: Array, pitch: float, orders: tuple[int, ...]) -> Array:
    angles = [2.0 * np.pi * k * x / pitch for k in orders]
    return np.array([wave(angle) for angle in angles for wave in (np.sin, np.cos)])


State = Callable[[Array, Array, Array, Array, Array], list[Array] | Array]
STATE: list[tuple[Effect, State]] = [
    (form("inertia"), lambda x, v, a, vs, t: [a]),
    (form("viscous_friction"), lambda x, v, a, vs, t: [v]),
    (form("coulomb_friction", slope_s_m=200.0), lambda x, v, a, vs, t: [sf(vs, 200.0)]),
    (form("offset"), lambda x, v, a, vs, t: [-np.ones_like(x)]),
    (form("cogging", pitch_m=0.03), lambda x, v, a, vs, t: -waves(x, 0.03, (1,))),
    (
        form("cogging", pitch_m=0.06, orders=(1, 2, 6)),
        lambda x, v, a, vs, t: -waves(x, 0.06, (1, 2, 6)),
    ),
    (
        form("stribeck", velocity_m_s=0.01),
        lambda x, v, a, vs, t: [np.exp(-((vs / 0.01) ** 2)) * sf(vs)],
    ),
    (
        form("stribeck", velocity_m_s=0.02, exponent=0.7, slope_s_m=5000.0),
        lambda x, v, a, vs, t: [np.exp(-((abs(vs) / 0.02) ** 0.7)) * sf(vs, 5000.0)],
    ),
    (form("asymmetric_friction"), lambda x, v, a, vs, t: [abs(sf(vs)), abs(v)]),
    (
        form("position_dependent_friction", center_m=0.1),
        lambda x, v, a, vs, t: [sf(vs) * (x - 0.1)],
    ),
    (
        form("position_dependent_friction", center_m=0.1, degree=2, slope_s_m=50.0),
        lambda x, v, a, vs, t: [sf(vs, 50.0) * (x - 0.1), sf(vs, 50.0) * (x - 0.1) ** 2],
    ),
    (
        form("position_dependent_friction", knots=(-0.2, 0.3, 8)),
        lambda x, v, a, vs, t: sf(vs) * splines(x, -0.2, 0.3, 8),
    ),
    (form("position_force", center_m=-0.1), lambda x, v, a, vs, t: [x + 0.1]),
    (
        form("position_force", center_m=-0.1, degree=3),
        lambda x, v, a, vs, t: [x + 0.1, (x + 0.1) ** 3],
    ),
    (
        form("position_force", knots=(-0.2, 0.3, 5)),
        lambda x, v, a, vs, t: splines(x, -0.2, 0.3, 5),
    ),
    (
        form("gravity", turn_m=0.8),
        lambda x, v, a, vs, t: [np.sin(2.5 * np.pi * x), np.cos(2.5 * np.pi * x)],
    ),
    (form("hard_stop", begin_m=0.1), lambda x, v, a, vs, t: [np.maximum(x - 0.1, 0.0)]),
    (
        form("hard_stop", begin_m=-0.1, side="lower"),
        lambda x, v, a, vs, t: [np.minimum(x + 0.1, 0.0)],
    ),
    (
        form("hard_stop", begin_m=-0.1, side="lower", damped=True),
        lambda x, v, a, vs, t: [np.minimum(x + 0.1, 0.0), abs(np.minimum(x + 0.1, 0.0)) * v],
    ),
    (
        form("hard_stop", begin_m=0.1, progressive=True, damped=True),
        lambda x, v, a, vs, t: [
            np.maximum(x - 0.1, 0.0),
            np.maximum(x - 0.1, 0.0) ** 2,
            np.maximum(x - 0.1, 0.0) * v,
        ],
    ),
    (
        form("warming_friction", time_constant_s=0.3, begin_s=0.2),
        lambda x, v, a, vs, t: [
            np.minimum(np.exp(-(t - 0.2) / 0.3), 1.0) * part for part in (sf(vs), v)
        ],
    ),
    (form("quadratic_drag"), lambda x, v, a, vs, t: [v * abs(v)]),
    (form("payload_change", time_s=0.5), lambda x, v, a, vs, t: [np.where(t >= 0.5, a, 0.0)]),
    (
        form("periodic_disturbance", frequency_hz=13.0),
        lambda x, v, a, vs, t: [-np.sin(26.0 * np.pi * t), -np.cos(26.0 * np.pi * t)],
    ),
]
"""State effects without a memory, with psi(x, v, a, vs, t)."""

Input = Callable[[Array, Array, Array, Array], list[Array] | Array]
INPUT: list[tuple[Effect, Input]] = [
    (form("em_quadratic"), lambda u, x, vs, t: [u * abs(u)]),
    (form("em_cubic"), lambda u, x, vs, t: [u**3]),
    (form("force_ripple", pitch_m=0.05), lambda u, x, vs, t: u * waves(x, 0.05, (1,))),
    (
        form("force_ripple", pitch_m=0.05, orders=(2, 3)),
        lambda u, x, vs, t: u * waves(x, 0.05, (2, 3)),
    ),
    (form("dead_zone", half_width_v=0.2), lambda u, x, vs, t: [-np.clip(u / 0.2, -1.0, 1.0)]),
    (
        form("gain_drift", time_constant_s=0.4, begin_s=0.3),
        lambda u, x, vs, t: [-u * np.where(t > 0.3, 1.0 - np.exp(-(t - 0.3) / 0.4), 0.0)],
    ),
    (
        form("load_friction", slope_s_m=300.0),
        lambda u, x, vs, t: [-abs(u) * sf(vs, 300.0)],
    ),
    (
        form("voltage_clipping", limit_v=1.75, no_load_m_s=1.0),
        lambda u, x, vs, t: [np.clip(u, -1.75 * (1.0 + vs), 1.75 * (1.0 - vs)) - u],
    ),
]
"""Input effects, with h(u, x, vs, t)."""

MEMORY = [
    form("presliding", displacement_m=1e-5),
    form("cross_axis", axes=("y", "z")),
    form("flexible_mode", frequency_hz=80.0, damping_ratio=0.02),
    form("flexible_mode", frequency_hz=30.0, damping_ratio=0.1, friction_m_s2=0.8),
    form("backlash", gap_m=2e-4, glide_m_s2=0.5),
    form("drive_hysteresis", play_v=1.2, plays=3),
]
WITHOUT_COLUMNS = [
    form("input_lag", time_s=4e-4),
    form("input_delay", time_s=3e-4),
    form("encoder_error", period_m=2e-5, sin_m=2e-7, cos_m=1e-7),
]
EVERY = [*(e for e, _ in STATE), *(e for e, _ in INPUT), *MEMORY, *WITHOUT_COLUMNS]


def each(forms: list[Effect]) -> list[Any]:
    """Return a test's parameters: of each kind of effect one form in every run, the others slow."""
    quick: dict[tuple[object, ...], Effect] = {}
    for e in forms:
        kind = (e.kind, e.memory_size > 0, e.other_axes, e.varies, len(e.parameters) > 1)
        quick.setdefault(kind, e)
    return [
        pytest.param(e, id=f"{k}-{e.name}", marks=() if e in quick.values() else pytest.mark.slow)
        for k, e in enumerate(forms)
    ]
