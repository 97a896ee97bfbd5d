"""Port-Hamiltonian axis in numba: Moreau's midpoint scheme, friction as its dissipation's prox.

The machine is one body, or two with a spring and a gap between them. Each step drifts half, kicks,
and drifts half (Stoermer-Verlet on the energy's part); viscous loss is the implicit midpoint's; and
Coulomb friction is solved at the new velocity, exactly (set-valued sign) or by its smooth shape.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Function = TypeVar("Function", bound=Callable[..., Any])

SHAPES = ("sign", "tanh", "arctan", "algebraic", "clipped")
PLAYS = 5
"""Play operators of the hysteresis, and elements of the Maxwell slip."""


Effect = IntEnum(
    "Effect",
    (
        "NONE GRAVITY_CONSTANT GRAVITY_SINE COGGING FORCE_RIPPLE CURRENT_SATURATION COMMAND_LAG "
        "COMMAND_DELAY VOLTAGE_CLIPPING STRIBECK ASYMMETRIC_FRICTION QUADRATIC_DRAG PRESLIDING "
        "LOAD_FRICTION WARMING_FRICTION POSITION_FRICTION BACKLASH_MOTOR BACKLASH_LOAD "
        "FLEXIBLE_MOTOR FLEXIBLE_LOAD MEASUREMENT_RIPPLE PAYLOAD_STEP POSITION_FORCE HARD_STOP "
        "DRIVE_HYSTERESIS EDDY_BRAKE UNKNOWN_BUS_SAG UNKNOWN_SHAKER UNKNOWN_LATE_BRAKE "
        "UNKNOWN_STALE_GREASE UNKNOWN_TELEGRAM_LOSS UNKNOWN_RELAXING_DAMPER"
    ),
    start=0,
)
"""What the machine has beyond the basics."""


class Axis(NamedTuple):
    """The basics: SI units, of m or rad; the command's unit is the drive's."""

    mass: float
    viscous: float
    coulomb: float
    offset: float
    shape: int
    """Index into SHAPES."""
    width: float
    """Velocity scale of a smooth shape."""
    force_constant: float
    """Force per command."""


class Extra(NamedTuple):
    """The effect; what size, scale, place and second mean, is told where it is drawn."""

    effect: int
    size: float
    scale: float
    place: float
    second: float
    mode: int


class Train(NamedTuple):
    """Motor and load, where they are two bodies."""

    two_bodies: bool
    motor_share: float
    """Of the mass."""
    load_friction_share: float
    """Of Coulomb and viscous friction."""
    stiffness: float
    damping: float
    gap: float
    """Whole free play."""
    encoder_on_load: bool

    def sized(self, size: float, mass: float) -> Train:
        """Return the train with the gap (where it has its spring), or with the spring of 1 / Hz."""
        if not self.two_bodies:
            return self
        if self.stiffness > 0.0:
            return self._replace(gap=size)
        reduced = mass * self.motor_share * (1.0 - self.motor_share)
        turn = 2.0 * np.pi / size
        return self._replace(
            stiffness=turn * turn * reduced, damping=2.0 * self.damping * turn * reduced
        )


class Loop(NamedTuple):
    """The controller: 0 cascade, 1 PID, 2 state observer, 3 computed torque, 4 sliding layer."""

    mode: int
    mass: float
    viscous: float
    coulomb: float
    """What feedforward believes."""
    feedforward: float
    """Share of the inertia that is fed forward."""
    bandwidth: float
    """rad/s"""
    filter: float
    """Of the measured velocity, or of the observer, rad/s."""
    integral: float
    """Share of the usual integral action."""
    deadband: float
    """Position error which the integrator leaves alone at rest."""
    limit: float
    """Of the force asked."""
    slow: float
    """Speed over which the believed Coulomb force changes its sign."""


def compiled(function: Function) -> Function:
    """Return the function compiled, with its type kept."""
    return cast(Function, njit(cache=True)(function))


@compiled
def friction_shape(y: float, shape: int) -> float:
    """Return the smooth friction shape at y = velocity / width, in [-1, 1]."""
    if shape == 1:
        return float(np.tanh(y))
    if shape == 2:
        return float(2.0 / np.pi * np.arctan(0.5 * np.pi * y))
    if shape == 3:
        return float(y / np.sqrt(1.0 + y * y))
    return min(1.0, max(-1.0, y))


@compiled
def after_friction(free: float, drop: float, width: float, shape: int) -> float:
    """Return v with v + drop * shape(v / width) = free: the prox of the dissipation potential."""
    if drop <= 0.0:
        return free
    if shape == 0:
        return free - min(drop, max(-drop, free))
    low, high = 0.0, abs(free)
    v = min(high, max(high - drop, high * width / (width + drop)))
    for _ in range(60):
        error = v + drop * friction_shape(v / width, shape) - abs(free)
        if abs(error) < 1e-13 + 1e-10 * width:
            break
        if error > 0.0:
            high = v
        else:
            low = v
        step = 1e-5 * width
        slope = (
            1.0
            + drop
            * (friction_shape((v + step) / width, shape) - friction_shape(v / width, shape))
            / step
        )
        v -= error / slope
        if v <= low or v >= high:
            v = 0.5 * (low + high)
    return v if free > 0.0 else -v


@compiled
def force_asked(loop: Loop, goal: Array, y: float, period: float, state: Array) -> float:
    """Return the force which the controller asks; state is its memory."""
    w = loop.bandwidth
    if loop.mode == 2:  # position, velocity and disturbing acceleration are observed
        a = state[5] / loop.mass + state[4]
        state[3] += period * state[0] + 0.5 * period * period * a
        state[0] += period * a
        p = np.exp(-loop.filter * period)
        miss = y - state[3]
        state[3] += (1.0 - p**3) * miss
        state[0] += 1.5 * (1.0 - p) ** 2 * (1.0 + p) / period * miss
        state[4] += (1.0 - p) ** 3 / period**2 * miss
        ask = w * w * (goal[0] - state[3]) + 2.0 * w * (goal[1] - state[0]) - state[4]
        force = loop.mass * (loop.feedforward * goal[2] + ask)
        state[5] = min(loop.limit, max(-loop.limit, force))
        return float(state[5])
    blend = 1.0 - np.exp(-loop.filter * period)
    state[0] += blend * ((y - state[1]) / period - state[0])
    state[1] = y
    e = goal[0] - y
    de = goal[1] - state[0]
    force = loop.feedforward * loop.mass * goal[2]
    grow = e
    if loop.mode == 0:
        grow = 2.0 * (de / w + 0.5 * e)
        force += loop.mass * w * (2.0 * de + w * e)
    elif loop.mode == 1:
        force += loop.mass * w * (2.0 * de + w * e)
        force += loop.viscous * goal[1] + loop.coulomb * np.tanh(goal[1] / loop.slow)
    elif loop.mode == 3:
        force += loop.mass * w * (1.6 * de + w * e)
        force += loop.viscous * state[0] + loop.coulomb * np.tanh(goal[1] / loop.slow)
    else:
        force += loop.mass * w * de + loop.viscous * goal[1]
        reach = 0.5 * loop.limit
        force += reach * min(1.0, max(-1.0, loop.mass * w * (de + w * e) / reach))
    if (goal[1] != 0.0 or abs(e) > loop.deadband) and abs(state[5]) < loop.limit:
        state[2] += loop.integral * loop.mass * w**3 / 6.0 * grow * period
        state[2] = min(0.5 * loop.limit, max(-0.5 * loop.limit, state[2]))
    state[5] = min(loop.limit, max(-loop.limit, force + state[2]))
    return float(state[5])


@compiled
def drive_force(
    axis: Axis, extra: Extra, u: float, x: float, v: float, h: float, state: Array
) -> float:
    """Return the motor's force of the command that it got, at place x and speed v."""
    effect = extra.effect
    if effect == Effect.COMMAND_LAG:
        state[0] += (1.0 - np.exp(-h / extra.size)) * (u - state[0])
        u = state[0]
    elif effect == Effect.CURRENT_SATURATION:
        y = u * extra.size
        if extra.mode == 0:
            u = np.tanh(y) / extra.size
        elif extra.mode == 1:
            u = u / np.sqrt(1.0 + y * y)
        else:
            over = max(0.0, abs(y) - 1.0)
            u -= np.sign(u) * extra.second * over / extra.size * over / (0.3 + over)
    elif effect == Effect.VOLTAGE_CLIPPING:
        full = 1.0 / extra.size
        emf = full * v / extra.scale
        u = min(full - emf, max(-full - emf, u))
    elif effect == Effect.FORCE_RIPPLE:
        angle = 2.0 * np.pi * x / extra.scale + extra.place
        u *= 1.0 + extra.size * (np.sin(angle) + extra.second * np.sin(2.0 * angle))
    elif effect == Effect.UNKNOWN_BUS_SAG:
        state[0] += h / extra.scale * (min(1.5, abs(u) / extra.place) - state[0])
        u *= 1.0 - extra.size * state[0]
    return axis.force_constant * u


