"""Simulated servo axes; engine: own numba integrator, Moreau midpoint with friction's exact prox.

Hobby servos, brushless joints, voice coils, piezo motor stages, belt drives and iron-core linear
motors. The effect's size is searched until it leaves the wanted share of the command unexplained by
mass, viscous and Coulomb friction and an offset.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from motorctl_benchmarks.other_machines.energy.energy_effects import Draw, draw_effect
from motorctl_benchmarks.other_machines.energy.energy_families import (
    FAMILIES,
    LOCAL,
    RUBBING,
    STYLES,
    WHERE,
    Family,
    Frame,
    log_uniform,
)
from motorctl_benchmarks.other_machines.energy.energy_integrator import (
    SHAPES,
    Axis,
    Effect,
    Extra,
    Loop,
    simulate,
    unexplained,
)
from motorctl_benchmarks.other_machines.energy.energy_programme import draw_programme
from motorctl_benchmarks.other_machines.machine_recording import MachineRecording

Array = NDArray[np.float64]

KINDS: tuple[str, ...] = tuple(effect.name.lower() for effect in Effect)
MODES = (
    "cascade",
    "PID with feedforward",
    "observer with state feedback",
    "computed torque",
    "sliding layer",
)


def _share(effect: Effect, extra: Extra, axis: Axis, out: Array, period: float) -> float:
    """Return the effect's share of the command's rms: what the basics do not explain."""
    whole = float(np.sqrt(np.mean(out[:, 2] ** 2))) * axis.force_constant
    if effect is Effect.GRAVITY_CONSTANT:
        return abs(extra.size) / whole
    if effect is Effect.ASYMMETRIC_FRICTION:  # an offset explains it, save in rests
        return abs(extra.size) * axis.coulomb / whole
    return unexplained(axis, out, period)


def _tuned(rng: np.random.Generator, frame: Frame, draw: Draw, family: Family, calm: float) -> Loop:
    """Return a controller as quick as sampling, encoder and machine allow; calm slows it."""
    effect = Effect(draw.extra.effect)
    axis, period, resolution = frame.axis, frame.period, frame.resolution
    bandwidth = 2.0 * np.pi * log_uniform(rng, *family.bandwidth_hz)
    late = 1.5 * period
    if effect is Effect.COMMAND_LAG:
        late += draw.extra.size
    elif effect is Effect.COMMAND_DELAY:
        late += draw.extra.size * period
    elif effect is Effect.UNKNOWN_TELEGRAM_LOSS:
        late += 0.5 * draw.extra.scale
    limits = [bandwidth, 0.15 / late, np.sqrt(0.03 * frame.acceleration / resolution)]
    if effect is Effect.FLEXIBLE_LOAD:
        limits.append(2.0 * np.pi / draw.extra.size * 0.15)
    elif draw.train.two_bodies and draw.train.stiffness == 0.0:
        limits.append(2.0 * np.pi / draw.extra.size * 0.35)
    elif effect is Effect.BACKLASH_LOAD:
        limits.append(2.0 * np.pi * 5.0)
    quick = min(limits) * calm
    mode = int(rng.integers(5))
    worst = 3.5 * frame.peak
    if effect in (Effect.VOLTAGE_CLIPPING, Effect.CURRENT_SATURATION):
        worst = 2.5 * frame.peak
    if effect in (Effect.GRAVITY_SINE, Effect.GRAVITY_CONSTANT, Effect.POSITION_FORCE):
        worst += 3.0 * draw.extra.size
    return Loop(
        mode,
        axis.mass * rng.uniform(0.85, 1.15),
        axis.viscous * rng.uniform(0.5, 1.2),
        axis.coulomb * rng.uniform(0.5, 1.0),
        rng.choice([0.0, 0.7, 1.0]) if mode == 0 else rng.uniform(0.8, 1.0),
        quick,
        rng.uniform(3.5, 6.0) * quick,
        rng.uniform(0.4, 1.0),
        max(3.0 * resolution, 2e-4 * frame.travel),
        worst,
        max(0.05 * frame.speed, axis.width),
    )


def _coloured(rng: np.random.Generator, count: int, period: float) -> Array:
    """Return unit noise of first order, 2 to 40 Hz."""
    colour = 1.0 / np.hypot(1.0, np.fft.rfftfreq(count, period) / log_uniform(rng, 2.0, 40.0))
    noise = np.fft.irfft(np.fft.rfft(rng.standard_normal(count)) * colour, count)
    return np.asarray(noise / noise.std())


def _frame(
    rng: np.random.Generator,
    effect: Effect,
    family: Family,
    unit: str,
    coarse: bool,
    friction: int | None,
) -> Frame:
    """Return the machine without its effect."""
    travel, mass = log_uniform(rng, *family.travel), log_uniform(rng, *family.mass)
    speed, rise_s = travel / rng.uniform(*family.cross_s), rng.uniform(*family.rise_s)
    rates = np.array([500, 800, 1000, 1250, 2000, 2500, 4000, 5000])
    rates = rates[rates >= 35.0 / rise_s]
    rate = float(rng.choice(rates[:3] if effect is Effect.COMMAND_DELAY else rates))
    inertial = mass * speed / rise_s
    viscous = rng.uniform(*family.viscous_share) * inertial / speed
    coulomb = inertial * (rng.uniform(0.15, 0.4) if effect in RUBBING else rng.uniform(0.04, 0.22))
    shape = int(rng.integers(effect is Effect.ASYMMETRIC_FRICTION, 5))
    shape *= effect is not Effect.PRESLIDING
    shape = shape if friction is None else friction
    width = (
        (
            rng.uniform(0.005, 0.03) * speed
            if family.unit == "rad"
            else min(log_uniform(rng, 5e-4, 1e-2), 0.05 * speed)
        )
        if shape
        else 0.0
    )
    peak = inertial + viscous * speed + coulomb
    offset = coulomb * rng.uniform(-0.3, 0.3)
    if effect in (Effect.GRAVITY_CONSTANT, Effect.ASYMMETRIC_FRICTION):
        offset *= 0.2
    constant = 1.0 if unit == "N" else peak / rng.uniform(*family.command_peak)
    if unit == "N m":  # of a belt's pulley, or of the joint itself
        constant = 1.0 / rng.uniform(0.01, 0.03) if family.unit == "m" else 1.0
    resolution = travel * (rng.uniform(1e-4, 3e-4) if coarse else log_uniform(rng, 1e-6, 1.5e-5))
    return Frame(
        Axis(mass, viscous, coulomb, offset, shape, width, constant),
        travel,
        speed,
        speed / rise_s,
        peak,
        1.0 / rate,
        rng.uniform(15.0, 40.0),
        resolution,
    )


def _machine(
    effect: Effect, rng: np.random.Generator, friction: int | None, noise_asked: int | None
) -> tuple[MachineRecording, bool]:
    """Return a recording, and whether the machine runs well and shows its effect."""
    kind = effect.name.lower()
    family = FAMILIES[str(rng.choice(WHERE.get(effect, tuple(FAMILIES))))]
    unit, noise_sort = str(rng.choice(family.commands)), int(rng.integers(4))
    noise_sort = noise_sort if noise_asked is None else noise_asked
    on_force = bool(rng.integers(2))
    frame = _frame(rng, effect, family, unit, noise_sort == 3, friction)
    axis, resolution = frame.axis, frame.resolution
    goal, programme = draw_programme(rng, frame, STYLES.get(effect, (0, 1, 2, 3, 4)))
    noise = np.zeros_like(goal)
    noise[:, 2] = rng.random(len(goal))
    if noise_sort == 1:
        noise[:, 0] = rng.uniform(0.5, 2.0) * resolution * rng.standard_normal(len(goal))
    coloured = _coloured(rng, len(goal), frame.period) * rng.uniform(0.008, 0.03)
    first = draw_effect(rng, effect, frame)
    wish = log_uniform(rng, 0.08 if noise_sort == 3 else 0.06, 0.18 if effect in LOCAL else 0.4)
    loop_seed = int(rng.integers(2**31))
    steps = max(4, int(np.ceil(frame.period / 1.25e-4)))

    def run(draw: Draw, calm: float) -> tuple[Array, Loop]:
        loop = _tuned(np.random.default_rng(loop_seed), frame, draw, family, calm)
        train = draw.train.sized(draw.extra.size, axis.mass)
        return simulate(
            axis, train, draw.extra, loop, goal, noise, frame.period, steps, resolution
        ), loop

    draw, calm, rms = first, 1.0, 0.0
    best, best_score = (first, 1.0), np.inf
    low, high = sorted((abs(first.low), abs(first.high)))
    weak, strong = 0.0, np.inf  # sizes known to be too small and too large
    for _ in range(8):
        out, loop = run(draw, calm)
        share = _share(effect, draw.extra, axis, out, frame.period)
        level = float(np.sqrt(np.mean(out[:, 2] ** 2)))
        error = float(np.abs(out[:, 0] - goal[:, 0]).mean()) / frame.travel
        full = float(np.mean(np.abs(out[:, 2]) > 0.98 * loop.limit / axis.force_constant))
        lively = float(np.sqrt(np.mean(np.diff(out[:, 2], 2) ** 2))) / level
        good = error < 0.05 and full < 0.003 and lively < 0.14
        off = abs(np.log(max(share, 1e-9) / wish)) if effect else 0.0
        if off + 10.0 * (not good) < best_score:
            best, best_score, rms = (draw, calm), off + 10.0 * (not good), level
        if good and off < 0.15:
            break
        size = abs(draw.extra.size)
        weak, strong = (max(weak, size), strong) if share < wish else (weak, min(strong, size))
        if not good:
            calm, weak = 0.8 * calm, 0.0
            size *= 0.8 if share > wish else 1.0
        elif 0.0 < weak < strong < np.inf:
            size = float(np.sqrt(weak * strong))
        elif effect:
            size *= float(np.clip((wish / max(share, 1e-9)) ** 0.9, 0.25, 4.0))
        size = float(np.clip(size, low, high))
        size = float(round(size)) if effect is Effect.COMMAND_DELAY else size
        if good and size == abs(draw.extra.size):
            break
        size = float(np.copysign(size, draw.low))
        draw = draw._replace(extra=draw.extra._replace(size=size))
    draw, calm = best
    if noise_sort == 2 and on_force:
        noise[:, 1] = coloured * rms * axis.force_constant
    out, loop = run(draw, calm)
    share = _share(effect, draw.extra, axis, out, frame.period)
    command = out[:, 2] + (coloured * rms if noise_sort == 2 and not on_force else 0.0)
    home = (
        round(rng.choice([0.0, 0.5, -0.5, rng.uniform(-1.0, 1.0)]) * frame.travel / resolution)
        * resolution
    )
    extra = draw.extra
    shape = (
        ("Dahl", "LuGre", "Maxwell slip")[extra.mode]
        if effect is Effect.PRESLIDING
        else SHAPES[axis.shape]
    )
    story = (
        f"{family.name}: {axis.mass:.3g} {'kg' if family.unit == 'm' else 'kg m2'}, viscous "
        f"{axis.viscous:.3g}, Coulomb {axis.coulomb:.3g} ({shape}, width {axis.width:.3g}), "
        f"offset {axis.offset:.3g}, {axis.force_constant:.3g} force per {unit}; travel "
        f"{frame.travel:.3g} {family.unit}, top speed {frame.speed:.3g}, {programme}, "
        f"{MODES[loop.mode]} at {loop.bandwidth / 6.2832:.1f} Hz; {kind} size {extra.size:.3g}"
        f" scale {extra.scale:.3g} place {extra.place:.3g} second {extra.second:.3g} mode "
        f"{extra.mode}, home {home:.4g}, wished {wish:.3f}, share {share:.3f}"
    )
    fit = best_score < 10.0 and (not effect or 0.05 <= share <= 0.45)
    recording = MachineRecording(
        generator="energy_machines",
        kind=kind,
        story=story,
        command=command,
        time_s=np.arange(float(len(command))) * frame.period,
        position=out[:, 1] + home,
        reference=goal[:, 0] + home if rng.random() < 0.6 else None,
        position_unit=family.unit,
        command_unit=unit,
        resolution=resolution,
        friction_shape=shape,
        noise=noise_sort,
    )
    return recording, fit


def machine(
    kind: str, seed: int, friction: int | None = None, noise: int | None = None
) -> MachineRecording:
    """Return a recording of a machine with this effect, the same for the same seed.

    Parameters
    ----------
    kind : str
        One of KINDS.
    seed : int
        Draws everything else; a machine that does not run well is drawn anew.
    friction : int, optional
        Index into SHAPES; drawn if not given.
    noise : int, optional
        Which noise, as the recording tells it; drawn if not given.
    """
    effect = Effect[kind.upper()]
    for again in range(3):
        recording, fit = _machine(
            effect, np.random.default_rng([seed, int(effect), 77, again]), friction, noise
        )
        if fit:
            break
    return recording
