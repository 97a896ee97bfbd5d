"""Diagnoses made by hand: signals of an axis with known effects, as a perfect search gives them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.signal import welch

from motorctl.identify.columns.measured import Measured
from motorctl.identify.diagnose.result import (
    Alternative,
    AxisDiagnosis,
    FoundEffect,
    MissingMotion,
    ModelError,
    RecordingDiagnosis,
    Traces,
    UnknownStructure,
)
from motorctl.model import EffectList, effect_class, make_effect
from motorctl.model.columns import input_columns, state_columns

RATE_HZ = 600.0
BAND_HZ = 200.0
DURATION_S = 24.0
TRAVEL_M = 0.4
NOISE_V = 0.02
FORCE_N_V = 35.0
DECLARED = {
    "inertia": 0.43,
    "viscous_friction": 0.25,
    "coulomb_friction": 0.18,
    "offset": 0.03,
}

KNOWN = {
    "cogging": ({"pitch_m": 0.03, "orders": (1, 2)}, (0.25, 0.1, 0.05, -0.08)),
    "force_ripple": ({"pitch_m": 0.06, "orders": (1,)}, (0.05, 0.03)),
    "stribeck": ({"velocity_m_s": 0.02}, (0.15,)),
    "asymmetric_friction": ({}, (0.05, 0.06)),
    "presliding": ({"displacement_m": 20e-6}, (0.15, 0.0)),
    "position_dependent_friction": ({"center_m": 0.2}, (0.4,)),
    "position_force": ({"knots": (0.0, 0.4, 8)}, (0.1, 0.2, -0.1, 0.0, 0.3, 0.2, -0.2)),
    "quadratic_drag": ({}, (0.15,)),
    "input_lag": ({"time_s": 0.8e-3}, ()),
    "input_delay": ({"time_s": 0.6e-3}, ()),
    "dead_zone": ({"half_width_v": 0.15}, (0.12,)),
    "gain_drift": ({"time_constant_s": 12.0}, (0.08,)),
    "payload_change": ({"time_s": 9.5}, (0.08,)),
    "cross_axis": ({"axes": ("y",)}, (0.03, 0.02)),
    "flexible_mode": ({"frequency_hz": 80.0, "damping_ratio": 0.03}, (0.06,)),
    "encoder_error": ({"period_m": 2e-3, "sin_m": 3e-6, "cos_m": 1e-6}, ()),
    "periodic_disturbance": ({"frequency_hz": 46.0}, (0.06, 0.04)),
    "hard_stop": ({"begin_m": 0.06, "side": "lower"}, (30.0,)),
    "load_friction": ({"slope_s_m": 300.0}, (0.1,)),
    "voltage_clipping": ({"limit_v": 2.0, "no_load_m_s": 2.0}, (0.5,)),
}
"""Options and parameters of an effect of each kind."""


class Motion:
    """Random moves from rest to rest, at various speeds."""

    def __init__(self, seed: int, duration_s: float = DURATION_S) -> None:
        random = np.random.default_rng(seed)
        self.t = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
        self.x, self.v, self.a = (np.zeros(len(self.t)) for _ in range(3))
        begin, place = 0.05, 0.5 * TRAVEL_M
        while begin < self.t[-1]:
            target = random.uniform(0.0, TRAVEL_M)
            if random.random() < 0.25:
                target = float(np.clip(place + random.uniform(-1e-3, 1e-3), 0.0, TRAVEL_M))
            way = target - place
            length = max(0.12, abs(way) * 1.9 / random.choice((0.15, 0.6, 1.2)))
            s = np.clip((self.t - begin) / length, 0.0, 1.0)
            moving = (self.t >= begin) & (self.t < begin + length)
            later = self.t >= begin
            self.x[later] = place + way * (10 * s**3 - 15 * s**4 + 6 * s**5)[later]
            self.v[moving] = way / length * (30 * s**2 - 60 * s**3 + 30 * s**4)[moving]
            self.a[moving] = way / length**2 * (60 * s - 180 * s**2 + 120 * s**3)[moving]
            begin, place = begin + length + random.uniform(0.01, 0.06), target
        self.x[self.t < 0.05] = 0.5 * TRAVEL_M


@cache
def motion(seed: int, duration_s: float = DURATION_S) -> Motion:
    return Motion(seed, duration_s)


def make(name, options=None, theta=None):
    known_options, known_theta = KNOWN[name]
    effect = make_effect(effect_class(name), known_options if options is None else options)
    return effect, np.array(known_theta if theta is None else theta, dtype=float)


def declared_list():
    return EffectList([make_effect(effect_class(name)) for name in DECLARED])


def axis_diagnosis(*names, seed=1, other_seed=2, duration_s=DURATION_S, **changes):
    """Return the diagnosis of axis x whose plant has the named effects of `KNOWN` too."""
    m, y = motion(seed, duration_s), motion(other_seed, duration_s)
    declared = declared_list()
    u0 = np.zeros(len(m.t))
    base = declared.regressor(m.x, m.v, m.a, m.v, m.t, u0)
    noise = NOISE_V * np.random.default_rng(seed + 10).standard_normal(len(m.t))
    # half of the noise is a force, half an error of the measured acceleration
    left = noise / np.sqrt(2.0)
    noise = np.random.default_rng(seed + 20).standard_normal(len(m.t)) * NOISE_V / np.sqrt(2.0)
    acting = base @ np.array(list(DECLARED.values())) + noise
    found = [make(name) for name in names]
    beside = np.stack([y.x, y.v, y.a], axis=1)[:, None, :]
    contributions = {}
    for effect, theta in found:
        if effect.kind == "state":
            others = beside if effect.other_axes else None
            columns = state_columns(effect, m.x, m.v, m.a, m.v, m.t, others)
            contributions[effect.name] = theta @ columns
    u = acting + sum(contributions.values(), np.zeros(len(m.t)))
    for effect, theta in found:
        before = u
        if effect.kind == "input":
            for _ in range(20):
                contributions[effect.name] = theta @ input_columns(effect, u, m.x, m.v, m.t)
                u = before + contributions[effect.name]
        elif effect.kind == "command":
            s = 2j * np.pi * np.fft.rfftfreq(len(u), 1.0 / RATE_HZ)
            lead = (1.0 + s * effect.lag_s) * np.exp(s * effect.delay_s)
            u = u + np.fft.irfft(np.fft.rfft(u - noise) * (lead - 1.0), len(u))
            contributions[effect.name] = u - before
        elif effect.kind == "measurement":
            k = 2 * np.pi / effect.options.period_m
            e = effect.options.sin_m * np.sin(k * m.x) + effect.options.cos_m * np.cos(k * m.x)
            slow = np.abs(m.v) * k < 2 * np.pi * BAND_HZ
            contributions[effect.name] = DECLARED["inertia"] * (k * m.v) ** 2 * e * slow
            u = before + contributions[effect.name]
    alone = np.linalg.lstsq(base, u, rcond=None)[0]
    model = EffectList([*declared.effects, *(effect for effect, _ in found)])
    before = u + left - base @ alone
    return _assembled(
        m,
        u,
        before,
        noise + left,
        left,
        declared,
        alone,
        model,
        found,
        contributions,
        base,
        changes,
    )


def _assembled(
    m, u, before, after, left, declared, alone, model, found, contributions, base, changes
):
    theta = np.concatenate([list(DECLARED.values()), *(theta for _, theta in found)])
    frequency, spectrum_before = welch(before, RATE_HZ, nperseg=1024)
    _, spectrum_after = welch(after, RATE_HZ, nperseg=1024)
    rms = {name: float(np.sqrt(np.mean(r**2))) for name, r in (("b", before), ("a", after))}
    traces = Traces(
        time_s=m.t,
        position=m.x,
        velocity=m.v,
        acceleration=m.a - left / DECLARED["inertia"],
        command=u,
        residual_before=before,
        residual_after=after,
        contributions=contributions,
        friction=base[:, 1:3] @ theta[1:3],
        held_out=(m.t % 8.0) >= 5.0,
        band_hz=BAND_HZ,
        noise_floor_rms=NOISE_V,
        frequency_hz=frequency,
        spectrum_before=spectrum_before,
        spectrum_after=spectrum_after,
        spectrum_noise=np.full(len(frequency), 2 * NOISE_V**2 / RATE_HZ),
    )
    names = [effect.name for effect, _ in found]
    share = 1.0 if rms["b"] <= NOISE_V else 1.0 - (rms["a"] ** 2 - NOISE_V**2) / rms["b"] ** 2
    diagnosis = AxisDiagnosis(
        data=Measured(
            source="run.parquet",
            axis="x",
            sample_rate_hz=RATE_HZ,
            time_s=m.t,
            position=m.x,
            command=u,
            usable=np.ones(len(u), dtype=np.bool_),
            resolution=0.5e-6,
            reference=m.x,
            force_per_command=FORCE_N_V,
        ),
        declared=declared,
        dropped={},
        verdict="effect" if found else "complete",
        sentence=f"The axis has {' and '.join(names)}, which the declared model lacks."
        if found
        else "The declared model is complete: what it leaves is noise.",
        declared_theta=alone,
        declared_std_error=np.full(len(alone), 1e-3),
        effects=tuple(_found(effect, values, len(found)) for effect, values in found),
        unknown=None,
        missing=(),
        model=model,
        theta=theta,
        std_error=np.full(len(theta), 1e-3),
        error=ModelError(
            unit="V",
            held_out_before_rms=rms["b"],
            held_out_after_rms=rms["a"],
            noise_floor_rms=NOISE_V,
            explained_fraction=float(np.clip(share, 0.0, 1.0)),
            command_rms=float(np.sqrt(np.mean(u**2))),
            simulated_position_before_rms=31e-6,
            simulated_position_after_rms=2.4e-6,
            window_s=0.5,
        ),
        traces=traces,
        notes=("12 rows were filled in",),
        seconds=3.2,
    )
    return replace(diagnosis, **changes)


def _found(effect, theta, count):
    fitted = [
        name
        for name, option in effect.options.model_dump().items()
        if isinstance(option, float) and type(effect.options).model_fields[name].is_required()
    ]
    return FoundEffect(
        effect=effect,
        theta=theta,
        std_error=np.full(len(theta), 2e-3),
        option_errors={name: 1e-3 * abs(getattr(effect.options, name)) for name in fitted},
        confidence=0.99,
        family_confidence=0.99,
        explained_fraction=0.995 / count,
        score=4321.0,
        evidence=(
            "It gains 4321 in held-out likelihood; the largest that a clean machine gave is 52.",
            "The gain remains without its best stretch of 2 s.",
        ),
        indistinguishable_from=(),
        alternatives=(
            Alternative("periodic_disturbance", "its line wanders with the speed", 0.31),
        ),
    )


def unknown_axis(depends_on=("position", "velocity"), **changes):
    """Return the diagnosis of an axis that sticks in one place, which no effect explains."""
    m = motion(1)
    patch = 0.25 * np.exp(-(((m.x - 0.28) / 0.02) ** 2)) * np.sign(m.v)
    axis = axis_diagnosis()
    spline, theta = make("position_force")
    sentence = "What is left depends on position and velocity in a way that no known effect has."
    unknown = UnknownStructure(
        depends_on=depends_on,
        sentence="A spline in position takes 40 % of it away.",
        compensation=spline,
        family=spline.family(),
        theta=0.1 * theta,
        std_error=np.full(len(theta), 1e-3),
        explained_fraction=0.4,
    )
    left = axis.traces.residual_after
    rms = [float(np.sqrt(np.mean((left + part * patch) ** 2))) for part in (1.0, 0.6)]
    error = replace(
        axis.error,
        held_out_before_rms=rms[0],
        held_out_after_rms=rms[1],
        explained_fraction=0.4,
    )
    traces = replace(
        axis.traces,
        residual_before=left + patch,
        residual_after=left + 0.6 * patch,
        contributions={spline.name: 0.4 * patch},
        spectrum_before=welch(left + patch, RATE_HZ, nperseg=1024)[1],
        spectrum_after=welch(left + 0.6 * patch, RATE_HZ, nperseg=1024)[1],
        command=axis.traces.command + patch,
    )
    return replace(
        axis,
        verdict="unknown_structure",
        sentence=sentence,
        unknown=unknown,
        error=error,
        traces=traces,
        model=EffectList([*axis.declared.effects, spline]),
        theta=np.concatenate([axis.theta, 0.1 * theta]),
        std_error=np.full(len(axis.theta) + len(theta), 1e-3),
        **changes,
    )


def insufficient_axis(axis="x"):
    """Return the diagnosis of an axis that hardly moved: nothing could be fitted."""
    complete = axis_diagnosis()
    nothing = np.zeros(0)
    program = {
        "kind": "moves",
        "axis": axis,
        "start_m": 0.0,
        "moves": [
            {
                "target_m": target,
                "max_velocity_m_s": 0.1,
                "max_acceleration_m_s2": 2.0,
                "max_jerk_m_s3": 200.0,
                "dwell_s": 0.2,
            }
            for target in (0.02, 0.0)
        ],
        "cycles": 10,
    }
    missing = MissingMotion(
        effects=("presliding", "stribeck"),
        why="The axis never reversed slowly.",
        motion="slow reversals over 20 mm",
        program=program,
    )
    nan = float("nan")
    return replace(
        complete,
        verdict="insufficient_data",
        sentence="This recording cannot tell: the axis hardly moved.",
        declared_theta=nothing,
        declared_std_error=nothing,
        theta=nothing,
        std_error=nothing,
        missing=(missing,),
        error=ModelError("V", nan, nan, nan, nan, nan),
        traces=None,
    )


def recording(notes=(), **axes):
    """Put axes together; `data.axis` follows the name."""
    named = {name: replace(axis, data=replace(axis.data, axis=name)) for name, axis in axes.items()}
    return RecordingDiagnosis("run.parquet", RATE_HZ, DURATION_S, named, notes=tuple(notes))