@compiled
def outer_force(extra: Extra, x: float, v: float, t: float, h: float, state: Array) -> float:
    """Return what acts on the body beside motor and friction: mostly a potential's slope."""
    effect = extra.effect
    if effect == Effect.GRAVITY_CONSTANT:
        return -extra.size
    if effect == Effect.GRAVITY_SINE:
        return float(-extra.size * np.sin(x + extra.place))
    if effect == Effect.COGGING:
        angle = 2.0 * np.pi * x / extra.scale + extra.place
        return float(-extra.size * (np.sin(angle) + extra.second * np.sin(2.0 * angle + 1.0)))
    if effect == Effect.POSITION_FORCE:
        y = (x - extra.place) / extra.scale
        if extra.mode == 0:
            return -extra.size * y
        if extra.mode == 1:
            return -extra.size * (0.4 * y + y**3)
        return float(-extra.size * np.sqrt(0.05 + max(0.0, y) ** 2))
    if effect == Effect.HARD_STOP:
        depth = extra.second * (x - extra.place)
        if depth <= 0.0:
            return 0.0
        push = extra.size * depth * (1.0 + extra.second * v / extra.scale)
        return -extra.second * max(0.0, push)
    if effect == Effect.UNKNOWN_SHAKER:
        turn = t * extra.scale
        if extra.mode == 0:
            return float(extra.size * np.sin(2.0 * np.pi * turn))
        turn -= np.floor(turn)  # a press beside the machine: short half sines, with both signs
        if turn >= extra.second:
            return 0.0
        return float(extra.size * np.sin(2.0 * np.pi * turn / extra.second))
    if effect == Effect.UNKNOWN_RELAXING_DAMPER:
        state[0] = (state[0] + h / extra.scale * extra.size * v) / (1.0 + h / extra.scale)
        return -float(state[0])
    return 0.0


