"""A servo axis that runs: its motion programme, its controllers, and the loop around MuJoCo's step.

MuJoCo (its C function mj_step, called from compiled code) integrates the machine; what MuJoCo has
no words for (shaped friction, drives, force ripple, ...) is computed here before every step.
Forces are in N or N m, positions in m or rad: "unit" stands for either.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
_Function = TypeVar("_Function", bound=Callable[..., Any])

mujoco: Any = import_module("mujoco")
_LIBRARY = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco.so*"))))
_STEP: Any = _LIBRARY.mj_step
_STEP.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
_STEP.restype = None

# Effects that have formulas here; the others are built from MuJoCo's own elements.
(
    BUILT_IN,
    COGGING,
    RIPPLE,
    SATURATION,
    CLIPPING,
    HYSTERESIS,
    STRIBECK,
    ASYMMETRIC,
    LOADED,
    WARMING,
    PLACE,
    PRESLIDING,
    EDDY,
    ENCODER,
) = range(14)
SHAPES = ("ideal", "tanh", "arctan", "algebraic", "clipped")
CONTROLLERS = ("cascade", "PID + feedforward", "disturbance observer", "computed torque")
_STATES = 16


def compiled(function: _Function) -> _Function:
    """Return the function compiled by numba, typed as it was."""
    return cast(_Function, njit(cache=True)(function))


# ----------------------------------------------------------------------- motion programme


def _move(
    start: float, end: float, top_speed: float, top_accel: float, rate_hz: float, shape: int
) -> Array:
    """Return the positions of one rest-to-rest move: quintic (0), cosine (1) or S-curve (2)."""
    distance = abs(end - start)
    if shape == 2:
        speed = min(top_speed, np.sqrt(0.7 * top_accel * distance))
        ramp_s = speed / (0.7 * top_accel)
        ramp, cruise = (max(int(s * rate_hz), 2) for s in (ramp_s, distance / speed - ramp_s))
        rise = np.arange(ramp) / ramp
        speeds = np.concatenate([rise, np.ones(cruise), rise[::-1]])
        speeds = np.convolve(speeds, np.ones(max(ramp // 3, 2)))
        way = np.cumsum(speeds) / speeds.sum()
    else:
        factors = ((1.875, 5.7735), (np.pi / 2, np.pi**2 / 2))[shape]
        time_s = max(factors[0] * distance / top_speed, np.sqrt(factors[1] * distance / top_accel))
        x = np.linspace(0.0, 1.0, max(int(time_s * rate_hz), 8))
        way = 0.5 - 0.5 * np.cos(np.pi * x) if shape else x**3 * (10 - 15 * x + 6 * x * x)
    return np.asarray(start + (end - start) * way)


def _fade(time_s: Array, ramp_s: float) -> Array:
    """Return a window that rises and falls within ramp_s, smooth in its acceleration."""
    x = np.clip(np.minimum(time_s, time_s[::-1]) / ramp_s, 0.0, 1.0)
    return np.asarray(x**3 * (10 - 15 * x + 6 * x * x))


def _sines(
    rng: np.random.Generator,
    at: float,
    room: float,
    speed: float,
    accel: float,
    rate_hz: float,
    top_hz: float,
) -> Array:
    """Return a faded multi-sine around a place, within room, speed and acceleration."""
    time_s = np.arange(int(rng.uniform(3.0, 7.0) * rate_hz)) / rate_hz
    low_hz = min(0.25 * accel / speed / 6, 0.3 * top_hz)
    hertz = np.geomspace(low_hz, top_hz, int(rng.integers(3, 7))) * rng.uniform(0.9, 1.1)
    wave = np.zeros_like(time_s)
    for f in hertz:
        wave += np.sin(2 * np.pi * (f * time_s + rng.random())) / f ** rng.uniform(1.0, 1.8)
    wave *= _fade(time_s, 0.6)
    rates = np.gradient(wave) * rate_hz
    jerky = np.sqrt(np.mean((np.gradient(rates) * rate_hz) ** 2)) * 2.5
    scale = min(room / np.abs(wave).max(), speed / np.abs(rates).max(), accel / jerky)
    return np.asarray(at + scale * wave)


def _set_points(
    rng: np.random.Generator, at: float, low: float, high: float, accel: float, rate_hz: float
) -> Array:
    """Return random set points, softened by four equal first-order low-passes."""
    pole = np.sqrt(accel / (0.14 * (high - low)))
    hold_s = rng.uniform(2.0, 6.0) / pole
    count = int(np.ceil(rng.uniform(4.0, 7.0) / hold_s))
    targets = np.append(rng.uniform(low, high, count), rng.uniform(low, high))
    track = np.repeat(targets, int(hold_s * rate_hz))
    track = np.append(track, np.full(int(9 / pole * rate_hz), targets[-1]))
    track = _soften(track, at, 1 - np.exp(-pole / rate_hz))
    x = np.linspace(0.0, 1.0, int(4 / pole * rate_hz))  # what is left of the way, smoothly
    track[-x.size :] += x**3 * (10 - 15 * x + 6 * x * x) * (targets[-1] - track[-x.size :])
    return np.asarray(track)


@compiled
def _soften(track: Array, start: float, alpha: float) -> Array:
    """Return the track behind four first-order low-passes that rest at start."""
    out = np.empty_like(track)
    x = np.full(4, start)
    for k in range(track.size):
        value = track[k]
        for i in range(4):
            x[i] += alpha * (value - x[i])
            value = x[i]
        out[k] = value
    return out


def programme(
    rng: np.random.Generator,
    limits: tuple[float, float],
    speed: float,
    accel: float,
    rate_hz: float,
    duration_s: float,
    mood: str,
    micro: float,
) -> tuple[Array, str]:
    """Return the reference (position, speed and acceleration columns) and what it is.

    mood: "even", "slow" (more crawling), "brisk" (harder accelerations, faster sines) or "ends"
    (often to the ends of the travel); micro: amplitude of small moves, 0 for none.
    """
    low, high = limits
    style = int(rng.integers(4))
    weights = np.full(6, 0.06)
    weights[(0, 1, 2, 3)[style]] += 0.6
    weights[4] += 0.25 if mood == "slow" else 0.08
    weights[5] = 0.35 if micro > 0 else 0.0
    if mood == "brisk":
        weights[1] += 0.35
    shape = int(rng.integers(3))
    at = float(rng.uniform(low, high))
    parts = [np.full(int(rng.uniform(0.3, 0.7) * rate_hz), at)]
    queue = [
        0,
        0,
        4,
        4 if mood == "slow" else 0,
        1 if mood == "brisk" else 3,
        5 if micro > 0 else 4,
    ]
    while sum(p.size for p in parts) < duration_s * rate_hz:
        block = queue.pop(0) if queue else int(rng.choice(6, p=weights / weights.sum()))
        vigour = 1.0 if mood == "brisk" else float(rng.uniform(0.5, 1.0))
        if block == 0:  # point to point, all speeds
            for _ in range(int(rng.integers(3, 7))):
                ends = rng.random() < (0.6 if mood == "ends" else 0.25)
                to = (low, high)[at < (low + high) / 2] if ends else float(rng.uniform(low, high))
                top = speed * (1.0 if rng.random() < 0.5 else float(rng.uniform(0.25, 1.0)))
                if abs(to - at) > 0.03 * (high - low):
                    parts += [_move(at, to, top, accel * vigour, rate_hz, shape)]
                    at = to
                    parts += [np.full(int(rng.uniform(0.05, 0.6) * rate_hz), at)]
        elif block == 1:
            middle = float(rng.uniform(low + 0.3 * (high - low), high - 0.3 * (high - low)))
            parts += [_move(at, middle, speed, accel * vigour, rate_hz, shape)]
            at = middle
            top_hz = accel / speed / 6 * float(rng.uniform(4.0, 9.0 if mood == "brisk" else 6.0))
            top_hz = min(top_hz, 25.0, rate_hz / 25)
            room = min(at - low, high - at)
            parts += [_sines(rng, at, room, speed, accel * vigour, rate_hz, top_hz)]
        elif block == 2:
            parts += [_set_points(rng, at, low, high, accel * vigour, rate_hz)]
            at = float(parts[-1][-1])
        elif block == 3:  # raster: lines to and fro, each pair faster
            left = low + float(rng.uniform(0.0, 0.3)) * (high - low)
            right = high - float(rng.uniform(0.0, 0.3)) * (high - low)
            for top in speed * np.sort(rng.uniform(0.25, 1.0, int(rng.integers(2, 4)))):
                for to in (left, right):
                    parts += [_move(at, to, float(top), accel * vigour, rate_hz, 2)]
                    at = to
                    parts += [np.full(int(rng.uniform(0.02, 0.25) * rate_hz), at)]
        elif block == 4:  # crawl both ways
            for sign in rng.permutation([1.0, -1.0, 1.0, -1.0]):
                top = speed * float(np.exp(rng.uniform(np.log(0.015), np.log(0.15))))
                to = float(np.clip(at + sign * top * rng.uniform(0.6, 1.8), low, high))
                if abs(to - at) > 0.3 * top:
                    parts += [_move(at, to, top, accel * 0.5, rate_hz, 2)]
                    at = to
        else:  # small to and fro
            x_s = np.arange(int(rng.uniform(2.5, 4.0) * rate_hz)) / rate_hz
            size = micro * _fade(x_s, 1.2)
            away = 1.0 if at < (low + high) / 2 else -1.0
            parts += [at + away * size * np.sin(2 * np.pi * rng.uniform(0.5, 1.5) * x_s)]
    position = np.concatenate(parts)[: int(duration_s * rate_hz)]
    rates = np.gradient(position) * rate_hz
    name = ("point to point", "multi-sine", "random set points", "raster")[style]
    return np.stack([position, rates, np.gradient(rates) * rate_hz], axis=1), name


# ------------------------------------------------------------------------------ formulas


@compiled
def shaped(shape: int, speed: float, width: float) -> tuple[float, float]:
    """Return friction's sign-like function of speed and its slope."""
    y = speed / width
    if shape == 1:
        s = np.tanh(y)
        return s, (1 - s * s) / width
    if shape == 2:
        return 2 / np.pi * np.arctan(np.pi / 2 * y), 1 / (1 + (np.pi / 2 * y) ** 2) / width
    if shape == 3:
        return y / np.sqrt(1 + y * y), (1 + y * y) ** -1.5 / width
    if shape == 4 and abs(y) < 1:
        return y, 1 / width
    return np.sign(y), 0.0


