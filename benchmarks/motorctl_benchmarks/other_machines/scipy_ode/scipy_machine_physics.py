"""The physics of simulated linear axes, and their stepper: scipy.integrate.ode, sample by sample.

The right-hand side is compiled by numba. The controller's command is held between two samples, the
ODE solver (DOPRI5, DOP853 or LSODA) crosses each sample adaptively. Ideal Coulomb friction is a
hybrid automaton: an event where the speed crosses zero, sticking there, and breaking away.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from scipy.integrate import ode

from motorctl_benchmarks.other_machines.machine_recording import Array
from motorctl_benchmarks.other_machines.scipy_ode.scipy_machine_motion import jit

KINDS: tuple[str, ...] = (
    "none", "gravity_constant", "cogging", "force_ripple", "current_saturation", "command_lag",
    "command_delay", "voltage_clipping", "stribeck", "asymmetric_friction", "quadratic_drag",
    "presliding", "load_friction", "warming_friction", "position_friction", "backlash_motor",
    "backlash_load", "flexible_motor", "flexible_load", "measurement_ripple", "payload_step",
    "position_force", "hard_stop", "drive_hysteresis", "eddy_brake", "unknown_air_dashpot",
    "unknown_brake_release", "unknown_spindle_imbalance", "unknown_winding_heat",
    "unknown_ratchet_pawl",
)  # fmt: skip
(
    NONE, GRAVITY, COGGING, RIPPLE, SATURATION, LAG, DELAY, CLIPPING, STRIBECK, ASYMMETRY, DRAG,
    PRESLIDING, LOAD, WARMING, PLACE, BACKLASH_M, BACKLASH_L, FLEXIBLE_M, FLEXIBLE_L, ENCODER,
    PAYLOAD, SPRING, STOP, HYSTERESIS, EDDY, DASHPOT, BRAKE, SPINDLE, HEAT, PAWL,
) = range(len(KINDS))  # fmt: skip
Method = Literal["dopri5", "dop853", "lsoda"]
SHAPES = ("sign", "tanh", "arctan", "algebraic", "clipped")
SIGN, MEMORY = 0, 5
FRICTIONAL = (STRIBECK, ASYMMETRY, PRESLIDING, LOAD, WARMING, PLACE, BRAKE)
TWO_BODIES = (BACKLASH_M, BACKLASH_L, FLEXIBLE_M, FLEXIBLE_L)
ON_LOAD = (BACKLASH_L, FLEXIBLE_L)

# Indices into the array of a machine's parameters. Forces in N; E0 to E4 belong to the effect.
(
    KIND, MASS, VISC, COUL, SHAPE, WIDTH, OFFSET, FORCE, NOISE, AMP, E0, E1, E2, E3, E4,
    MASS2, VISC2, COUL2, MODE, MODE2, X_HELD,
) = range(21)  # fmt: skip
N_PARAMETERS = 21 + 8
# State: position and speed of motor and load, motor's force, memory.
X, V, X2, V2, F, Z = range(6)


@jit
def shape(v: float, p: Array) -> float:
    """Return Coulomb friction's direction, -1 to 1."""
    y = v / p[WIDTH]
    which = int(p[SHAPE])
    if which == 1:
        return float(np.tanh(y))
    if which == 2:
        return float(np.arctan(y) * 2.0 / np.pi)
    if which == 3:
        return float(y / np.sqrt(1.0 + y * y))
    if which == 4:
        return float(min(max(y, -1.0), 1.0))
    return float(np.sign(v))


@jit
def wave(x: float, p: Array) -> float:
    """Return a function with period E0, of a fundamental and a harmonic."""
    phase = 2.0 * np.pi * x / p[E0]
    return float(np.sin(phase + p[E1]) + p[E2] * np.sin(p[E4] * phase + p[E3]))