@compiled
def friction_level(
    axis: Axis,
    extra: Extra,
    x: float,
    v: float,
    t: float,
    h: float,
    motor: float,
    moving: bool,
    state: Array,
) -> float:
    """Return the Coulomb force, which the effect may have changed."""
    effect = extra.effect
    level = axis.coulomb
    if effect == Effect.STRIBECK:
        level *= 1.0 + extra.size * np.exp(-((abs(v) / extra.scale) ** extra.second))
    elif effect == Effect.LOAD_FRICTION:
        state[0] += h / (h + 1e-3) * (abs(motor) - state[0])
        driven = extra.mode == 1 and motor * v < 0.0  # teeth that drive back rub otherwise
        level += extra.size * state[0] * (extra.second if driven else 1.0)
    elif effect == Effect.WARMING_FRICTION:
        if extra.mode == 1:  # warmed by its own work
            state[0] += h * abs(v) if t >= 0.0 else 0.0
            level *= 1.0 + extra.size * np.exp(-state[0] / extra.scale)
        else:
            level *= 1.0 + extra.size * np.exp(-max(0.0, t) / extra.scale)
    elif effect == Effect.POSITION_FRICTION:
        y = (x - extra.place) / extra.scale
        if extra.mode == 0:
            level *= 1.0 + extra.size * np.exp(-y * y)
        elif extra.mode == 1:
            level *= max(0.05, 1.0 + extra.size * np.tanh(y))
        else:
            level *= max(0.05, 1.0 + extra.size * np.sin(2.0 * np.pi * y))
    elif effect == Effect.UNKNOWN_LATE_BRAKE:
        state[0] += (h / extra.scale * -state[0]) if moving else (h / 0.1 * (1.0 - state[0]))
        level += extra.size * state[0]
    elif effect == Effect.UNKNOWN_STALE_GREASE:
        if abs(v) < extra.second:
            state[0] += h / extra.place * (1.0 - state[0])
        state[0] *= np.exp(-h * abs(v) / extra.scale)
        level += extra.size * state[0]
    elif effect == Effect.PRESLIDING:
        level = 0.0
    return level


