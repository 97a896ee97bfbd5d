"""Diagnoses made by hand, of recordings whose truth is known, for the tests of refinement."""

import math
from pathlib import Path

import numpy as np

from motorctl.config import load
from motorctl.identify.columns.measured import measured
from motorctl.identify.diagnose.result import (
    AxisDiagnosis,
    FoundEffect,
    ModelError,
    RecordingDiagnosis,
)
from motorctl.log import read_recording
from motorctl.loop.simulation import simulate
from motorctl.model import EffectList, effect_class, make_effect

THETA = {
    "x": (0.197, 0.2265, 0.139, 0.012, -0.0122, -0.00104),
    "y": (0.670, 0.296, 0.182, 0.004, -0.0168, -0.00058),
}
"""What the simulated gantry has: inertia, viscous, Coulomb, offset, quadratic, cubic."""
OF_THETA = (
    "inertia", "viscous_friction", "coulomb_friction", "offset", "em_quadratic", "em_cubic"
)  # fmt: skip
PITCH_M = 0.05
COGGING = {
    "x": ((1, 0.034, 0.3), (2, 0.039, 1.1), (6, 0.142, 0.0)),
    "y": ((1, 0.34, 0.3), (2, 0.10, 1.1), (6, 0.12, 0.0)),
}
"""Order, amplitude [V], phase [rad]."""
LAG_S = 0.39e-3
DELAY_S = {"x": 0.46 * 2e-4, "y": 0.50 * 2e-4}


def effect(name, **options):
    """Make a known effect."""
    return make_effect(effect_class(name), options)


def cogging(axis):
    """Return the gantry's cogging and its parameters."""
    theta = [
        part
        for _, amplitude, phase in COGGING[axis]
        for part in (amplitude * math.cos(phase), amplitude * math.sin(phase))
    ]
    return effect("cogging", pitch_m=PITCH_M, orders=(1, 2, 6)), theta


def found(made, theta=(), score=1000.0, **changes):
    """Say of an effect that it was found."""
    given = {
        "effect": made,
        "theta": np.array(theta, dtype=float),
        "std_error": 0.01 * np.abs(np.array(theta, dtype=float)),
        "option_errors": {},
        "confidence": 0.99,
        "family_confidence": 0.99,
        "explained_fraction": 0.9,
        "score": score,
        "evidence": ("it is seen",),
        "indistinguishable_from": (),
        "alternatives": (),
    }
    return FoundEffect(**given | changes)


def true_effects(axis):
    """Return what the gantry has beyond its declared model, as effects that were found."""
    made, theta = cogging(axis)
    return (
        found(made, theta, 5000.0),
        found(effect("input_lag", time_s=LAG_S), score=800.0, option_errors={"time_s": 1e-6}),
        found(effect("input_delay", time_s=DELAY_S[axis]), score=300.0),
    )


def axis_diagnosis(data, declared, effects, theta, verdict=None, **changes):
    """Put a diagnosis together; theta is that of the declared effects."""
    model = EffectList([*declared.effects, *(part.effect for part in effects)])
    whole = np.concatenate([np.array(theta), *(part.theta for part in effects)])
    given = {
        "data": data,
        "declared": declared,
        "dropped": {},
        "verdict": verdict or ("effect" if effects else "complete"),
        "sentence": "told in one sentence",
        "declared_theta": 1.2 * np.array(theta),
        "declared_std_error": 0.01 * np.abs(np.array(theta)),
        "effects": tuple(effects),
        "unknown": None,
        "missing": (),
        "model": model,
        "theta": whole,
        "std_error": 0.002 * np.abs(whole),
        "error": ModelError("V", 0.2, 0.02, 0.018, 0.99, 3.0, 12e-6, 1.2e-6, 0.1),
        "traces": None,
    }
    return AxisDiagnosis(**given | changes)


def gantry_diagnosis(log, effects=true_effects, axes=("x", "y"), **changes):
    """Diagnose a log of the simulated gantry by knowing the truth."""
    recording = read_recording(log)
    machine = load("published_gantry")
    return RecordingDiagnosis(
        str(log),
        recording.sample_rate_hz,
        recording.duration_s,
        {
            name: axis_diagnosis(
                measured(recording, name),
                machine.axes[name].declared,
                effects(name),
                THETA[name],
                **changes,
            )
            for name in axes
        },
    )


def gantry_log(folder: Path, duration_s=5.0):
    """Simulate the gantry on its own motion."""
    log = folder / "run.parquet"
    simulate(load("published_gantry"), log, duration_s=duration_s)
    return log


def given_diagnosis(recording, models, *_):
    """Find what the simulated gantry has and the configuration has not: cogging, on axis x."""
    cogs, theta = cogging("x")
    effects = {"x": (found(cogs, theta, 5000.0),), "y": ()}
    axes = {}
    for name, declared in models.items():
        truth = dict(zip(OF_THETA, THETA[name], strict=True))
        theta = [truth[effect] for effect in declared.names]
        axes[name] = axis_diagnosis(measured(recording, name), declared, effects[name], theta)
    return RecordingDiagnosis(recording.source, 400.0, recording.duration_s, axes)