@compiled
def _wave(p: Array, x: float) -> float:
    """Return a wave of period p[1] with some second harmonic."""
    angle = 2 * np.pi * x / p[1] + p[2]
    return float(np.sin(angle) + p[3] * np.sin(2 * angle + p[4]))


@compiled
def _drive(code: int, p: Array, asked: float, speed: float, place: float, state: Array) -> float:
    """Return the force that the amplifier and motor make of the one asked for."""
    if code == RIPPLE:
        return float(asked * (1 + p[0] * _wave(p, place)))
    if code == SATURATION:
        return float(asked / (1 + (abs(asked) * p[0]) ** p[1]) ** (1 / p[1]))
    if code == CLIPPING:
        return float(max(-1 / p[0] - p[1] * speed, min(1 / p[0] - p[1] * speed, asked)))
    if code == HYSTERESIS and p[2] > 0:  # plays in parallel (Prandtl and Ishlinskii)
        total = 0.0
        for i in range(4):
            reach = p[1] * (i + 1)
            state[i] = max(asked - reach, min(asked + reach, state[i]))
            total += state[i] / 4
        return float(asked + p[0] * (total - asked))
    if code == HYSTERESIS:  # a loop that closes exponentially over the asked amplitude (Duhem)
        step = asked - state[4]
        state[4] = asked
        goal = np.sign(step) * p[1]
        state[0] = goal + (state[0] - goal) * np.exp(-abs(step) / p[1])
        return float(asked - p[0] * state[0])
    return asked