@jit
def drive(x: float, v: float, f: float, z: float, p: Array) -> float:
    """Return the motor's force if f is asked, its quick dynamics apart."""
    kind = int(p[KIND])
    if kind == RIPPLE:
        return float(f * (1.0 + p[AMP] * wave(x, p)))
    if kind == SATURATION:
        if p[E0] == 0.0:
            return float(np.tanh(p[AMP] * f) / p[AMP])
        return float(f / (1.0 + p[AMP] * abs(f)))
    if kind == HEAT:
        return float(f / (1.0 + p[AMP] * z))
    if kind == CLIPPING:
        return float(min(max(f, -1.0 / p[AMP] - p[E0] * v), 1.0 / p[AMP] - p[E0] * v))
    return float(f)


@jit
def push(t: float, x: float, v: float, z: float, p: Array) -> float:
    """Return the effect's force on the axis, friction and motor apart."""
    kind, a = int(p[KIND]), p[AMP]
    if kind == GRAVITY:
        return float(-a)
    if kind == COGGING:
        return float(a * wave(x, p))
    if kind == DRAG:
        return float(-a * v * abs(v))
    if kind == SPRING:
        y = (x - p[E0]) / p[E1]
        if p[E2] == 0.0:
            return float(-a * (y + p[E3] * y**3))
        if p[E2] == 1.0:
            return float(-a * np.exp(p[E3] * y))
        return float(a * np.tanh(3.0 * y + p[E3]))
    if kind == STOP:
        return float(-a * max(0.0, x - p[E0]) ** p[E1])
    if kind == EDDY:
        return float(-a * 2.0 * (v / p[E0]) / (1.0 + (v / p[E0]) ** 2))
    if kind == SPINDLE:
        return float(a * np.sin(2.0 * np.pi * p[E0] * t * (1.0 + p[E1] * t) + p[E2]))
    if kind == DASHPOT:
        return float(a * z)
    if kind == PAWL:  # teeth lift the pawl forward, it falls behind each; backward it is free
        part = x / p[E0] - np.floor(x / p[E0])
        tooth = part / 0.85 if part < 0.85 else (1.0 - part) / 0.15
        return float(-a * tooth * 0.5 * (1.0 + np.tanh(v / p[E1])))
    return 0.0


@jit
def grip(t: float, x: float, v: float, f: float, z: float, p: Array) -> float:
    """Return Coulomb friction's level beyond COUL."""
    kind, a = int(p[KIND]), p[AMP]
    if kind == STRIBECK:
        return float(a * np.exp(-(abs(v / p[E0]) ** p[E1])))
    if kind == ASYMMETRY:
        return float(a * (1.0 + p[E0] * abs(v)) * (1.0 if v > 0.0 else -1.0))
    if kind == LOAD:
        return float(a * abs(f))
    if kind == WARMING:
        return float(a * np.exp(-t / p[E0]))
    if kind == PLACE:
        y = (x - p[E0]) / p[E1]
        return float(a * (np.exp(-y * y) if p[E2] == 0.0 else 1.0 / (1.0 + np.exp(-2.0 * y))))
    if kind == BRAKE:
        return float(a * z)
    return 0.0


@jit
def remember(x: float, v: float, f: float, z: float, p: Array) -> float:
    """Return the rate of the memory z, 1/s (of presliding: m/s)."""
    kind = int(p[KIND])
    if kind == HEAT:
        return float(((f / p[E1]) ** 2 - z) / p[E0])
    if kind == DASHPOT:  # relative overpressure of a leaking cylinder
        return float(-1.4 * (1.0 + z) * v / (x - p[E1]) - z / p[E0])
    if kind == BRAKE:
        still = 1.0 / (1.0 + (v / p[E2]) ** 4)
        return float((still - z) / (p[E1] if still > z else p[E0]))
    if kind == PRESLIDING and p[E1] < 2.0:  # Dahl, or LuGre
        return float(v * (1.0 - np.sign(v) * z / p[E0]))
    return 0.0


