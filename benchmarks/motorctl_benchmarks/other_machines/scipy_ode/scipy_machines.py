"""Simulated linear axes: recordings by scipy.integrate.ode (DOPRI5, DOP853, LSODA) per sample.

Ball-screw stages, linear motors with winding dynamics, belt carriages, counterweighted lifts, each
drawn by seed with one effect beyond rigid mass, viscous and Coulomb friction and offset.
Physics and stepper: scipy_machine_physics; programmes and controllers: scipy_machine_motion.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.signal import lfilter

from motorctl_benchmarks.other_machines.machine_recording import Array, MachineRecording
from motorctl_benchmarks.other_machines.scipy_ode import scipy_machine_motion as motion

# isort: off
# fmt: off
from motorctl_benchmarks.other_machines.scipy_ode.scipy_machine_physics import (
    AMP, ASYMMETRY, BACKLASH_L, BACKLASH_M, BRAKE, CLIPPING, COGGING, COUL, COUL2, DASHPOT, DELAY,
    DRAG, E0, E1, E2, E3, E4, EDDY, ENCODER, FLEXIBLE_L, FLEXIBLE_M, FORCE, FRICTIONAL, GRAVITY,
    HEAT, HYSTERESIS, KIND, KINDS, LAG, LOAD, MASS, MASS2, MEMORY, N_PARAMETERS, NOISE, NONE,
    OFFSET, ON_LOAD, PAWL, PAYLOAD, PLACE, PRESLIDING, RIPPLE, SATURATION, SHAPE, SHAPES, SIGN,
    SPINDLE, SPRING, STOP, STRIBECK, TWO_BODIES, VISC, VISC2, WARMING, WIDTH, X2, X_HELD, F,
    Method, Stepper, X, Z, effect_along, lagging, push, wave,
)
# fmt: on
# isort: on

__all__ = ["KINDS", "machine"]


@dataclass
class Plant:
    """A machine as built: what its parts are, and what it is asked to do."""

    family: str
    limits: motion.Limits
    h: float
    n: int
    unit: str
    p: Array
    total: tuple[float, float, float]
    """Mass, viscous and Coulomb friction of the whole."""
    plan: motion.Programme
    rms_n: float
    peak_n: float
    text: str = ""
    delay: int = 0
    ripple_m: float = 0.0
    slow_rad_s: float = 1e9
    """What the effect leaves for the position loop's bandwidth."""


