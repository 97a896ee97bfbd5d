"""The effects that the generator mujoco_machines can put into a machine, and how strong they are.

Each effect changes a plan of a machine: MuJoCo elements (gravity, springs, tendons, limits, fluid,
actuator dynamics, further bodies), or numbers of a formula in mujoco_axis; it returns a sentence on
what it did. "unit" is m or rad; forces are in N or N m.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from motorctl_benchmarks.other_machines.mujoco import mujoco_axis as ax
from motorctl_benchmarks.other_machines.mujoco.mujoco_axis import Array
from motorctl_benchmarks.other_machines.mujoco.mujoco_plan import GRAVITY, Plan


def _point(x: float, mass: float, z: float = 0.0, spin: float = 1e-9) -> str:
    """Return MuJoCo's words for a mass that is nearly a point, or of this rotary inertia."""
    return f'<inertial pos="{x} 0 {z}" mass="{mass}" diaginertia="{spin} {spin} {spin}"/>'


def _none(_: Plan) -> str:
    return "nothing else"


def _gravity_constant(m: Plan) -> str:
    force = m.rng.uniform(0.3, 1.2) * m.rms
    weight = m.inertia * GRAVITY
    comp = max(0.0, 1 - force / weight)
    m.axis, m.held = "0 0 1", True
    m.xml["body"] = f'gravcomp="{comp}"'
    m.effect = np.full(m.asked.size, (comp - 1) * weight)
    return f"net weight {(1 - comp) * weight:.3g} N ({100 * comp:.0f} % counterweight)"


def _gravity_sine(m: Plan) -> str:
    place = m.path[:, 1]
    phase = m.rng.uniform(-np.pi, np.pi)
    torque = m.solve(lambda s: -s * np.sin(place + phase), 1e-3 * m.rms, 3 * m.rms)
    radius = min(0.3, 0.9 * m.inertia * GRAVITY / torque)
    mass = torque / (GRAVITY * radius)
    # axis +y turns x towards -z; the mass hangs down where place + phase = 0
    x, z = -radius * np.sin(phase), -radius * np.cos(phase)
    m.axis, m.held = "0 1 0", True
    m.xml["joint"] = f'armature="{m.inertia - mass * radius**2}"'
    m.xml["inertial"] = _point(x, mass, z)
    return f"{mass:.3g} kg at {radius:.3g} m from a horizontal axis ({torque:.3g} N m)"


def _periodic(code: int, what: str, relative: bool) -> Callable[[Plan], str]:
    def effect(m: Plan) -> str:
        second = m.rng.uniform(0, 0.5) if m.rng.random() < 0.5 else 0.0
        p = [m.period(), m.rng.uniform(0, 6.28), second, m.rng.uniform(0, 6.28)]
        top = 0.6 if relative else 3 * m.rms
        size = m.formula(code, p, 1e-3 * top, top)
        return f"{what} of {size:.3g}{'' if relative else ' (N or N m)'} every {p[0]:.4g} unit"

    return effect


def _current_saturation(m: Plan) -> str:
    knee = m.rng.uniform(1.0, 3.5)
    size = m.formula(ax.SATURATION, [knee], 0.05 / m.rms, 0.8 / np.abs(m.asked).max())
    return f"force saturating towards {1 / size:.3g} with knee exponent {knee:.2f}"


def _voltage_clipping(m: Plan) -> str:
    peak = np.abs(m.asked).max()
    back = m.rng.uniform(0.8, 2.0) * peak / m.speed
    m.share *= 0.1
    size = m.formula(ax.CLIPPING, [back], 0.1 / peak, 3 / peak)
    return f"force limited to {1 / size:.3g} - {back:.3g} * speed (supply voltage)"


def _drive_hysteresis(m: Plan) -> str:
    plays = m.rng.random() < 0.5
    reach = m.rng.uniform(0.08, 0.25) * m.rms if plays else m.rng.uniform(0.3, 0.8) * m.rms
    size = m.formula(ax.HYSTERESIS, [reach, float(plays)], 0.02, 0.55 if plays else 0.45)
    model = "four plays" if plays else "a Duhem loop"
    return f"amplifier hysteresis, {model} of reach {reach:.3g} and weight {size:.2f}"