@jit
def bristles(x: float, v: float, z: float, p: Array) -> float:
    """Return presliding friction, in units of COUL: Dahl (0), LuGre (1) or Maxwell slip (2)."""
    if p[E1] == 2.0:
        total = 0.0
        for j in range(4):
            reach = p[E0] * 0.25 * (j + 1.0)
            total += 0.25 * min(max(p[21 + j] + (x - p[X_HELD]) / reach, -1.0), 1.0)
        return float(total)
    return float(z / p[E0] + p[E2] * remember(x, v, 0.0, z, p))


@jit
def joint(y: Array, p: Array) -> float:
    """Return the force that the motor's body gives to the load's body."""
    kind, d, rate = int(p[KIND]), y[X] - y[X2], y[V] - y[V2]
    if kind in (FLEXIBLE_M, FLEXIBLE_L):
        return float(p[E0] * d + p[E1] * rate)
    depth = abs(d) - 0.5 * p[E2]
    if depth <= 0.0:
        return 0.0
    side = 1.0 if d > 0.0 else -1.0
    return float(side * p[E0] * depth * max(0.0, 1.0 + p[E1] * side * rate))


@jit
def free_force(t: float, y: Array, p: Array, body: int) -> float:
    """Return what acts on a body, Coulomb friction apart."""
    kind = int(p[KIND])
    if body == 1:
        return float(joint(y, p) - p[VISC2] * y[V2])
    f = y[F] if kind in (LAG, CLIPPING) else drive(y[X], y[V], p[FORCE], y[Z], p)
    f += p[OFFSET] + p[NOISE] + push(t, y[X], y[V], y[Z], p) - p[VISC] * y[V]
    if p[MASS2] > 0.0:
        f -= joint(y, p)
    if int(p[SHAPE]) == MEMORY:
        f -= p[COUL] * bristles(y[X], y[V], y[Z], p)
    return float(f)


@jit
def level(t: float, y: Array, p: Array, body: int, way: float) -> float:
    """Return Coulomb friction's level, for motion in direction way."""
    if body == 1:
        return float(p[COUL2])
    v = y[V] if y[V] * way > 0.0 else 1e-9 * way
    return float(p[COUL] + grip(t, y[X], v, drive(y[X], y[V], p[FORCE], y[Z], p), y[Z], p))


@jit
def rates(t: float, y: Array, p: Array) -> Array:
    """Return dy/dt."""
    out = np.zeros(6)
    kind = int(p[KIND])
    for body in range(2 if p[MASS2] > 0.0 else 1):
        v = y[V + 2 * body]
        force = free_force(t, y, p, body)
        if int(p[SHAPE]) == SIGN:
            if p[MODE + body] == 0.0:
                continue
            force -= level(t, y, p, body, p[MODE + body]) * p[MODE + body]
        elif int(p[SHAPE]) != MEMORY:
            force -= level(t, y, p, body, v) * shape(v, p)
        mass = p[MASS2] if body == 1 else p[MASS]
        if kind == PAYLOAD and t >= p[E0]:
            mass *= 1.0 + p[AMP]
        out[X + 2 * body] = v
        out[V + 2 * body] = force / mass
    if kind == LAG:
        out[F] = (p[FORCE] - y[F]) / p[E0]
    elif kind == CLIPPING:  # E0: back-EMF, N s/m; E1: L/R; E2: current loop, rad/s
        top = 1.0 / p[AMP]
        volt = p[FORCE] + p[E0] * y[V] + (p[FORCE] - y[F]) * p[E2] * p[E1]
        out[F] = (min(max(volt, -top), top) - y[F] - p[E0] * y[V]) / p[E1]
    out[Z] = remember(y[X], y[V], p[FORCE], y[Z], p)
    return out


@jit
def lagging(step_n: float, memory: Array, p: Array) -> float:
    """Return what the amplifier's hysteresis eats, N, after its input moved by a step."""
    total, n = 0.0, int(p[E1])
    for j in range(n):  # Prandtl-Ishlinskii: a mean of stops
        reach = p[E0] * p[AMP] * (1.0 if n == 1 else 0.4 + 0.6 * j)
        memory[j] = min(max(memory[j] + step_n / reach, -1.0), 1.0)
        total += memory[j] / n
    return float(p[AMP] * total)