FAMILIES = {  # travel m, top speed m/s, acceleration m/s^2, mass kg, units
    "ball-screw stage": ((0.15, 0.9), (0.12, 0.6), (1.2, 6.0), (8.0, 200.0), ("A", "N m", "V")),
    "linear motor": ((0.12, 1.2), (0.4, 2.2), (4.0, 22.0), (1.0, 30.0), ("A", "N", "V")),
    "belt carriage": ((0.4, 2.2), (0.5, 2.5), (2.0, 11.0), (2.0, 40.0), ("A", "N m", "V")),
    "counterweighted lift": ((0.3, 1.8), (0.2, 1.0), (0.8, 4.0), (5.0, 200.0), ("A", "N m", "N")),
}


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a draw with uniform logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def build(kind: int, rng: np.random.Generator, again: bool, friction: int | None) -> Plant:
    """Return a clean machine with its programme, suited to carry an effect of this kind.

    Parameters
    ----------
    kind
        Index into KINDS.
    rng
        Source of randomness.
    again
        Whether earlier draws failed: a shorter recording then, to spare time.
    friction
        Index into SHAPES; drawn if None.
    """
    names = list(FAMILIES)
    pick = {GRAVITY: [3], BACKLASH_M: [0, 2], BACKLASH_L: [0, 2], CLIPPING: [1, 1, 2]}
    pick |= {FLEXIBLE_M: [0, 2, 2, 3], FLEXIBLE_L: [0, 2, 2, 3]}
    pick |= {COGGING: [0, 1, 1, 2], RIPPLE: [0, 1, 1, 2], SPRING: [0, 1, 2], PAYLOAD: [0, 1, 2]}
    family = names[int(rng.choice(pick.get(kind, [0, 1, 2, 3])))]
    travels, speeds, accelerations, masses, units = FAMILIES[family]
    travel, speed = log_uniform(rng, *travels), log_uniform(rng, *speeds)
    speed = float(np.clip(speed, 1.1 * travel, 3.0 * travel))
    acceleration = max(log_uniform(rng, *accelerations), speed / 0.5)
    low = float(rng.choice([0.0, -0.5 * travel, 0.02]))
    limits = motion.Limits(low, low + travel, speed, acceleration)
    rates_hz = [500, 1000, 1000, 2000, 2000, 2500, 4000, 5000]
    slower = again or kind in (DELAY, CLIPPING)
    h = 1.0 / float(rng.choice(rates_hz[:5] if slower else rates_hz))
    most = 30000.0 if again or kind == CLIPPING else 54000.0
    n = int(max(15.0, min(rng.uniform(15.0, 40.0), most * h)) / h)
    chance = 0.95 if kind in (LAG, DELAY) else 0.7 if kind in TWO_BODIES else 0.3
    injects = bool(rng.random() < chance)
    plan = motion.programme(rng, limits, n, h, injects, 0.25 if kind == BRAKE else 0.0)
    mass = log_uniform(rng, *masses)
    a_rms = float(np.sqrt(np.mean(plan.acceleration_m_s2**2)))
    grips = rng.uniform(0.6, 1.3) if kind in FRICTIONAL else log_uniform(rng, 0.2, 1.0)
    coulomb = mass * a_rms * grips
    viscous = mass * a_rms * rng.uniform(0.05, 0.6) / speed
    p = np.zeros(N_PARAMETERS)
    p[[KIND, MASS, VISC, COUL]] = kind, mass, viscous, coulomb
    p[SHAPE] = MEMORY if kind == PRESLIDING else int(rng.integers(5))
    p[SHAPE] = p[SHAPE] if friction is None else friction
    p[WIDTH] = min(log_uniform(rng, 5e-4, 1e-2), 0.03 * speed) if p[SHAPE] != SIGN else 1e-3
    p[OFFSET] = rng.uniform(-0.25, 0.25) * coulomb
    rigid = mass * plan.acceleration_m_s2 + viscous * plan.speed_m_s - p[OFFSET]
    rigid += coulomb * np.tanh(plan.speed_m_s / p[WIDTH])
    rms, peak = float(np.sqrt(np.mean(rigid**2))), float(np.abs(rigid).max())
    total = (mass, viscous, coulomb)
    unit = str(rng.choice(units))
    return Plant(family, limits, h, n, unit, p, total, plan, rms, peak)


def calibrate(plant: Plant, strength: float, most: float = 1e12) -> None:
    """Set AMP so that the effect's force along the reference is strength times the rms force."""
    p, plan, mass = plant.p, plant.plan, plant.total[0]
    every = max(1, int(0.001 / plant.h))
    x, v, a = (
        np.ascontiguousarray(column[::every])
        for column in (plan.position_m, plan.speed_m_s, plan.acceleration_m_s2)
    )
    f = mass * a + p[VISC] * v + p[COUL] * np.tanh(v / p[WIDTH]) - p[OFFSET]

    def excess(log_amplitude: float) -> float:
        p[AMP] = np.exp(log_amplitude)
        return effect_along(plant.h * every, x, v, a, f, p) / plant.rms_n - strength

    top = float(np.log(most))
    if excess(top) > 0.0:
        top = float(brentq(excess, min(-25.0, top - 30.0), top, xtol=1e-4))
    p[AMP] = np.exp(top)