def _command_lag(m: Plan) -> str:
    m.share = min(m.share, 0.15)
    tau = m.solve(
        lambda s: m.filtered(m.asked, lambda w: 1 / (1 + 1j * w * s) - 1),
        1 / (2 * np.pi * 300),
        1 / (2 * np.pi * 30),
    )
    m.xml["actuator"] = f'dyntype="filterexact" dynprm="{tau}"'
    m.pole_limit = 0.18 / tau
    return f"current loop of {1 / (2 * np.pi * tau):.0f} Hz"


def _command_delay(m: Plan) -> str:
    ts = 1 / m.rate_hz
    least = m.solve(lambda s: m.filtered(m.asked, lambda w: np.exp(-1j * w * s) - 1), ts, 8 * ts)
    m.delay = int(np.clip(np.ceil(least / ts), 1, 8))
    m.pole_limit = 0.18 / (m.delay * ts)
    return f"command {m.delay} samples ({1e3 * m.delay * ts:.1f} ms) late"


def _stribeck(m: Plan) -> str:
    p = [m.between(0.02, 0.1) * m.speed + 2 * m.width, float(m.rng.choice([1.0, 2.0]))]
    size = m.formula(ax.STRIBECK, p, 0.05, 1.5)
    return f"static friction {1 + size:.2f} times Coulomb, Stribeck speed {p[0]:.3g}"


def _asymmetric_friction(m: Plan) -> str:
    # beside a constant offset it shows in rests and slow motion only, so its size is drawn
    size = float(m.rng.choice([-1.0, 1.0])) * m.rng.uniform(0.25, 0.7)
    m.code, m.p[0], m.p[1] = ax.ASYMMETRIC, size, 1e-4 * m.speed
    return f"Coulomb {m.coulomb * (1 + size):.3g} forward, {m.coulomb * (1 - size):.3g} backward"


def _load_friction(m: Plan) -> str:
    size = m.formula(ax.LOADED, [0.0], 0.02, 0.45)
    return f"friction grows by {size:.2f} of the motor's force"


def _warming_friction(m: Plan) -> str:
    tau = m.rng.uniform(0.15, 0.6) * m.path[-1, 0]
    size = m.formula(ax.WARMING, [tau], 0.1, 3)
    return f"friction starts {1 + size:.2f} times as high and warms within {tau:.1f} s"


def _position_friction(m: Plan) -> str:
    what = int(m.rng.integers(3))
    centre = m.limits[0] + m.rng.uniform(0.25, 0.75) * m.travel
    wide = m.travel * m.rng.uniform(*((0.06, 0.2), (0.02, 0.1), (0.4, 0.6))[what])
    size = m.formula(ax.PLACE, [centre, wide, float(what)], 0.1, 4)
    where = ("a tight spot", "a tighter part", "tighter ends")[what]
    return f"{where}: friction up to {1 + size:.2f} times, at {centre:.3g}, width {wide:.3g} unit"


def _presliding(m: Plan) -> str:
    model = int(m.rng.integers(3))
    m.code = ax.PRESLIDING
    stiff = m.coulomb / m.p[1]
    bristle = m.rng.uniform(0.1, 0.5) * np.sqrt(stiff * m.inertia)
    m.p[2:4] = bristle, model
    m.shape = 0
    return f"{('Dahl', 'LuGre', 'Maxwell slip')[model]} friction of reach {m.p[1]:.3g} unit"


def _quadratic_drag(m: Plan) -> str:
    v = m.path[:, 2]
    size = m.solve(lambda s: -s * v * np.abs(v), 1e-3 * m.rms / m.speed**2, 9 * m.rms / m.speed**2)
    m.drag = size
    return f"air drag {size:.3g} * speed**2"


def _eddy_brake(m: Plan) -> str:
    at = m.rng.uniform(0.12, 0.4) * m.speed
    size = m.formula(ax.EDDY, [at], 1e-2 * m.rms, 3 * m.rms)
    return f"eddy-current brake, {size:.3g} at {at:.3g} unit/s"


def _measurement_ripple(m: Plan) -> str:
    period = m.rng.uniform(0.06, 0.2) * m.travel
    if m.name == "wheel":
        period = 2 * np.pi / int(m.rng.integers(1, 5))
    m.code = ax.ENCODER
    m.p[1:5] = (period, m.rng.uniform(0, 6.28), m.rng.uniform(0, 0.3), m.rng.uniform(0, 6.28))
    wave = np.sin(2 * np.pi * m.path[:, 1] / period + m.p[2])
    ts = m.path[1, 0]
    bent = m.inertia * np.gradient(np.gradient(wave)) / ts**2
    size = m.solve(lambda s: s * bent, 1e-5 * period, 0.02 * period)
    m.p[0] = size
    return f"encoder error of {size:.3g} every {period:.3g} unit"