@compiled
def _level(
    code: int, p: Array, base: float, place: float, speed: float, time_s: float, force: float
) -> float:
    """Return the height of Coulomb friction here and now."""
    if code == STRIBECK:
        return float(base * (1 + p[0] * np.exp(-(abs(speed / p[1]) ** p[2]))))
    if code == ASYMMETRIC:
        return float(base * (1 + p[0] * np.sign(speed if abs(speed) > p[1] else force)))
    if code == LOADED:
        return float(base + p[0] * abs(force))
    if code == WARMING:
        return float(base * (1 + p[0] * np.exp(-time_s / p[1])))
    if code == PLACE:
        x = (place - p[1]) / p[2]
        if p[3] == 0:
            return float(base * (1 + p[0] * np.exp(-x * x)))
        return float(base * (1 + p[0] * (0.5 + 0.5 * np.tanh(x) if p[3] == 1 else x * x)))
    return base


@compiled
def _extra(code: int, p: Array, place: float, speed: float) -> float:
    """Return the force that the machine has beside its friction."""
    if code == COGGING:
        return float(-p[0] * _wave(p, place))
    if code == EDDY:
        return float(-2 * p[0] * (speed / p[1]) / (1 + (speed / p[1]) ** 2))
    return 0.0


@compiled
def _memory_friction(p: Array, height: float, speed: float, h: float, state: Array) -> float:
    """Return presliding friction: Dahl (p[3] = 0), LuGre (1) or Maxwell slip (2), reach p[1]."""
    if p[3] == 2:
        total = 0.0
        for i in range(5):
            reach = p[1] * (i + 1) * 0.4
            state[i] = max(-reach, min(reach, state[i] + speed * h))
            total += state[i] / reach / 5
        return -height * total
    old = state[0]
    rate = abs(speed) / p[1]
    state[0] = old + (np.sign(speed) * p[1] - old) * (1 - np.exp(-rate * h))
    force = -height * state[0] / p[1]
    if p[3] == 1:
        force -= p[2] * (state[0] - old) / h
    return float(force)