def add_effect(kind: int, plant: Plant, rng: np.random.Generator) -> None:
    """Put the effect into the plant: its parameters, its size, and words on it."""
    p, limits, plan, h = plant.p, plant.limits, plant.plan, plant.h
    mass, _, coulomb = plant.total
    travel, speed = limits.travel_m, limits.speed_m_s
    strength, phase = log_uniform(rng, 0.1, 0.42), rng.uniform(0.0, 6.28, 2)
    if kind in (COGGING, RIPPLE, ENCODER):
        bounds = {"linear motor": (0.012, 0.06), "ball-screw stage": (0.004, 0.02)}
        period = min(log_uniform(rng, *bounds.get(plant.family, (0.03, 0.2))), travel / 6.0)
        p[[E0, E1, E3]] = period, *phase
        p[[E2, E4]] = rng.uniform(0.0, 0.5), rng.integers(2, 4)
        plant.text = f"period {1e3 * period:.4g} mm"
        if kind == ENCODER:
            error = np.array([wave(x, p) for x in plan.position_m])
            n_box = max(1, int(0.01 / h))
            box = np.ones(n_box) / n_box
            felt = np.convolve(np.gradient(np.gradient(error, h), h), np.convolve(box, box), "same")
            plant.ripple_m = strength * plant.rms_n / (mass * float(np.sqrt(np.mean(felt**2))))
            plant.ripple_m = min(plant.ripple_m, period / 25.0)
            plant.text += f", error {1e6 * plant.ripple_m:.4g} um"
            plant.slow_rad_s = 2.0 * np.pi * 8.0
        else:
            calibrate(plant, strength, 0.5 if kind == RIPPLE else 1e12)
    elif kind == GRAVITY:
        p[AMP] = log_uniform(rng, 0.4, 2.0) * plant.rms_n
        plant.text = f"counterweight short of {p[AMP] / 9.81:.3g} kg"
    elif kind == SATURATION:
        p[E0] = rng.integers(2)
        calibrate(plant, strength, (0.55 if p[E0] else 0.88) / plant.peak_n)
        plant.text = f"force constant falls over a force of {1.0 / p[AMP]:.4g} N"
    elif kind == LAG:
        p[E0] = 1.0 / (2.0 * np.pi * log_uniform(rng, 30.0, 90.0))
        plant.slow_rad_s = 0.1 / p[E0]
        plant.text = f"winding/current loop of {0.159 / p[E0]:.3g} Hz"
    elif kind == DELAY:
        plant.delay = int(rng.integers(max(1, int(0.002 / h)), min(8, int(0.01 / h)) + 1))
        plant.slow_rad_s = 0.12 / (plant.delay * h)
        plant.text = f"{plant.delay} samples late"
    elif kind == CLIPPING:
        p[E0] = rng.uniform(0.6, 2.0) * plant.peak_n / speed
        p[[E1, E2]] = rng.uniform(0.001, 0.004), 2.0 * np.pi * rng.uniform(500.0, 900.0)
        calibrate(plant, 0.3 * strength)
        plant.text = f"stall force {1.0 / p[AMP]:.4g} N, back-EMF {p[E0]:.4g} N s/m"
    elif kind == STRIBECK:
        p[E0] = max(3.0 * p[WIDTH], log_uniform(rng, 0.03, 0.25) * speed)
        p[E1], p[AMP] = rng.choice([1.0, 2.0]), rng.uniform(0.35, 1.2) * coulomb
        plant.text = f"{p[AMP]:.4g} N more at rest, over {1e3 * p[E0]:.3g} mm/s"
    elif kind == ASYMMETRY:
        p[AMP] = rng.uniform(0.15, 0.5) * coulomb
        p[E0] = rng.choice([0.0, rng.uniform(0.4, 1.5)]) / speed
        plant.text = f"+-{p[AMP]:.4g} N, and {p[E0] * p[AMP]:.4g} N s/m"
    elif kind == DRAG:
        calibrate(plant, strength)
        plant.text = f"{p[AMP]:.4g} N s^2/m^2"
    elif kind == PRESLIDING:
        p[[E0, E1]] = np.clip(log_uniform(rng, 4e-4, 3e-3) * travel, 1e-4, 1.5e-3), rng.integers(3)
        if p[E1] == 1.0:
            p[E2] = rng.uniform(0.1, 0.4) * np.sqrt(mass / (coulomb * p[E0]))
        plant.text = f"{('Dahl', 'LuGre', 'Maxwell slip')[int(p[E1])]}, {1e6 * p[E0]:.3g} um"
    elif kind == LOAD:
        calibrate(plant, strength, 0.4)
        plant.text = f"{100.0 * p[AMP]:.3g} % of the motor's force"
    elif kind == WARMING:
        p[[AMP, E0]] = rng.uniform(0.4, 1.5) * coulomb, rng.uniform(0.15, 0.6) * plant.n * h
        plant.text = f"{p[AMP]:.4g} N more when cold, time constant {p[E0]:.3g} s"
    elif kind == PLACE:
        p[[E0, E1, E2]] = travel * rng.uniform(0.25, 0.75) + limits.low_m, 0.0, rng.integers(2)
        p[[E1, AMP]] = rng.uniform(0.06, 0.25) * travel, rng.uniform(0.5, 1.6) * coulomb
        plant.text = f"{('a bump', 'a rise')[int(p[E2])]} of {p[AMP]:.4g} N at {p[E0]:.3g} m"
    elif kind in TWO_BODIES:
        join(kind, plant, rng)
    elif kind == PAYLOAD:
        p[AMP] = rng.uniform(0.25, 0.9) if rng.random() < 0.6 else -rng.uniform(0.22, 0.45)
        window = slice(int(0.3 * plant.n), int(0.7 * plant.n))
        gentle = np.convolve(np.abs(plan.speed_m_s), np.ones(int(0.05 / h)), "same")[window]
        p[E0] = (int(rng.choice(np.flatnonzero(gentle <= gentle.min() + 1e-9))) + 0.3 * plant.n) * h
        plant.text = f"mass times {1.0 + p[AMP]:.3g} at {p[E0]:.4g} s"
    elif kind == SPRING:
        p[[E0, E1]] = limits.low_m + travel * rng.uniform(0.2, 0.8), 0.5 * travel
        p[E2] = rng.integers(3)
        p[E3] = rng.uniform(0.8, 1.8) if p[E2] else rng.uniform(-0.2, 0.8)
        calibrate(plant, max(strength, 0.15))
        which = ("spring", "exponential spring", "cable carrier")[int(p[E2])]
        plant.text = f"{which}, {p[AMP]:.4g} N"
    elif kind == STOP:
        p[[E0, E1]] = limits.low_m + travel * rng.uniform(0.6, 0.88), rng.uniform(1.0, 1.6)
        calibrate(plant, strength)
        plant.text = f"from {p[E0]:.4g} m"
        plant.slow_rad_s = 60.0
    elif kind == HYSTERESIS:
        p[[E0, E1]] = rng.uniform(1.7, 3.5), rng.choice([1, 3])
        calibrate(plant, strength)
        plant.text = f"{int(p[E1])} stops, {p[AMP]:.4g} N"
    elif kind == EDDY:
        p[E0] = rng.uniform(0.1, 0.35) * speed
        calibrate(plant, strength)
        plant.text = f"at most {p[AMP]:.4g} N at {p[E0]:.3g} m/s"
    elif kind == DASHPOT:
        p[[E0, E1]] = log_uniform(rng, 0.05, 0.4), limits.low_m - rng.uniform(0.2, 0.5) * travel
        calibrate(plant, strength)
        plant.text = f"cylinder that leaks over {p[E0]:.3g} s"
    elif kind == BRAKE:
        p[[E0, E1]] = rng.uniform(0.15, 0.5), rng.uniform(0.04, 0.15)
        p[[E2, AMP]] = rng.uniform(0.005, 0.02) * speed, rng.uniform(0.5, 1.5) * coulomb
        plant.text = f"holding brake of {p[AMP]:.4g} N that lets go over {p[E0]:.3g} s"
    elif kind == SPINDLE:
        p[[E0, E1, E2]] = log_uniform(rng, 1.5, 14.0), rng.uniform(-1e-3, 1e-3), phase[0]
        calibrate(plant, strength)
        plant.text = f"spindle unbalance at {p[E0]:.3g} Hz, {p[AMP]:.4g} N"
    elif kind == HEAT:
        p[[E0, E1]] = rng.uniform(3.0, 10.0), plant.rms_n
        calibrate(plant, min(strength, 0.3), 0.4)
        plant.text = f"warm windings pull {100.0 * p[AMP]:.3g} % less, time constant {p[E0]:.3g} s"
    elif kind == PAWL:
        p[[E0, E1]] = min(log_uniform(rng, 0.008, 0.06), travel / 6.0), max(0.002, 0.02 * speed)
        calibrate(plant, strength)
        plant.text = f"pawl over teeth of {1e3 * p[E0]:.3g} mm, forward only, {p[AMP]:.4g} N"