def _payload_step(m: Plan) -> str:
    extra = m.rng.uniform(0.25, 0.9) * m.inertia
    when = int(m.rng.uniform(0.35, 0.65) * m.reference.shape[0])
    radius = np.sqrt(m.inertia) if m.rotary else 1.0
    mass = extra / radius**2
    before, after = (1e-6 * mass, mass) if m.rng.random() < 0.5 else (mass, 1e-6 * mass)
    m.xml["inside"] = f'<body name="p">{_point(radius if m.rotary else 0, before)}</body>'
    m.payload = (when, after)
    verb = "taken up" if after > before else "set down"
    return f"payload of inertia {extra:.3g} {verb} at {when / m.rate_hz:.1f} s"


def _position_force(m: Plan) -> str:
    place = m.path[:, 1]
    middle = m.limits[0] + m.rng.uniform(-0.1, 1.1) * m.travel
    m.held = True
    if m.rng.random() < 0.4:
        size = m.solve(
            lambda s: -s * (place - middle), 1e-2 * m.rms / m.travel, 9 * m.rms / m.travel
        )
        m.xml["joint"] = f'stiffness="{size}" springref="{middle}"'
        return f"spring of {size:.3g} with rest at {middle:.3g} unit"
    middle = m.limits[0] + m.rng.uniform(0.2, 0.8) * m.travel
    aside = m.rng.uniform(0.1, 0.4) * m.travel
    length, slope = _strut(m, place, middle, aside)
    rest = m.rng.uniform(0.0, 1.0) * float(length.max())
    size = m.solve(
        lambda s: -s * (length - rest) * slope, 1e-3 * m.rms / m.travel, 99 * m.rms / m.travel
    )
    m.xml["tendon"] = f'stiffness="{size}" springlength="{rest}"'
    return f"slanted spring of {size:.3g} N/m, free length {rest:.3g} m, anchored by {middle:.3g}"


def _strut(m: Plan, place: Array, middle: float, aside: float) -> tuple[Array, Array]:
    """Return the length of a strut to the machine and its slope; set its sites in MuJoCo."""
    if m.rotary:  # from an arm of 0.3 m to a pivot 0.5 m from the axis, nearest at middle
        m.xml["inside"] = '<site name="arm" pos="0.3 0 0"/>'
        pivot = f"{0.5 * np.cos(middle)} {0.5 * np.sin(middle)} 0"
        m.xml["world"] = f'<site name="anchor" pos="{pivot}"/>'
        length = np.sqrt(0.34 - 0.3 * np.cos(place - middle))
        return length, 0.15 * np.sin(place - middle) / length
    m.xml["inside"] = '<site name="arm" pos="0 0 0"/>'
    m.xml["world"] = f'<site name="anchor" pos="{middle} {aside} 0"/>'
    length = np.hypot(place - middle, aside)
    return length, (place - middle) / length


def _hard_stop(m: Plan) -> str:
    at_end = m.rng.random() < 0.5
    part = m.rng.uniform(0.06, 0.18) * m.travel
    stop = m.limits[1] - part if at_end else m.limits[0] + part
    inward = m.path[:, 1] - stop if at_end else stop - m.path[:, 1]
    deep = np.maximum(inward, 0.0)
    sign = -1.0 if at_end else 1.0
    size = m.solve(lambda s: sign * s * deep, 0.1 * m.rms / m.travel, 200 * m.rms / m.travel)
    # MuJoCo's soft limit of impedance d is a spring of solref / (1 - d) per inertia
    d = 0.03
    k, b = size / m.inertia * (1 - d), 0.1 * np.sqrt(size / m.inertia)
    reach = f"-99 {stop}" if at_end else f"{stop} 99"
    m.xml["joint"] = (
        f'limited="true" range="{reach}" solreflimit="{-k} {-b}" solimplimit="{d} {d} 0.001 0.5 2"'
    )
    return f"elastic stop of {size:.3g} per unit {'above' if at_end else 'below'} {stop:.4g} unit"