@compiled
def along(
    code: int, p: Array, path: Array, asked: Array, coulomb: float, shape: int, width: float
) -> Array:
    """Return the effect's force along a path of (time, place, speed) rows, were it followed."""
    out = np.empty(asked.size)
    state = np.zeros(_STATES)
    for k in range(asked.size):
        t, x, v = path[k]
        force = _drive(code, p, asked[k], v, x, state)
        extra = _level(code, p, coulomb, x, v, t, force) - coulomb
        out[k] = force - asked[k] + _extra(code, p, x, v) - extra * shaped(shape, v, width)[0]
    return out


# ---------------------------------------------------------------------- control and run


@compiled
def _control(kind: int, g: Array, y: float, r: Array, ts: float, c: Array) -> float:
    """Return the force asked for; g: see machines' _gains, c: the controller's memory."""
    inertia, pole, zeta, limit = g[0], g[1], g[2], g[9]
    error = r[0] - y
    c[1] += g[8] * ((y - c[0]) / ts - c[1])
    c[0] = y
    feed = g[7] + g[3] * inertia * r[2] + g[4] * r[1] + g[5] * np.tanh(r[1] / g[6])
    if kind == 0:
        wish = g[2] * r[1] + 0.8 * pole * error - c[1]
        push = c[2] + g[10] * pole * wish * ts
        force = feed + inertia * (2.5 * pole * wish + push)
    elif kind == 2:
        wo = 3.0 * pole
        miss = y - c[3]
        c[3] += ts * (c[4] + 3 * wo * miss)
        c[4] += ts * (c[5] + c[6] / inertia + 3 * wo * wo * miss)
        c[5] += ts * wo**3 * miss
        law = pole * pole * (r[0] - c[3]) + 2 * zeta * pole * (r[1] - c[4])
        push = 0.0
        force = g[7] + inertia * (r[2] * g[3] + law - c[5])
    else:
        push = c[2] + g[10] * pole**3 * error * ts
        law = pole * pole * error + 2 * zeta * pole * (r[1] - c[1])
        force = feed + inertia * (law + push)
        if kind == 3:
            force += g[4] * (c[1] - r[1])
    if abs(force) < limit:
        c[2] = push
    force = max(-limit, min(limit, force))
    c[6] = force - g[7]
    return float(force)