@compiled
def presliding_force(axis: Axis, extra: Extra, v: float, h: float, state: Array) -> float:
    """Return the force of friction with memory: Dahl, LuGre or Maxwell slip, by the mode."""
    if extra.mode == 2:
        force = 0.0
        for i in range(PLAYS):
            reach = extra.size * (0.3 + 0.45 * i)
            state[i] = min(reach, max(-reach, state[i] + h * v))
            force -= axis.coulomb / PLAYS * state[i] / reach
        return float(force)
    before = state[0]
    state[0] = (before + h * v) / (1.0 + h * abs(v) / extra.size)
    force = -axis.coulomb * state[0] / extra.size
    if extra.mode == 1:
        inner = 0.6 * np.sqrt(axis.coulomb / extra.size * axis.mass)
        force -= inner * (state[0] - before) / h
    return float(force)


@compiled
def simulate(
    axis: Axis,
    train: Train,
    extra: Extra,
    loop: Loop,
    goal: Array,
    noise: Array,
    period: float,
    steps: int,
    resolution: float,
) -> Array:
    """Return (N, 3): true position at the encoder, measured position and command.

    Parameters
    ----------
    goal : Array
        (N, 3) reference, its velocity and its acceleration.
    noise : Array
        (N, 3) added to position, added to force, and dice in [0, 1).
    steps : int
        Of the integrator in one period of the controller.
    """
    n = goal.shape[0]
    out = np.zeros((n, 3))
    memory, inner, plays, queue = np.zeros(6), np.zeros(1), np.zeros(PLAYS), np.zeros(16)
    h = period / steps
    effect = extra.effect
    lead = int(2.0 / period)
    q1 = q2 = memory[1] = memory[3] = goal[0, 0]
    v1 = v2 = 0.0
    sent = 0.0
    held = 0
    share = train.load_friction_share if train.two_bodies else 0.0
    for k in range(-lead, n):
        row = max(k, 0)
        true = q2 if train.encoder_on_load else q1
        if effect == Effect.MEASUREMENT_RIPPLE:
            angle = 2.0 * np.pi * true / extra.scale + extra.place
            true += extra.size * (np.sin(angle) + extra.second * np.sin(2.0 * angle))
        seen = np.floor((true + noise[row, 0]) / resolution + 0.5) * resolution
        u = force_asked(loop, goal[row], seen, period, memory) / axis.force_constant
        if k >= 0:
            out[k, 0] = true
            out[k, 1] = seen
            out[k, 2] = u
        if effect == Effect.COMMAND_DELAY:
            queue[(k + lead) % 16] = u
            sent = queue[(k + lead - int(extra.size)) % 16]
        elif effect == Effect.UNKNOWN_TELEGRAM_LOSS:
            if held > 0:
                held -= 1
            else:
                sent = u
                held = int(extra.scale / period) if noise[row, 2] < extra.size * period else 0
        elif effect == Effect.DRIVE_HYSTERESIS:
            sent = (1.0 - extra.size) * u
            for i in range(PLAYS):
                reach = extra.scale * (i + 1) / PLAYS
                plays[i] = min(u + reach, max(u - reach, plays[i]))
                sent += extra.size * plays[i] / PLAYS
        else:
            sent = u
        for step in range(steps):
            t = k * period + (step + 0.5) * h
            x1 = q1 + 0.5 * h * v1
            mass = axis.mass
            if effect == Effect.PAYLOAD_STEP and t >= extra.scale:
                mass *= 1.0 + extra.size
            loss = axis.viscous
            if effect == Effect.QUADRATIC_DRAG:
                loss += extra.size * abs(v1)
            elif effect == Effect.EDDY_BRAKE:
                loss += 2.0 * extra.size / extra.scale / (1.0 + (v1 / extra.scale) ** 2)
            motor = drive_force(axis, extra, sent, x1, v1, h, inner)
            force = motor + axis.offset + noise[row, 1]
            force += outer_force(extra, x1, v1, t, h, inner)
            if effect == Effect.PRESLIDING:
                force += presliding_force(axis, extra, v1, h, plays)
            level = friction_level(axis, extra, x1, v1, t, h, motor, goal[row, 1] != 0.0, inner)
            if train.two_bodies:
                x2 = q2 + 0.5 * h * v2
                twist = x1 - x2
                link = 0.0
                if abs(twist) > 0.5 * train.gap:
                    twist -= np.sign(twist) * 0.5 * train.gap
                    link = train.stiffness * twist + train.damping * (v1 - v2)
                    if train.gap > 0.0 and link * twist < 0.0:
                        link = 0.0  # teeth push; they do not pull
                force -= link
                mass2 = (1.0 - train.motor_share) * mass
                mass *= train.motor_share
                half = 0.5 * h * share * loss
                free = ((mass2 - half) * v2 + h * link) / (mass2 + half)
                v2 = after_friction(
                    free, h * share * level / (mass2 + half), axis.width, axis.shape
                )
                q2 = x2 + 0.5 * h * v2
            half = 0.5 * h * (1.0 - share) * loss
            free = ((mass - half) * v1 + h * force) / (mass + half)
            if effect == Effect.ASYMMETRIC_FRICTION:
                level *= 1.0 + extra.size if free > 0.0 else 1.0 - extra.size
            v1 = after_friction(
                free, h * (1.0 - share) * level / (mass + half), axis.width, axis.shape
            )
            q1 = x1 + 0.5 * h * v1
    return out


