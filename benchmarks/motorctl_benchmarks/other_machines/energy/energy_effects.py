"""Effects of the energy generator: what each one's numbers mean, and how large it may be."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from motorctl_benchmarks.other_machines.energy.energy_families import Frame, log_uniform
from motorctl_benchmarks.other_machines.energy.energy_integrator import Effect, Extra, Train

RIGID = Train(False, 1.0, 0.0, 0.0, 0.0, 0.0, False)


class Draw(NamedTuple):
    """An effect with the range of its size; two bodies where `train` says so."""

    extra: Extra
    low: float
    high: float
    train: Train = RIGID


def draw_effect(rng: np.random.Generator, effect: Effect, frame: Frame) -> Draw:
    """Return the effect with a first guess of its size, and the range that stays plausible."""
    axis, travel, speed, peak = frame.axis, frame.travel, frame.speed, frame.peak
    phase = rng.uniform(0.0, 2.0 * np.pi)
    middle = rng.uniform(-0.25, 0.25) * travel
    second = rng.uniform(0.0, 0.4)
    mode, side = int(rng.integers(3)), float(rng.choice([-1.0, 1.0]))
    pitch = max(travel / log_uniform(rng, 6.0, 45.0), 12.0 * speed * frame.period)
    amperes, fine = peak / axis.force_constant, frame.resolution

    def draw(
        size: float,
        low: float,
        high: float,
        scale: float = 1.0,
        place: float = 0.0,
        second: float = 0.0,
        train: Train = RIGID,
    ) -> Draw:
        return Draw(Extra(int(effect), size, scale, place, second, mode), low, high, train)

    match effect:
        case Effect.GRAVITY_CONSTANT | Effect.GRAVITY_SINE:
            return draw(0.1 * peak, 0.02 * peak, 0.6 * peak, place=phase)
        case Effect.COGGING:
            return draw(0.05 * peak, 0.005 * peak, 0.4 * peak, pitch, phase, second)
        case Effect.FORCE_RIPPLE:
            return draw(0.15, 0.03, 0.5, pitch, phase, second)
        case Effect.CURRENT_SATURATION:  # 1 / command at the knee
            return draw(1.0 / amperes, 0.3 / amperes, 2.5 / amperes, second=rng.uniform(0.3, 0.6))
        case Effect.COMMAND_LAG:  # time constant
            return draw(1.5e-3, 1.0 / (600.0 * np.pi), 1.0 / (60.0 * np.pi))
        case Effect.COMMAND_DELAY:  # samples
            return draw(3.0, 1.0, 8.0)
        case Effect.VOLTAGE_CLIPPING:  # 1 / command at standstill; scale: no-load speed
            return draw(0.9 / amperes, 0.4 / amperes, 2.2 / amperes, rng.uniform(1.1, 1.5) * speed)
        case Effect.STRIBECK:
            wide = max(3.0 * axis.width, rng.uniform(0.02, 0.12) * speed)
            return draw(0.8, 0.15, 2.5, wide, second=rng.uniform(1.0, 2.0))
        case Effect.ASYMMETRIC_FRICTION:
            return draw(0.4 * side, 0.08 * side, 0.85 * side)
        case Effect.QUADRATIC_DRAG:
            return draw(0.3 * peak / speed**2, 0.05 * peak / speed**2, 2.5 * peak / speed**2)
        case Effect.PRESLIDING:
            return draw(0.005 * travel, max(3e-4 * travel, 4.0 * fine), 0.05 * travel)
        case Effect.LOAD_FRICTION:
            return draw(0.25, 0.05, 0.7, second=rng.uniform(0.4, 0.8))
        case Effect.WARMING_FRICTION:  # scale: seconds, or the way rubbed
            tau = rng.uniform(0.2, 0.6) * frame.duration
            return draw(1.0, 0.25, 4.0, tau * (0.35 * speed if mode == 1 else 1.0))
        case Effect.POSITION_FRICTION:
            scale = (
                travel
                * (rng.uniform(0.05, 0.15), rng.uniform(0.02, 0.25), rng.uniform(0.25, 0.7))[mode]
            )
            return draw(0.7, 0.2, 4.0 if mode == 0 else 0.95, scale, middle)
        case (
            Effect.BACKLASH_MOTOR
            | Effect.BACKLASH_LOAD
            | Effect.FLEXIBLE_MOTOR
            | Effect.FLEXIBLE_LOAD
        ):
            share = rng.uniform(0.3, 0.7)
            loaded = effect in (Effect.BACKLASH_LOAD, Effect.FLEXIBLE_LOAD)
            bodies = Train(True, share, rng.uniform(0.2, 0.7), 0.0, 0.0, 0.0, loaded)
            if effect in (Effect.FLEXIBLE_MOTOR, Effect.FLEXIBLE_LOAD):  # size: 1 / hertz
                bodies = bodies._replace(damping=rng.uniform(0.02, 0.08))
                return draw(1.0 / 18.0, 1.0 / 60.0, 1.0 / 4.0, train=bodies)
            reduced = axis.mass * share * (1.0 - share)
            stiffness = (2.0 * np.pi * rng.uniform(50.0, 150.0)) ** 2 * reduced
            damping = 2.0 * rng.uniform(0.2, 0.6) * np.sqrt(stiffness * reduced)
            bodies = bodies._replace(stiffness=stiffness, damping=damping)
            return draw(0.004 * travel, max(3e-4 * travel, 4.0 * fine), 0.03 * travel, train=bodies)
        case Effect.MEASUREMENT_RIPPLE:
            pitch = travel / rng.uniform(2.5, 20.0)
            low = max(1e-4 * pitch, 1.5 * fine)
            return draw(1e-3 * pitch, low, 0.04 * pitch, pitch, phase, second)
        case Effect.PAYLOAD_STEP:
            side *= 1.0 if side > 0.0 else 0.6
            return draw(0.5 * side, 0.1 * side, side, rng.uniform(0.3, 0.7) * frame.duration)
        case Effect.POSITION_FORCE:
            scale = travel * rng.uniform(0.35, 0.6)
            return draw(0.2 * peak, 0.02 * peak, 0.8 * peak, scale, middle)
        case Effect.HARD_STOP:
            stiff = peak / travel
            return draw(
                5.0 * stiff,
                0.8 * stiff,
                40.0 * stiff,
                speed * rng.uniform(2.0, 6.0),
                side * rng.uniform(0.3, 0.42) * travel,
                side,
            )
        case Effect.DRIVE_HYSTERESIS:
            return draw(0.4, 0.1, 0.95, amperes * rng.uniform(0.15, 0.4))
        case Effect.EDDY_BRAKE:
            return draw(0.3 * peak, 0.05 * peak, 2.0 * peak, rng.uniform(0.08, 0.3) * speed)
        case Effect.UNKNOWN_BUS_SAG:  # place: command of full sag
            return draw(
                0.3, 0.08, 0.6, log_uniform(rng, 0.15, 1.0), amperes * rng.uniform(0.5, 0.8)
            )
        case Effect.UNKNOWN_SHAKER:  # scale: hertz; second: share of the turn
            return draw(
                0.1 * peak,
                0.01 * peak,
                0.5 * peak,
                log_uniform(rng, 0.6, 9.0),
                second=rng.uniform(0.15, 0.4),
            )
        case Effect.UNKNOWN_LATE_BRAKE:
            return draw(0.3 * peak, 0.04 * peak, 0.9 * peak, log_uniform(rng, 0.08, 0.4))
        case Effect.UNKNOWN_STALE_GREASE:  # scale: way that clears; place: time that sets
            return draw(
                0.3 * peak,
                0.04 * peak,
                0.8 * peak,
                rng.uniform(0.02, 0.1) * travel,
                rng.uniform(0.2, 0.8),
                0.003 * speed,
            )
        case Effect.UNKNOWN_TELEGRAM_LOSS:  # losses per second; scale: how long one holds
            return draw(3.0, 1.0, 20.0, max(rng.uniform(0.01, 0.03), 4.0 * frame.period))
        case Effect.UNKNOWN_RELAXING_DAMPER:
            return draw(
                peak / speed, 0.1 * peak / speed, 4.0 * peak / speed, log_uniform(rng, 0.05, 0.4)
            )
        case _:
            return draw(0.0, 0.0, 0.0)