def _two_bodies(m: Plan, at_load: bool) -> float:
    """Return the load's inertia: split the machine into a motor and a load."""
    m.motor_share = m.rng.uniform(0.3, 0.65)
    m.load_inertia = (1 - m.motor_share) * m.inertia
    m.encoder = int(at_load)
    return m.load_inertia


def _flexible(at_load: bool) -> Callable[[Plan], str]:
    def effect(m: Plan) -> str:
        load = _two_bodies(m, at_load)
        zeta = m.rng.uniform(0.03, 0.1)

        def force(tau: float) -> Array:
            def lead(w: Array) -> Any:
                x = w * tau
                soft = 1 + 2j * zeta * x
                return soft / (soft - x * x) - 1

            return -load * m.filtered(m.accels, lead)

        tau = m.solve(force, 1 / (2 * np.pi * m.between(7, 20)), 1 / (2 * np.pi * 3))
        stiffness = load / tau**2
        damping = 2 * zeta * load / tau
        m.xml["tendon"] = f'stiffness="{stiffness}" damping="{damping}" springlength="0"'
        m.pole_limit = (0.09 if at_load else 0.35) / tau
        return (
            f"load of {load:.3g} on a spring of {stiffness:.3g} per unit "
            f"({1 / (2 * np.pi * tau):.1f} Hz with motor held), encoder on the "
            f"{'load' if at_load else 'motor'}"
        )

    return effect


def _backlash(at_load: bool) -> Callable[[Plan], str]:
    def effect(m: Plan) -> str:
        load = _two_bodies(m, at_load)
        gap = m.between(0.002, 0.012) * m.travel * (0.5 if at_load else 1.0)
        m.xml["tendon"] = (
            f'limited="true" range="{-gap / 2} {gap / 2}" '
            'solimplimit="0.95 0.95 0.001 0.5 2" '
            f'solreflimit="{m.between(0.0015, 0.005)} {m.rng.uniform(0.4, 1.0)}"'
        )
        m.pole_limit = 6.5 if at_load else 60.0
        return (
            f"gap of {gap:.3g} unit before a load of {load:.3g}, encoder on the "
            f"{'load' if at_load else 'motor'}"
        )

    return effect


def _slipping(m: Plan) -> str:
    """Cargo sliding between a tray's walls, or a flywheel behind a slipping clutch."""
    mass = m.rng.uniform(*((0.4, 0.65) if m.rotary else (0.2, 0.4))) * m.inertia
    slip = m.rng.uniform(*((0.1, 0.3) if m.rotary else (0.25, 0.5))) * m.accel
    m.main_inertia = m.inertia - mass
    wall = m.rng.uniform(0.03, 0.15) * m.travel
    kind = "hinge" if m.rotary else "slide"
    walls = (
        ""
        if m.rotary
        else (
            f'limited="true" range="{-wall} {wall}" solreflimit="0.04 1.2" '
            'solimplimit="0.9 0.9 0.001 0.5 2"'
        )
    )
    cargo = _point(0.0, 1.0, spin=mass) if m.rotary else _point(0.0, mass)
    m.xml["inside"] = (
        f'<body name="c"><joint name="c" type="{kind}" axis="{m.axis}" {walls} '
        f'frictionloss="{mass * slip}" solreffriction="{4 * m.step_s} 1" '
        f'solimpfriction="0.9999 0.9999 0.001 0.5 2"/>{cargo}</body>'
    )
    where = "behind a clutch" if m.rotary else f"loose on a tray, {2 * wall:.3g} m between walls"
    return f"{mass:.3g} of its inertia {where} and slips from {slip:.3g} unit/s**2 on"


def _unbalance(m: Plan) -> str:
    omega = 2 * np.pi * m.rng.uniform(2.0, 9.0)
    t = m.path[:, 0]
    size = m.solve(lambda s: s * np.sin(omega * t), 1e-2 * m.rms, 3 * m.rms)
    radius = m.rng.uniform(0.1, 0.3)
    mass = size / omega**2 / radius
    if mass > 0.5 * m.inertia:
        radius, mass = radius * mass / (0.5 * m.inertia), 0.5 * m.inertia
    m.main_inertia = m.inertia - mass
    spin = mass * radius**2
    m.xml["inside"] = (
        f'<body name="c"><joint name="c" type="hinge" axis="0 0 1"/>{_point(radius, mass)}</body>'
    )
    m.xml["second_actuator"] = f'<velocity joint="c" kv="{20 * spin}"/>'
    drift = m.rng.uniform(0.02, 0.15) * np.sin(
        m.rng.uniform(0.1, 0.5) * np.arange(m.reference.shape[0]) / m.rate_hz
    )
    m.second = omega * (1 + drift)
    m.start = (m.rng.uniform(0, 6.28), omega)
    return f"a spindle aboard turns {mass:.3g} kg at {radius:.3g} m with {omega / 6.283:.1f} Hz"


