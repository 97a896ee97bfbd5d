"""Weaker effects of the same shape, and what effects take from a motor's reach."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from motorctl_benchmarks.diagnosis.plants import Options

SHORTEST_LAG_S = 0.1e-3

_TIMES = ("input_lag", "input_delay")
"""Effects whose size is their time."""

_SIZES = frozenset(
    {
        "amplitude",
        "amplitude_m",
        "amplitude_v",
        "force_v",
        "rms_v",
        "coulomb_v",
        "viscous_v_s_m",
        "displacement_m",
        "micro_damping_v_s_m",
        "linear_v_m",
        "quadratic_v_m2",
        "spring_v_m",
        "cubic_v_m3",
        "drag_v_s2_m2",
        "half_width_v",
        "fraction",
        "inertia_v_s2_m",
        "acceleration_v_s2_m",
        "velocity_v_s_m",
    }
)
"""Options without which an effect is none; all others are its shape."""


def scaled(effect: str, options: Options, strength: float) -> Options:
    """Return the options of the same effect with `strength` times the size."""
    if effect in _TIMES:
        return {"time_s": max(strength * options["time_s"], min(SHORTEST_LAG_S, options["time_s"]))}
    return {key: _scaled(key, value, strength) for key, value in options.items()}


def _scaled(key: str, value: Any, strength: float) -> Any:
    if isinstance(value, Mapping):
        return {inner: _scaled(inner, part, strength) for inner, part in value.items()}
    if isinstance(value, list | tuple):
        return [_scaled(key, part, strength) for part in value]
    return value * strength if key in _SIZES else value


@dataclass(frozen=True)
class Claim:
    """What effects take from the motor, so that the fastest motion leaves room for them."""

    force_v: float
    inertia: float
    gain: float


FORCE_OF_AN_EFFECT_V = 0.25


def claim(effects: Mapping[str, Options]) -> Claim:
    """Sum up what full-strength effects take: force, added inertia, and the thrust that is left."""
    gain = 1.0
    if "force_ripple" in effects:
        gain -= sum(h["amplitude"] for h in effects["force_ripple"]["harmonics"])
    if "gain_drift" in effects:
        gain *= 1.0 - effects["gain_drift"]["fraction"]
    added = effects.get("payload_change", {}).get("inertia_v_s2_m", 0.0)
    return Claim(FORCE_OF_AN_EFFECT_V * len(effects), max(added, 0.0), gain)