def join(kind: int, plant: Plant, rng: np.random.Generator) -> None:
    """Split the machine into motor and load, joined by a spring or through a gap."""
    p = plant.p
    mass, viscous, coulomb = plant.total
    part, share = rng.uniform(0.35, 0.75), rng.uniform(0.3, 0.7)
    p[[MASS, MASS2]] = (1.0 - part) * mass, part * mass
    p[[VISC, VISC2]] = (1.0 - share) * viscous, share * viscous
    p[[COUL, COUL2]] = (1.0 - share) * coulomb, share * coulomb
    reduced = p[MASS] * p[MASS2] / mass
    if kind in (FLEXIBLE_M, FLEXIBLE_L):
        w = 2.0 * np.pi * log_uniform(rng, 6.0, 35.0)
        p[[E0, E1]] = w * w * reduced, 2.0 * rng.uniform(0.01, 0.06) * w * reduced
        plant.slow_rad_s = w * np.sqrt(1.0 - part) / 4.0
        plant.text = f"{w / 6.283:.3g} Hz, load {100.0 * part:.3g} % of the mass"
        return
    gap = float(np.clip(log_uniform(rng, 1e-3, 6e-3) * plant.limits.travel_m, 2e-4, 4e-3))
    w = 2.0 * np.pi * rng.uniform(40.0, 110.0)
    p[[E0, E1, E2]] = w * w * reduced, rng.uniform(3.0, 12.0) / plant.limits.speed_m_s, gap
    plant.slow_rad_s = 2.0 * np.pi * (6.0 if kind == BACKLASH_M else 4.0)
    plant.text = f"gap {1e3 * gap:.3g} mm, load {100.0 * part:.3g} % of the mass"