def _second_joint(m: Plan) -> str:
    part, ratio, arm = m.rng.uniform(0.4, 0.75), m.rng.uniform(0.5, 0.8), 0.4
    mass = part * m.inertia / (arm**2 * (1 + ratio**2))
    m.main_inertia = (1 - part) * m.inertia
    spin = mass * (ratio * arm) ** 2
    m.xml["inside"] = (
        f'<body name="c" pos="{arm} 0 0"><joint name="c" type="hinge" axis="0 0 1" '
        f'armature="{0.05 * spin}" damping="{0.1 * spin}"/>{_point(ratio * arm, mass)}</body>'
    )
    pole = 2 * np.pi * m.rng.uniform(4, 9)
    servo = f'kp="{spin * pole**2}" kv="{1.4 * spin * pole}"'
    m.xml["second_actuator"] = f'<position joint="c" {servo}/>'
    quick = min(m.rng.uniform(0.25, 0.5) * m.speed, 3.0)
    track, what = ax.programme(
        m.rng,
        (-0.2, m.rng.uniform(1.6, 2.6)),
        quick,
        m.accel * 0.3,
        m.rate_hz,
        m.path[-1, 0] + 1,
        "even",
        0.0,
    )
    m.second = track[: m.reference.shape[0], 0]
    m.start = (float(m.second[0]), 0.0)
    return f"an elbow with {mass:.3g} kg at {ratio * arm:.2f} m moves by its own programme ({what})"


def _linkage(m: Plan) -> str:
    place, v = m.path[:, 1], m.path[:, 2]
    middle = m.limits[0] + m.rng.uniform(0.2, 0.8) * m.travel
    aside = m.rng.uniform(0.1, 0.3) * m.travel
    slope = _strut(m, place, middle, aside)[1]
    tiny = 1e-5 * m.travel
    bend = (_strut(m, place + tiny, middle, aside)[1] - slope) / tiny
    size = m.solve(
        lambda s: -s * slope * (slope * m.accels + bend * v * v), 0.02 * m.inertia, 50 * m.inertia
    )
    m.xml["tendon"] = f'armature="{size}"'
    return f"a flywheel of {size:.3g} kg behind a linkage with its pivot by {middle:.3g} unit"


EFFECTS: dict[str, Callable[[Plan], str]] = {
    "none": _none,
    "gravity_constant": _gravity_constant,
    "gravity_sine": _gravity_sine,
    "cogging": _periodic(ax.COGGING, "cogging", False),
    "force_ripple": _periodic(ax.RIPPLE, "ripple of the force constant", True),
    "current_saturation": _current_saturation,
    "command_lag": _command_lag,
    "command_delay": _command_delay,
    "voltage_clipping": _voltage_clipping,
    "stribeck": _stribeck,
    "asymmetric_friction": _asymmetric_friction,
    "quadratic_drag": _quadratic_drag,
    "presliding": _presliding,
    "load_friction": _load_friction,
    "warming_friction": _warming_friction,
    "position_friction": _position_friction,
    "backlash_motor": _backlash(False),
    "backlash_load": _backlash(True),
    "flexible_motor": _flexible(False),
    "flexible_load": _flexible(True),
    "measurement_ripple": _measurement_ripple,
    "payload_step": _payload_step,
    "position_force": _position_force,
    "hard_stop": _hard_stop,
    "drive_hysteresis": _drive_hysteresis,
    "eddy_brake": _eddy_brake,
    "unknown_sliding_cargo": _slipping,
    "unknown_slipping_clutch": _slipping,
    "unknown_spindle_unbalance": _unbalance,
    "unknown_second_joint": _second_joint,
    "unknown_linkage_inertia": _linkage,
}
