"""Motion programmes and sampled controllers for the axes of scipy_machines (integrator: scipy).

The programmes are what an axis is asked to do: S-curve, quintic and cycloidal strokes, rasters,
random set points, multi-sines, slow creeping, rests. The controllers are what runs in the drive,
once per sample, in force units: P-PI cascade, PID with feed-forward, state feedback with an
extended (disturbance) observer, computed torque with a momentum observer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar, cast

import numba
import numpy as np
from scipy.signal import lfilter

from motorctl_benchmarks.other_machines.machine_recording import Array

Function = TypeVar("Function", bound=Callable[..., Any])

STYLES = ("points", "raster", "set points", "multi-sine", "mixed")
LAWS = ("P-PI cascade", "PID + feed-forward", "state feedback + observer", "computed torque + DOB")


def jit(function: Function) -> Function:
    """Return the function compiled by numba, cached on disk."""
    compiled: Any = numba.njit(cache=True, error_model="numpy")(function)
    return cast("Function", compiled)


@dataclass(frozen=True)
class Limits:
    """What a programme may use: a range of positions, top speed, top acceleration."""

    low_m: float
    high_m: float
    speed_m_s: float
    acceleration_m_s2: float

    @property
    def travel_m(self) -> float:
        """Return the length of the range."""
        return self.high_m - self.low_m


@dataclass(frozen=True)
class Programme:
    """Desired motion, and a force that the operator injects (N per N of rms force)."""

    style: str
    position_m: Array
    speed_m_s: Array
    acceleration_m_s2: Array
    injection: Array


def stroke(distance_m: float, speed: float, acceleration: float, profile: int, h: float) -> Array:
    """Return positions of one stroke from rest to rest, starting at zero.

    Parameters
    ----------
    distance_m
        Signed length.
    speed, acceleration
        Limits, m/s and m/s^2.
    profile
        0 and 1: trapezoid of speed rounded over a jerk time; 2: quintic; 3: cycloid.
    h
        Sample period, s.
    """
    length = abs(distance_m)
    if length < 1e-9:
        return np.zeros(1)
    if profile >= 2:
        peak_v, peak_a = (1.875, 5.7735) if profile == 2 else (2.0, 2.0 * np.pi)
        duration = max(peak_v * length / speed, np.sqrt(peak_a * length / acceleration), 8 * h)
        n = int(np.ceil(duration / h))
        s = np.arange(1, n + 1) / n
        if profile == 2:
            return np.asarray(distance_m * s**3 * (10.0 - 15.0 * s + 6.0 * s**2))
        return np.asarray(distance_m * (s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi)))
    v = min(speed, np.sqrt(length * acceleration))
    n_ramp = max(2, round(v / acceleration / h))
    n_flat = max(0, round((length / v - v / acceleration) / h))
    n_jerk = max(2, round(n_ramp * (0.25 if profile == 0 else 0.6)))
    a = np.concatenate([np.ones(n_ramp), np.zeros(n_flat), -np.ones(n_ramp)])
    a = np.convolve(a, np.ones(n_jerk) / n_jerk)
    x = np.cumsum(np.cumsum(a))
    return np.asarray(distance_m * x / x[-1])


def sines(rng: np.random.Generator, limits: Limits, start_m: float, n: int, h: float) -> Array:
    """Return a windowed multi-sine that begins and ends at rest at start_m."""
    t = np.arange(n) * h
    top_hz = np.clip(limits.acceleration_m_s2 / limits.speed_m_s, 1.5, 8.0)
    hz = np.exp(rng.uniform(np.log(0.25), np.log(top_hz), int(rng.integers(4, 9))))
    x = np.zeros(n)
    for f in hz:
        x += np.sin(2.0 * np.pi * f * t + rng.uniform(0.0, 6.28)) / f ** rng.uniform(0.7, 1.3)
    window = np.clip(np.minimum(t, t[-1] - t) / min(0.8, 0.25 * t[-1]), 0.0, 1.0)
    x *= window**3 * (10.0 - 15.0 * window + 6.0 * window**2)
    v = np.gradient(x, h)
    reach = min(start_m - limits.low_m, limits.high_m - start_m)
    scale = min(
        0.95 * reach / np.abs(x).max(),
        limits.speed_m_s / np.abs(v).max(),
        limits.acceleration_m_s2 / np.abs(np.gradient(v, h)).max(),
    )
    return np.asarray(start_m + scale * x)


def set_points(rng: np.random.Generator, limits: Limits, start_m: float, n: int, h: float) -> Array:
    """Return random set points that a critically damped filter of third order smooths."""
    steps = np.full(n, start_m)
    k = 0
    while k < n - int(1.6 / h):  # the last one settles
        span = int(rng.uniform(0.3, 1.1) / h)
        steps[k:] = rng.uniform(limits.low_m, limits.high_m)
        k += span
    pole = np.exp(-h * rng.uniform(15.0, 45.0))
    x = steps - start_m
    for _ in range(3):
        x = lfilter([1.0 - pole], [1.0, -pole], x)
    v = np.gradient(x, h)
    peak_v, peak_a = np.abs(v).max(), np.abs(np.gradient(v, h)).max()
    scale = min(1.0, limits.speed_m_s / peak_v, 1.3 * limits.acceleration_m_s2 / peak_a)
    return np.asarray(start_m + scale * x)


def programme(
    rng: np.random.Generator, limits: Limits, n: int, h: float, injects: bool, least_rest_s: float
) -> Programme:
    """Return a random programme of n samples that visits the range at many speeds, with rests.

    Parameters
    ----------
    rng
        Source of randomness.
    limits
        Range, speed and acceleration.
    n, h
        Samples, and their period in s.
    injects
        Whether a multi-sine of force (commissioning) is added for a part of the time.
    least_rest_s
        Shortest rest between two strokes.
    """
    style = STYLES[int(rng.integers(len(STYLES)))]
    profile = int(rng.integers(4))
    here = rng.uniform(limits.low_m, limits.high_m)
    parts: list[Array] = []
    total = 0

    def add(x: Array) -> None:
        nonlocal here, total
        parts.append(x)
        total += x.size
        here = float(x[-1])

    def rest(shortest: float, longest: float) -> None:
        span = rng.uniform(max(shortest, least_rest_s), max(longest, least_rest_s + 0.05))
        add(np.full(max(2, int(span / h)), here))

    def go(target: float, speed: float, acceleration: float = 1.0) -> None:
        shape = profile if rng.random() < 0.8 else int(rng.integers(4))
        add(here + stroke(target - here, speed, acceleration * limits.acceleration_m_s2, shape, h))

    top, low, high = limits.speed_m_s, limits.low_m, limits.high_m
    rest(0.3, 0.6)
    go(low, top)
    rest(0.1, 0.3)
    sweep = max(0.15 * top, limits.travel_m / 1.2)
    go(high, min(top, sweep))
    rest(0.05, 0.3)
    go(low, min(top, 1.3 * sweep))
    rest(0.05, 0.3)
    weights = np.array([0.55, 0.12, 0.12, 0.12, 0.09])  # strokes, creep, raster, set points, sines
    if style != "points":
        weights[{"raster": 2, "set points": 3, "multi-sine": 4}.get(style, 1)] += 0.7
    while total < n:
        choice = int(rng.choice(5, p=weights / weights.sum()))
        if choice == 0:
            for _ in range(int(rng.integers(2, 6))):
                speed = top * np.exp(rng.uniform(np.log(0.25), 0.0))
                target = rng.uniform(low, high) if rng.random() < 0.6 else (low, high)[_ % 2]
                go(target, speed, rng.uniform(0.4, 1.0))
                rest(0.0, 0.35)
        elif choice == 1:
            speed = top * np.exp(rng.uniform(np.log(0.01), np.log(0.12)))
            reach = speed * rng.uniform(0.5, 1.2)
            side = 1.0 if here < 0.5 * (low + high) else -1.0
            go(float(np.clip(here + side * reach, low, high)), speed, 0.3)
            rest(0.1, 0.4)
            go(float(np.clip(here - side * reach * rng.uniform(0.5, 1.0), low, high)), speed, 0.3)
            rest(0.1, 0.4)
        elif choice == 2:
            width = limits.travel_m * rng.uniform(0.2, 0.9)
            left = rng.uniform(low, high - width)
            slow = min(top, max(width / 1.5, top * rng.uniform(0.05, 0.3)))
            go(left, top)
            for _ in range(int(rng.integers(2, 6))):
                go(left + width, slow)
                rest(0.0, 0.1)
                go(left, top * rng.uniform(0.6, 1.0))
                rest(0.0, 0.1)
        else:
            make = set_points if choice == 3 else sines
            if choice == 4:
                go(rng.uniform(0.6 * low + 0.4 * high, 0.4 * low + 0.6 * high), top)
            add(make(rng, limits, here, int(rng.uniform(3.0, 6.0) / h), h))
            if choice == 3:
                add(np.full(max(2, int(0.3 / h)), here))
    x = np.concatenate(parts)[:n]
    v = np.gradient(x, h)
    injection = np.zeros(n)
    if injects:
        t = np.arange(n) * h
        for f in np.exp(rng.uniform(np.log(6.0), np.log(min(70.0, 0.08 / h)), 10)):
            injection += np.sqrt(0.2) * np.sin(2.0 * np.pi * f * t + rng.uniform(0.0, 6.28))
        begin = rng.uniform(0.05, 0.3) * n * h
        end = begin + rng.uniform(0.45, 0.7) * n * h
        injection *= np.clip(np.minimum(t - begin, end - t) / 0.5, 0.0, 1.0)
    return Programme(style, x, v, np.gradient(v, h), injection)


# Indices into the array of a controller's gains.
LAW, H, KP, KD, KI, M_FF, B_FF, C_FF, W_FF, ALPHA, K1, K2, L1, L2, L3, F_MAX, V_FF = range(17)
# Indices into the array of its memory.
Q_OLD, V_HAT, INTEGRAL, X_OBS, V_OBS, D_OBS, F_OLD = range(7)


def gains(
    rng: np.random.Generator,
    law: int,
    h: float,
    bandwidth_rad_s: float,
    model: tuple[float, float, float, float],
    force_limit_n: float,
) -> Array:
    """Return the gains of a controller.

    Parameters
    ----------
    rng
        Source of the tuner's taste.
    law
        Index into LAWS.
    h
        Sample period, s.
    bandwidth_rad_s
        Of the position loop.
    model
        Mass, viscous and Coulomb friction, and speed over which the latter turns: what the tuner
        believes.
    force_limit_n
        The drive clips there.
    """
    w = bandwidth_rad_s
    mass, viscous, coulomb, turn_m_s = model
    zeta, w_i = rng.uniform(0.7, 1.1), w * rng.uniform(0.1, 0.4)
    fraction = float(rng.choice([0.0, 1.0, 1.0])) if w > 25.0 else 1.0
    fraction *= rng.uniform(0.85, 1.05)
    g = np.zeros(17)
    g[[LAW, H, F_MAX]] = law, h, force_limit_n
    g[ALPHA] = 1.0 - np.exp(-h * w * rng.uniform(4.5, 6.5))
    if law == 0:
        w_v = w * rng.uniform(2.4, 3.4)
        g[[KP, KD, KI, M_FF, V_FF]] = w, mass * w_v, mass * w_v * w_i, fraction * mass, fraction
    else:
        g[KP], g[KD] = mass * (w * w + 2.0 * zeta * w * w_i), mass * (2.0 * zeta * w + w_i)
        g[KI] = mass * w * w * w_i
        g[[M_FF, B_FF, C_FF, W_FF]] = mass, viscous, coulomb * rng.uniform(0.0, 0.9), turn_m_s
        g[[K1, K2]] = w * w, 2.0 * zeta * w
    if law == 2:
        z = np.exp(-h * w * rng.uniform(3.0, 4.5))
        g[[L1, L2]] = 1.0 - z**3, 1.5 * (1.0 - z) ** 2 * (1.0 + z) / h
        g[L3] = mass * (1.0 - z) ** 3 / h**2
    if law == 3:
        g[L3] = w * rng.uniform(0.5, 1.2)
    return g


@jit
def control(
    g: Array, s: Array, xr: float, vr: float, ar: float, q: float, qm: float, injected: float
) -> float:
    """Return the force asked in this sample, and update the controller's memory s.

    Parameters
    ----------
    g, s
        Gains and memory.
    xr, vr, ar
        Reference.
    q, qm
        Measured position, and that of the encoder that the speed loop uses.
    injected
        Force that the operator adds.
    """
    h, m = g[H], g[M_FF]
    s[V_HAT] += g[ALPHA] * ((qm - s[Q_OLD]) / h - s[V_HAT])
    s[Q_OLD] = qm
    e, v = xr - q, s[V_HAT]
    law = int(g[LAW])
    grow = 0.0
    if law == 0:
        ev = g[V_FF] * vr + g[KP] * e - v
        f = g[KD] * ev + s[INTEGRAL] + m * ar
        grow = g[KI] * h * ev
    elif law == 1:
        f = g[KP] * e + g[KD] * (vr - v) + s[INTEGRAL]
        f += m * ar + g[B_FF] * vr + g[C_FF] * np.tanh(vr / g[W_FF])
        grow = g[KI] * h * e
    elif law == 2:
        acceleration = (s[F_OLD] + s[D_OBS]) / m
        x_obs = s[X_OBS] + h * s[V_OBS] + 0.5 * h * h * acceleration
        gap = q - x_obs
        s[X_OBS] = x_obs + g[L1] * gap
        s[V_OBS] += h * acceleration + g[L2] * gap
        s[D_OBS] += g[L3] * gap
        f = m * (ar + g[K1] * (xr - s[X_OBS]) + g[K2] * (vr - s[V_OBS])) - s[D_OBS]
    else:
        s[D_OBS] = g[L3] * (m * v - s[INTEGRAL])
        f = m * (ar + g[K1] * e + g[K2] * (vr - v)) - s[D_OBS]
    f += injected
    limited = min(max(f, -g[F_MAX]), g[F_MAX])
    if law < 2 and (limited == f or grow * f < 0.0):
        s[INTEGRAL] += grow
    if law == 3:
        s[INTEGRAL] += h * (limited + s[D_OBS])
    s[F_OLD] = limited
    return float(limited)


def first_memory(g: Array, position_m: float, holding_n: float) -> Array:
    """Return the memory of a controller that has held the axis at rest for long."""
    s = np.zeros(7)
    s[[Q_OLD, X_OBS, F_OLD]] = position_m, position_m, holding_n
    s[D_OBS] = -holding_n
    s[INTEGRAL] = holding_n if g[LAW] < 2 else (holding_n / g[L3] if g[LAW] == 3 else 0.0)
    return s
