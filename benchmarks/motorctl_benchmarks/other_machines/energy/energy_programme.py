"""Motion programmes of the energy generator: moves, multi-sines, set points and rasters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from motorctl_benchmarks.other_machines.energy.energy_families import Frame, log_uniform

Array = NDArray[np.float64]


def _ramp(
    distance: float, speed: float, acceleration: float, round_share: float, period: float
) -> Array:
    """Return the increments of an S-curve: a box of speed, smoothed by two boxes."""
    speed = min(speed, np.sqrt(abs(distance) * acceleration) + 1e-12)
    counts = [
        max(1, round(s / period))
        for s in (abs(distance) / speed, speed / acceleration, round_share * speed / acceleration)
    ]
    flow = np.full(counts[0], distance / counts[0])
    for count in counts[1:]:
        flow = np.convolve(flow, np.full(count, 1.0 / count))
    return flow


def _quintic(distance: float, speed: float, acceleration: float, period: float) -> Array:
    """Return the increments of a fifth-order move."""
    span = max(1.875 * abs(distance) / speed, np.sqrt(5.774 * abs(distance) / acceleration))
    s = np.linspace(0.0, 1.0, max(3, round(span / period)) + 1)
    return np.asarray(np.diff(distance * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)))


def _sines(rng: np.random.Generator, frame: Frame) -> Array:
    """Return the increments of a multi-sine that swells and fades, 4 to 8 s long."""
    t = np.arange(0.0, rng.uniform(5.0, 9.0), frame.period)
    fade = np.clip(np.minimum(t, t[-1] - t), 0.0, 1.0)
    top = 0.9 * frame.acceleration / frame.speed / (2.0 * np.pi)
    waves = np.zeros_like(t)
    for frequency in np.geomspace(
        rng.uniform(0.12, 0.25), rng.uniform(1.0, 1.8) * top, int(rng.integers(4, 8))
    ):
        waves += np.sin(2.0 * np.pi * frequency * t + rng.uniform(0.0, 6.28)) / frequency
    waves *= fade**3 * (10.0 - 15.0 * fade + 6.0 * fade**2)
    speeds = np.diff(waves) / frame.period
    rises = np.diff(speeds) / frame.period
    scale = min(
        0.47 * frame.travel / np.abs(waves).max(),
        frame.speed / np.abs(speeds).max(),
        frame.acceleration / np.abs(rises).max(),
    )
    return np.asarray(scale * np.diff(waves))


def _steps(rng: np.random.Generator, frame: Frame, place: float) -> Array:
    """Return the increments of random set points through four running means."""
    tau = frame.speed / frame.acceleration * rng.uniform(0.5, 1.0)
    goals = rng.uniform(-0.48, 0.48, int(rng.integers(5, 10))) * frame.travel
    hold = np.concatenate(
        [np.full(round(rng.uniform(2.0, 10.0) * tau / frame.period), goal) for goal in goals]
    )
    flow = np.diff(hold, prepend=place)
    for _ in range(4):
        flow = np.convolve(flow, np.full(count := round(1.7 * tau / frame.period), 1.0 / count))
    rises = np.abs(np.diff(flow)).max() / frame.period**2
    scale = min(1.0, frame.speed * frame.period / np.abs(flow).max(), frame.acceleration / rises)
    return np.asarray(flow * scale)


def draw_programme(
    rng: np.random.Generator, frame: Frame, styles: tuple[int, ...]
) -> tuple[Array, str]:
    """Return (N, 3) reference, velocity and acceleration, and the programme's name."""
    names = ("S-curves", "quintic moves", "multi-sine", "random set points", "raster")
    main = int(rng.choice(styles))
    total = round(frame.duration / frame.period)
    start = rng.uniform(-0.3, 0.3) * frame.travel
    flows: list[Array] = [np.zeros(round(rng.uniform(0.3, 0.8) / frame.period))]
    place, count, done = start, 0, len(flows[0])
    curve = rng.uniform(0.3, 1.0)
    slow = frame.travel / rng.uniform(2.5, 4.0)

    def add(flow: Array) -> None:
        nonlocal place, done
        flows.append(flow)
        place += float(flow.sum())
        done += len(flow)

    def go(goal: float, speed: float, rise: float = 1.0) -> None:
        add(_ramp(goal - place, speed, rise * frame.acceleration, curve, frame.period))

    while done < total:
        style = main if rng.random() < 0.75 else int(rng.integers(5))
        if count < 2:  # once slowly through the whole travel and back
            go((0.48 - 0.96 * count) * frame.travel, slow)
        elif style < 2:
            goal = rng.uniform(-0.48, 0.48) * frame.travel
            speed = log_uniform(rng, 0.25, 1.0) * frame.speed
            rise = frame.acceleration * rng.uniform(0.5, 1.0)
            short = abs(goal - place) < 0.01 * frame.travel
            if style == 0:
                go(goal, speed, rise / frame.acceleration) if not short else None
            else:
                add(_quintic(goal - place, speed, rise, frame.period))
        elif style == 2:
            go(0.0, 0.5 * frame.speed, 0.5)
            add(_sines(rng, frame))
        elif style == 3:
            add(_steps(rng, frame, place))
        else:
            low, high = (np.sort(rng.uniform(-0.48, 0.48, 2)) * frame.travel).tolist()
            for _ in range(int(rng.integers(2, 4))):
                speed = rng.uniform(0.15, 0.7) * frame.speed
                go(high, max(speed, (high - low) / 3.0))
                go(low, float(rng.choice([frame.speed, speed])))
                low = min(low + 0.05 * frame.travel, high)
        add(
            np.zeros(
                round(
                    (rng.uniform(0.6, 1.6) if len(styles) == 2 else rng.uniform(0.05, 0.6))
                    / frame.period
                )
            )
        )
        count += 1
    position = start + np.cumsum(np.concatenate(flows))[:total]
    velocity = np.concatenate(flows)[:total] / frame.period
    bend = np.gradient(velocity) / frame.period
    return np.ascontiguousarray(np.stack([position, velocity, bend], axis=1)), names[main]