def rigid_misfit(plant: Plant, x: Array, force: Array) -> tuple[float, float]:
    """Return the effect's rms, and what no rigid machine explains of it, by the command's rms.

    Parameters
    ----------
    plant
        The machine.
    x
        (N,) position at the encoder, m, without noise.
    force
        (N,) asked, N.
    """
    h, (mass, viscous, coulomb) = plant.h, plant.total
    n_box = max(2, int(0.01 / h))
    box = np.ones(n_box) / n_box
    speeds = np.diff(x) / h
    v, a = 0.5 * (speeds[1:] + speeds[:-1]), np.diff(speeds) / h
    f = np.convolve(0.5 * (force[1:-1] + force[:-2]), box, "same")
    rigid = (a, v, np.tanh(v / plant.p[WIDTH]), np.ones_like(v))
    columns = np.column_stack([np.convolve(column, box, "same") for column in rigid])
    moves = np.abs(v) > max(plant.p[WIDTH], 0.002 * plant.limits.speed_m_s)
    moves[:n_box] = moves[-n_box:] = False
    columns, f = columns[moves], f[moves]
    plain = f - columns @ np.array([mass, viscous, coulomb, -plant.p[OFFSET]])
    best = f - columns @ np.linalg.lstsq(columns, f, rcond=None)[0]
    rms = float(np.sqrt(np.mean(f**2)))
    return float(np.sqrt(np.mean(plain**2))) / rms, float(np.sqrt(np.mean(best**2))) / rms


@dataclass
class Sensing:
    """Noise, encoder and units."""

    noise: int
    step_m: float
    position_m: Array
    """(N,) white noise on position."""
    force_n: Array
    """(N,) coloured disturbing force."""
    command_n: Array
    """(N,) coloured noise in the recorded command."""
    newton_per_unit: float
    quantised: float
    """What the tuner reckons with, m."""