@compiled
def _run(
    step: Any,
    model: int,
    data: int,
    views: tuple[Array, ...],
    body_mass: Array,
    reference: Array,
    noise: Array,
    codes: tuple[int, ...],
    numbers: tuple[float, ...],
    p: Array,
    coulomb: Array,
    viscous: Array,
    gains: Array,
) -> tuple[Array, Array]:
    """Return the measured position and the force asked for, over the whole programme."""
    qpos, qvel, ctrl, applied, friction, damping = views
    code, shape, encoder, law, substeps, delay, payload, when = codes
    h, width, resolution, offset, new_mass = numbers
    n = reference.shape[0]
    position, asked = np.empty(n), np.empty(n)
    c, memory = np.zeros(_STATES), np.zeros((2, _STATES))
    c[0] = c[3] = reference[0, 0]
    memory[0, :5] = gains[7]
    if code == HYSTERESIS and p[2] == 0:
        memory[0, 0] = 0.0
    if code == PRESLIDING:
        memory[:] = 0.0
    for k in range(n):
        true = qpos[encoder]
        seen = true + noise[k, 0] + (p[0] * _wave(p, true) if code == ENCODER else 0.0)
        position[k] = np.round(seen / resolution) * resolution
        asked[k] = _control(law, gains, position[k], reference[k], substeps * h, c)
        sent = asked[k - delay] if k >= delay else gains[7]
        if k == when:
            body_mass[payload] = new_mass
        if ctrl.size > 1:
            ctrl[1] = noise[k, 2]
        for i in range(substeps):
            t = (k * substeps + i) * h
            force = _drive(code, p, sent, qvel[0], qpos[0], memory[0])
            ctrl[0] = force
            for j in range(coulomb.size):
                v = qvel[j]
                level = _level(code, p, coulomb[j], qpos[j], v, t, force)
                applied[j] = 0.0
                if code == PRESLIDING:
                    applied[j] = _memory_friction(p, level, v, h, memory[j])
                elif shape == 0:
                    friction[j] = max(level, 0.0)
                else:  # MuJoCo's Euler takes damping implicitly: friction as slope + rest
                    value, slope = shaped(shape, v, width)
                    damping[j] = viscous[j] + level * slope
                    applied[j] = level * (slope * v - value)
            applied[0] += offset + noise[k, 1] + _extra(code, p, qpos[0], qvel[0])
            step(model, data)
    return position, asked


def run(
    model: Any,
    reference: Array,
    noise: Array,
    codes: tuple[int, ...],
    numbers: tuple[float, ...],
    p: Array,
    coulomb: Array,
    viscous: Array,
    gains: Array,
    start: Array,
) -> tuple[Array, Array]:
    """Return the measured position and the force asked for.

    noise: columns position, force and the second actuator's set value; codes: effect, shape,
    encoder's degree of freedom, controller, steps per sample, delay, body of the payload, sample
    of its change; numbers: step in s, friction's width, encoder step, offset, new payload mass;
    start: positions, then speeds, of all degrees of freedom.
    """
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = start[: model.nq], start[model.nq :]
    model.dof_damping[: viscous.size] = viscous
    views = (
        data.qpos,
        data.qvel,
        data.ctrl,
        data.qfrc_applied,
        model.dof_frictionloss,
        model.dof_damping,
    )
    if model.na:
        data.act[0] = gains[7]
    result: tuple[Array, Array] = _run(
        _STEP,
        model._address,
        data._address,
        views,
        model.body_mass,
        reference,
        noise,
        codes,
        numbers,
        p,
        coulomb,
        viscous,
        gains,
    )
    return result