def unexplained(axis: Axis, out: Array, period: float) -> float:
    """Return what the basics, fitted, leave of the command, as a share of its rms."""
    whole = float(np.sqrt(np.mean(out[:, 2] ** 2))) * axis.force_constant
    y = out[:, 0]
    speed = (y[2:] - y[:-2]) / (2.0 * period)
    rise = (y[2:] - 2.0 * y[1:-1] + y[:-2]) / period**2
    force = 0.5 * (out[1:-1, 2] + out[:-2, 2]) * axis.force_constant
    wide = max(axis.width, 1e-9)
    shape = [
        np.sign(speed),
        np.tanh(speed / wide),
        2.0 / np.pi * np.arctan(speed * 1.5708 / wide),
        speed / np.sqrt(wide**2 + speed**2),
        np.clip(speed / wide, -1.0, 1.0),
    ][axis.shape]
    moving = np.abs(speed) > 0.003 * np.abs(speed).max()
    count = max(1, round(0.008 / period))  # what is quicker, no expert sees in a position
    window = np.convolve(np.full(count, 1.0 / count), np.full(count, 1.0 / count))
    moving &= np.convolve(~moving, window, "same") < 0.5
    base = np.stack(
        [
            np.convolve(part, window, "same")
            for part in (rise, speed, shape, np.ones_like(speed), force)
        ],
        axis=1,
    )[moving]
    base, force = base[:, :4], base[:, 4]
    base /= np.sqrt(np.mean(base**2, axis=0)) + 1e-300
    fit = np.linalg.lstsq(base, force, rcond=None)[0]
    return float(np.sqrt(np.mean((force - base @ fit) ** 2))) / whole