@jit
def effect_along(h: float, x: Array, v: Array, a: Array, f: Array, p: Array) -> float:
    """Return the rms of the effect's force, were the reference followed with the forces f."""
    total, z, last = 0.0, 0.0, 0.0
    memory = np.zeros(4)
    for k in range(x.size):
        t = k * h
        extra = drive(x[k], v[k], f[k], z, p) - f[k] + push(t, x[k], v[k], z, p)
        extra -= grip(t, x[k], v[k], f[k], z, p) * shape(v[k], p)
        if int(p[KIND]) == HYSTERESIS:
            extra -= lagging(f[k] - last, memory, p)
            last = f[k]
        for _ in range(4):
            z += 0.25 * h * remember(x[k], v[k], f[k], z, p)
        total += extra * extra
    return float(np.sqrt(total / x.size))


class Stepper:
    """Carries the state over a sample; finds where ideal friction sticks and lets go."""

    def __init__(self, p: Array, method: Method, h: float) -> None:
        rtol = 1e-5 if p[KIND] == CLIPPING else 1e-6
        options: dict[str, Any] = {"rtol": rtol, "atol": 1e-8, "nsteps": 20000}
        if method != "lsoda":
            options["first_step"] = 0.999 * h
        self.p, self.hybrid = p, int(p[SHAPE]) == SIGN
        self.bodies = (0, 1) if p[MASS2] > 0.0 else (0,)
        self.solver = ode(rates).set_integrator(method, **options).set_f_params(p)

    def smooth(self, y: Array, t: float, end: float) -> Array:
        """Return the state at the end, modes unchanged."""
        self.solver.set_initial_value(y, t)
        out: Array = self.solver.integrate(end)
        if not self.solver.successful():
            raise RuntimeError(f"the ODE solver failed at {t:.6f} s")
        return out

    def advance(self, y: Array, t: float, end: float) -> Array:
        """Return the state at the end."""
        if not self.hybrid:
            return self.smooth(y, t, end)
        p, v_of, y = self.p, (V, V2), y.copy()
        for _ in range(12):
            for b in self.bodies:
                if p[MODE + b] * y[v_of[b]] < 0.0:  # crossed with the other's event
                    y[v_of[b]], p[MODE + b] = 0.0, 0.0
                if p[MODE + b] == 0.0:
                    force = free_force(t, y, p, b)
                    if abs(force) > level(t, y, p, b, np.sign(force)):
                        p[MODE + b] = np.sign(force)
            new = self.smooth(y, t, end)
            crossed = [b for b in self.bodies if p[MODE + b] * new[v_of[b]] < 0.0]
            if not crossed:
                return new
            body, part = crossed[0], 1.0
            for b in crossed:
                v0, v1 = y[v_of[b]], new[v_of[b]]
                if v0 / (v0 - v1) < part:
                    body, part = b, v0 / (v0 - v1)
            index, left, right = v_of[body], 0.0, 1.0
            v_left, v_right, at = y[index], new[index], y
            for _ in range(6):  # regula falsi
                if part * (end - t) < 1e-9:
                    at, part = y, 0.0
                    break
                at = self.smooth(y, t, t + part * (end - t))
                if abs(at[index]) < 1e-8:
                    break
                if at[index] * v_left > 0.0:
                    left, v_left = part, at[index]
                else:
                    right, v_right = part, at[index]
                part = left + (right - left) * v_left / (v_left - v_right)
            y = at.copy()
            t += part * (end - t)
            y[index], p[MODE + body] = 0.0, 0.0
            if end - t < 1e-9:
                return y
        for b in self.bodies:  # it trembles: hold for the rest of the sample what hardly moves
            p[MODE + b] = np.sign(y[v_of[b]]) if abs(y[v_of[b]]) > 1e-5 else 0.0
            y[v_of[b]] *= abs(p[MODE + b])
        return self.smooth(y, t, end)