def sense(
    plant: Plant, force_limit_n: float, rng: np.random.Generator, asked: int | None
) -> Sensing:
    """Return the sensors of a plant; with the noise that is asked for, or any."""
    n, travel = plant.n, plant.limits.travel_m
    noise = int(rng.integers(4))
    noise = noise if asked is None else asked
    step = travel * (rng.uniform(1e-4, 3e-4) if noise == 3 else log_uniform(rng, 3e-7, 8e-6))
    step = float(f"{step:.2g}")
    sigma = travel * log_uniform(rng, 2e-6, 1.5e-5) if noise == 1 else 0.0
    coloured = np.zeros(n)
    if noise == 2:
        pole = np.exp(-2.0 * np.pi * plant.h * log_uniform(rng, 2.0, 80.0))
        coloured = lfilter([1.0], [1.0, -pole], rng.standard_normal(n))
        coloured *= rng.uniform(0.005, 0.025) * plant.rms_n / np.std(coloured)
    on_force = bool(rng.random() < 0.5)
    if plant.unit == "N":
        scale = 1.0
    elif plant.unit == "N m":  # screw: lead over a turn; belt, lift: radius of the pulley
        is_screw = plant.family == "ball-screw stage"
        lead_m = float(rng.choice([5e-3, 1e-2, 2e-2]))
        scale = 2.0 * np.pi / lead_m if is_screw else 1.0 / rng.uniform(0.01, 0.05)
    else:
        scale = force_limit_n / (10.0 if plant.unit == "V" else log_uniform(rng, 3.0, 40.0))
    return Sensing(
        noise,
        step,
        sigma * rng.standard_normal(n),
        coloured * on_force,
        coloured * (not on_force),
        float(scale),
        max(step, 1.5 * sigma),
    )


def simulate(
    plant: Plant, gains: Array, sensing: Sensing, method: Method
) -> tuple[Array, Array, Array]:
    """Return measured position, force asked, and position at the encoder without noise.

    Parameters
    ----------
    plant, gains, sensing
        Machine, controller, sensors.
    method
        Integrator of scipy.integrate.ode.
    """
    p, plan, h, n = plant.p, plant.plan, plant.h, plant.n
    kind, step = int(p[KIND]), sensing.step_m
    at_load, ripples = kind in ON_LOAD, kind == ENCODER
    xr, vr, ar = plan.position_m, plan.speed_m_s, plan.acceleration_m_s2
    injected = 0.22 * plant.rms_n * plan.injection
    y = np.zeros(6)
    y[X] = y[X2] = xr[0]
    y[Z] = 1.0 if kind == BRAKE else 0.0
    p[X_HELD] = xr[0]
    holding = -(p[OFFSET] + push(0.0, y[X], 0.0, y[Z], p))
    y[F] = holding
    memory = motion.first_memory(gains, xr[0], holding)
    late = deque([holding] * (plant.delay + 1), maxlen=plant.delay + 1)
    eaten, last = np.zeros(4), 0.0
    reach = p[E0] * 0.25 * np.arange(1.0, 5.0)
    stepper = Stepper(p, method, h)
    position, force, truth = np.zeros(n), np.zeros(n), np.zeros(n)
    for k in range(n):
        seen = y[X2] if at_load else y[X]
        if ripples:
            seen += plant.ripple_m * wave(seen, p)
        truth[k] = seen
        q = round((seen + sensing.position_m[k]) / step) * step
        qm = round(y[X] / step) * step if at_load else q
        u = motion.control(gains, memory, xr[k], vr[k], ar[k], q, qm, injected[k])
        position[k], force[k] = q, u
        late.append(u)
        f = late[0]
        if kind == HYSTERESIS:
            f -= lagging(f - last, eaten, p)
            last = late[0]
        p[FORCE], p[NOISE] = f, sensing.force_n[k]
        y = stepper.advance(y, k * h, (k + 1) * h)
        if kind == PRESLIDING and p[E1] == 2.0:
            p[21:25] = np.clip(p[21:25] + (y[X] - p[X_HELD]) / reach, -1.0, 1.0)
            p[X_HELD] = y[X]
    return position, force, truth


def machine(
    kind: str, seed: int, friction: int | None = None, noise: int | None = None
) -> MachineRecording:
    """Return the recording of a machine with one effect.

    Parameters
    ----------
    kind
        One of KINDS.
    seed
        Draws the machine, its programme, controller, sensors and the effect's size. A machine
        that shows too little of the effect, or is carried away by it, is drawn again.
    friction
        Index into SHAPES; drawn if not given.
    noise
        Which noise, as the recording tells it; drawn if not given.
    """
    code = KINDS.index(kind)
    for attempt in range(4):
        rng = np.random.default_rng([seed, code, attempt])
        recording, effect, beyond, clipped = draw(code, rng, attempt > 0, friction, noise)
        plain = code in (NONE, GRAVITY, ASYMMETRY) and clipped < 0.02
        most = 0.8 if code in TWO_BODIES else 0.6
        if plain or (0.05 < effect < most and beyond > 0.03 and clipped < 0.02):
            break
    return recording


def draw(
    code: int,
    rng: np.random.Generator,
    again: bool = False,
    friction: int | None = None,
    noise: int | None = None,
) -> tuple[MachineRecording, float, float, float]:
    """Return a recording, its two misfits (see rigid_misfit), and the share of clipped samples."""
    kind = KINDS[code]
    plant = build(code, rng, again, friction)
    add_effect(code, plant, rng)
    p, h, (mass, viscous, coulomb) = plant.p, plant.h, plant.total
    extra = p[AMP] if code == GRAVITY else 0.0
    limit = rng.uniform(1.9, 3.0) * (plant.peak_n + extra)
    sensing = sense(plant, limit, rng, noise)
    law = int(rng.integers(2 if code in TWO_BODIES else 4))
    quiet = np.sqrt(0.08 * plant.rms_n / (15.0 * mass * sensing.quantised))
    bandwidth = 2.0 * np.pi * log_uniform(rng, 3.0, 20.0)
    bandwidth = min(bandwidth, max(quiet, 6.3), plant.slow_rad_s, 0.1 / h)
    believed = (mass * rng.uniform(0.85, 1.1), viscous * rng.uniform(0.5, 1.2), coulomb)
    turn = max(2.0 * p[WIDTH], 0.01 * plant.limits.speed_m_s)
    gains = motion.gains(rng, law, h, bandwidth, (*believed, turn), limit)
    stiff = h * p[COUL] / (p[MASS] * p[WIDTH]) if p[SHAPE] not in (SIGN, MEMORY) else 0.0
    method: Method = "dopri5" if rng.random() < 0.5 else "dop853"
    method = "lsoda" if stiff > 25.0 else method
    method = "dop853" if code == CLIPPING else method
    position, force, truth = simulate(plant, gains, sensing, method)
    effect, beyond = rigid_misfit(plant, truth, force)
    shape = "presliding" if p[SHAPE] == MEMORY else SHAPES[int(p[SHAPE])]
    width = "" if p[SHAPE] in (SIGN, MEMORY) else f" over {1e3 * p[WIDTH]:.2g} mm/s"
    story = (
        f"{plant.family}, {mass:.3g} kg over {plant.limits.travel_m:.3g} m, "
        f"{plant.limits.speed_m_s:.3g} m/s and {plant.limits.acceleration_m_s2:.3g} m/s^2; viscous "
        f"{viscous:.3g} N s/m, Coulomb {coulomb:.3g} N ({shape}{width}), offset {p[OFFSET]:.3g} N; "
        f"{1.0 / h:.0f} Hz, {motion.LAWS[law]} of {bandwidth / 6.283:.2g} Hz, {plant.plan.style}, "
        f"{sensing.newton_per_unit:.4g} N/{plant.unit}, {method}; "
        f"{kind}: {plant.text or 'nothing'}; "
        f"effect {100.0 * effect:.1f} % of the command, {100.0 * beyond:.1f} % beyond any rigid fit"
    )
    clipped = float(np.mean(np.abs(force) > 0.999 * limit))
    recording = MachineRecording(
        generator="scipy_machines",
        kind=kind,
        story=story,
        time_s=np.asarray(np.arange(plant.n) * h, dtype=np.float64),
        position=position,
        command=(force + sensing.command_n) / sensing.newton_per_unit,
        reference=plant.plan.position_m if rng.random() < 0.65 else None,
        position_unit="m",
        command_unit=plant.unit,
        resolution=sensing.step_m,
        friction_shape=shape,
        noise=sensing.noise,
    )
    return recording, effect, beyond, clipped
