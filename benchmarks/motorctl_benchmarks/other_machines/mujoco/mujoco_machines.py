"""A generator of recordings of servo axes that the rigid-body engine MuJoCo 4 integrates (Euler).

Robot joints, gantry carriages, lifts, carts and wheels. Joints, friction loss, damping, armature,
gravity, springs, tendons, limits, fluid drag and actuators are MuJoCo's own; other effects are
forces computed per step (mujoco_axis); mujoco_effects holds the effects, mujoco_plan the plan of a
machine. "unit" is m or rad; forces are in N or N m.
"""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np

from motorctl_benchmarks.other_machines.machine_recording import MachineRecording
from motorctl_benchmarks.other_machines.mujoco import mujoco_axis as ax
from motorctl_benchmarks.other_machines.mujoco.mujoco_axis import Array, mujoco
from motorctl_benchmarks.other_machines.mujoco.mujoco_effects import EFFECTS
from motorctl_benchmarks.other_machines.mujoco.mujoco_plan import GRAVITY, ROTARY, Plan

KINDS: tuple[str, ...] = tuple(EFFECTS)
_MACHINES = {  # inertia, travel, top speed, top acceleration: from, to
    "gantry carriage": ((2, 40), (0.15, 1.2), (0.2, 1.5), (2, 12)),
    "cart": ((20, 400), (1.0, 6.0), (0.5, 2.5), (0.8, 4)),
    "lift": ((5, 300), (0.4, 3.0), (0.3, 1.5), (1, 4)),
    "robot joint": ((0.02, 5), (1.8, 4.5), (1.5, 6), (8, 50)),
    "wheel": ((0.002, 0.5), (6, 40), (5, 30), (30, 200)),
}
_FLAT = ("gantry carriage", "cart")
_ONLY = {  # machines that may have an effect; all but a lift where not said
    "gravity_constant": ("lift",),
    "gravity_sine": ROTARY,
    "unknown_sliding_cargo": _FLAT,
    "unknown_slipping_clutch": ROTARY,
    "unknown_spindle_unbalance": _FLAT,
    "unknown_second_joint": ("robot joint",),
    "unknown_linkage_inertia": (*_FLAT, "robot joint"),
    "position_force": (*_FLAT, "robot joint"),
    "hard_stop": (*_FLAT, "robot joint"),
    "position_friction": (*_FLAT, "robot joint"),
} | {
    kind: tuple(_MACHINES)
    for kind in (
        "none",
        "cogging",
        "force_ripple",
        "stribeck",
        "warming_friction",
        "load_friction",
        "current_saturation",
        "voltage_clipping",
        "command_lag",
        "command_delay",
    )
}
_FRICTIONS = (
    "stribeck",
    "asymmetric_friction",
    "presliding",
    "warming_friction",
    "position_friction",
)
_MOODS = (
    dict.fromkeys(
        ("stribeck", "asymmetric_friction", "presliding", "eddy_brake", "load_friction"), "slow"
    )
    | dict.fromkeys(
        (
            "command_lag",
            "command_delay",
            "flexible_motor",
            "flexible_load",
            "backlash_motor",
            "backlash_load",
            "current_saturation",
            "unknown_sliding_cargo",
            "unknown_slipping_clutch",
            "drive_hysteresis",
            "payload_step",
        ),
        "brisk",
    )
    | {"hard_stop": "ends"}
)
_TWO_BODIES = ("backlash", "flexible", "unknown")


def _plan(rng: np.random.Generator, kind: str, friction: int | None) -> Plan:
    """Return a machine with only inertia, friction and offset drawn."""
    names = _ONLY.get(kind, (*_FLAT, *ROTARY))
    name = str(rng.choice(names))
    ranges = _MACHINES[name]
    inertia, travel, speed, accel = (float(np.exp(rng.uniform(*np.log(r)))) for r in ranges)
    travel = min(travel, 2.0 * speed, 1.5 * accel)
    if kind == "gravity_sine":
        travel = max(travel, 3.0)
    speed = min(speed, 0.8 * np.sqrt(travel * accel))
    low = float(rng.choice([0.0, -travel / 2, rng.uniform(-1, 0) * travel]))
    weight = inertia * accel
    # with true stiction nothing tells asymmetric friction from an offset
    shape = int(rng.integers(kind == "asymmetric_friction", 5))
    shape = shape if friction is None else friction
    width = rng.uniform(0.005, 0.03) * speed
    if name not in ROTARY:
        width = float(np.exp(rng.uniform(np.log(0.0005), np.log(0.01))))
    rates: tuple[int, ...] = (500, 800, 1000, 1250, 2000, 2500, 4000, 5000)
    if kind in ("command_delay", "command_lag"):
        rates = rates[:4] if kind == "command_delay" else rates[2:6]
    rate_hz = int(rng.choice(rates))
    steps = max(3, int(np.ceil(6000 / rate_hz)))
    coulomb = weight * (rng.uniform(0.2, 0.45) if kind in _FRICTIONS else rng.uniform(0.05, 0.28))
    plan = Plan(
        rng=rng,
        name=name,
        inertia=inertia,
        limits=(low, low + travel),
        speed=speed,
        accel=accel,
        coulomb=coulomb,
        viscous=weight / speed * rng.uniform(0.04, 0.22),
        offset=weight * rng.uniform(-0.08, 0.08),
        shape=shape,
        width=width if shape else 1e-9,
        rate_hz=rate_hz,
        step_s=1.0 / (rate_hz * steps),
        share=float(np.exp(rng.uniform(np.log(0.06), np.log(0.3)))),
    )
    plan.main_inertia = inertia
    plan.axis = "1 0 0" if name in _FLAT else "0 0 1"
    if name == "lift":
        plan.xml["body"] = 'gravcomp="1"'
    return plan


def _sensor(m: Plan, noise: int) -> float:
    """Return the encoder's step."""
    fine = m.between(1e-4, 3e-4) if noise == 3 else m.between(3e-7, 1.2e-5)
    step = fine * m.travel
    if m.rotary:
        return float(2 * np.pi / np.ceil(2 * np.pi / step))
    if noise == 3:
        return float(f"{step:.1e}")
    decade = 10.0 ** np.floor(np.log10(step))
    return float(decade * max(x for x in (1, 2, 5) if x * decade <= step * 1.0001))


def _drive_path(m: Plan, duration_s: float, mood: str, micro: float) -> str:
    """Set the reference and the nominal path and force; return the programme's name."""
    m.reference, style = ax.programme(
        m.rng, m.limits, m.speed, m.accel, m.rate_hz, duration_s, mood, micro
    )
    few = max(1, m.rate_hz // 500)
    r = m.reference[::few]
    time_s = np.arange(r.shape[0]) * (few / m.rate_hz)
    m.path = np.ascontiguousarray(np.stack([time_s, r[:, 0], r[:, 1]], axis=1))
    sign = np.array([ax.shaped(m.shape, x, m.width)[0] for x in r[:, 1]])
    m.accels = r[:, 2].copy()
    m.asked = m.inertia * m.accels + m.viscous * r[:, 1] + m.coulomb * sign - m.offset
    m.effect = np.zeros_like(m.asked)
    return style


def _model(m: Plan) -> Any:
    """Return MuJoCo's model of the planned machine."""

    def inertial(value: float) -> str:
        turn = f"{value} {value} {value}" if m.rotary else " ".join([f"{value * 0.01}"] * 3)
        mass = 1.0 if m.rotary else value
        return f'<inertial pos="0 0 0" mass="{mass}" diaginertia="{turn}"/>'

    def joint(name: str, more: str) -> str:
        return (
            f'<joint name="{name}" type="{"hinge" if m.rotary else "slide"}" axis="{m.axis}" '
            f'solreffriction="{4 * m.step_s} 1" solimpfriction="0.9999 0.9999 0.001 0.5 2" '
            f"{more}/>"
        )

    strut = m.xml["tendon"] and not m.load_inertia
    load, ropes = "", ""
    if m.load_inertia:
        load = f'<body name="b">{joint("b", "")}{inertial(m.load_inertia)}</body>'
        ropes = (
            f'<fixed {m.xml["tendon"]}><joint joint="a" coef="1"/><joint joint="b" coef="-1"/>'
            "</fixed>"
        )
    elif strut:
        ropes = f'<spatial {m.xml["tendon"]}><site site="anchor"/><site site="arm"/></spatial>'
    drive = m.xml["actuator"] or 'dyntype="none"'
    first = m.xml["inertial"] or inertial(m.main_inertia * m.motor_share)
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><compiler angle="radian"/>
<option timestep="{m.step_s}" gravity="0 0 {-GRAVITY}" integrator="Euler"
 density="{float(m.drag > 0)}">
<flag contact="disable"/></option>
<worldbody>{m.xml["world"]}<body name="a" {m.xml["body"]}>{joint("a", m.xml["joint"])}
{first}{m.xml["inside"]}</body>{load}</worldbody>
<tendon>{ropes}</tendon>
<actuator><general joint="a" {drive}/>{m.xml["second_actuator"]}</actuator></mujoco>""")
    if m.drag:  # make MuJoCo's fluid as dense as that drag needs
        data = mujoco.MjData(model)
        data.qvel[0] = 1.0
        mujoco.mj_forward(model, data)
        model.opt.density = -m.drag / float(data.qfrc_fluid[0])
    return model


def _gains(m: Plan, law: int, jitter: float) -> Array:
    """Return the controller's numbers; jitter: a jump of the encoder that must stay quiet."""
    rng = m.rng
    peak = float(np.abs(m.asked - m.effect).max())
    loud = (25.0, 11.0, 12.0, 11.0)[law]
    quiet = np.sqrt(0.12 * m.rms / (m.inertia * jitter * loud))
    pole = max(2.0, min(2 * np.pi * m.between(2.5, 15), quiet, m.pole_limit, 0.04 * m.rate_hz))
    weak = pole < 20 or rng.random() < 0.5
    feed_a = rng.uniform(0.9, 1.05) if weak or law == 3 else rng.choice([0.0, 0.7, 1.0])
    feed_v = 1.0 if weak else rng.uniform(0.8, 1.0)
    hold = -m.offset * rng.uniform(0.8, 1.1) - (m.effect[0] if m.held else 0.0)
    viscous = m.viscous * rng.uniform(0.7, 1.2) if weak or law == 3 else 0.0
    coulomb = m.coulomb * rng.uniform(0.5, 0.95) if weak or law == 3 else 0.0
    filter_pole = pole * (10.0 if law == 0 else 6.0)
    integral = rng.uniform(0.1, 0.4) * (0.3 if m.xml["tendon"] else 1.0)
    return np.array(
        [
            m.inertia * rng.uniform(0.85, 1.15),
            pole,
            feed_v,
            feed_a,
            viscous,
            coulomb,
            m.speed * rng.uniform(0.005, 0.03),
            hold,
            1 - np.exp(-filter_pole / m.rate_hz),
            (1.25 if m.code == ax.CLIPPING else 3.0) * peak + abs(hold),
            integral,
            rng.uniform(0.7, 1.1),
        ]
    )


def machine(
    kind: str, seed: int, friction: int | None = None, noise: int | None = None
) -> MachineRecording:
    """Return a recording of a machine of this kind, the same for the same seed.

    Which friction (an index into SHAPES) and which noise it has is drawn, if it is not given.
    """
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed])
    drawn = int(rng.integers(4))
    noise = drawn if noise is None else noise
    for _ in range(8):  # until a machine and a programme in which the effect shows
        m = _plan(rng, kind, friction)
        resolution = _sensor(m, noise)
        sigma = m.travel * m.between(2e-6, 3e-5) if noise == 1 else 0.0
        rate_steps = 1 / m.step_s
        budget = 420_000 if kind.startswith(_TWO_BODIES) else 560_000
        duration_s = float(np.clip(rng.uniform(15, 40), 15, max(15.0, budget / rate_steps)))
        micro = 0.0
        if kind == "presliding":
            m.p[1] = max(8 * resolution, 6 * sigma, m.between(3e-4, 3e-3) * m.travel)
            micro, m.shape, m.width = 2.2 * m.p[1], 0, 1e-9
        style = _drive_path(m, duration_s, _MOODS.get(kind, "even"), micro)
        effect = EFFECTS[kind](m)
        if m.reached * m.share > (0.05 if m.share > 0.05 else 0.7 * m.share):
            break
    law = int(rng.integers(len(ax.CONTROLLERS)))
    gains = _gains(m, law, max(resolution, 3 * sigma))
    model = _model(m)

    count = m.reference.shape[0]
    disturbance = np.zeros((count, 3))
    disturbance[:, 0] = sigma * rng.standard_normal(count)
    coloured = np.zeros(count)
    if noise == 2:
        coloured = _coloured(m, count)
    on_force = rng.random() < 0.5
    disturbance[:, 1] = coloured if on_force else 0.0
    if m.second.size == count:
        disturbance[:, 2] = m.second
    bodies = 2 if m.load_inertia else 1
    split = np.array([m.motor_share, 1 - m.motor_share]) if bodies == 2 else np.ones(1)
    payload = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "p")
    codes = (
        m.code,
        m.shape,
        m.encoder,
        law,
        round(rate_steps / m.rate_hz),
        m.delay,
        max(payload, 0),
        m.payload[0],
    )
    numbers = (m.step_s, m.width, resolution, m.offset, m.payload[1])
    at = float(m.reference[0, 0])
    second = at if m.load_inertia else m.start[0]
    start = np.array([at, second, 0.0, m.start[1]] if model.nq == 2 else [at, 0.0])
    position, asked = ax.run(
        model,
        m.reference,
        disturbance,
        codes,
        numbers,
        m.p,
        m.coulomb * split,
        m.viscous * split,
        gains,
        start,
    )
    constant, unit = _scale(m)
    recorded = asked if on_force else asked + coloured
    shape = ax.SHAPES[m.shape] if kind != "presliding" else "presliding"
    letter = "rad" if m.rotary else "m"
    story = (
        f"{m.name}, inertia {m.inertia:.3g}, travel {m.travel:.3g} {letter} up to {m.speed:.3g} "
        f"{letter}/s, {m.accel:.3g} {letter}/s^2; Coulomb {m.coulomb:.3g} ({shape}"
        f"{f', width {m.width:.2g} {letter}/s' if m.shape else ''}), viscous {m.viscous:.3g}, "
        f"offset {m.offset:.3g}; {ax.CONTROLLERS[law]} of {gains[1] / 2 / np.pi:.1f} Hz; {style}; "
        f"{m.rate_hz} Hz; force constant {constant:.3g} per {unit}; {effect}"
    )
    return MachineRecording(
        generator="mujoco_machines",
        kind=kind,
        story=story,
        time_s=np.arange(count) / m.rate_hz,
        position=position,
        command=recorded / constant,
        reference=m.reference[:, 0].copy() if rng.random() < 0.6 else None,
        position_unit=letter,
        command_unit=unit,
        resolution=resolution,
        friction_shape=shape,
        noise=noise,
    )


def _coloured(m: Plan, count: int) -> Array:
    """Return low-passed noise of 0.5 % to 2 % of the force's rms."""
    pole = np.exp(-2 * np.pi * m.between(3, 60) / m.rate_hz)
    raw = m.rng.standard_normal(count)
    out = np.zeros(count)
    for k in range(1, count):
        out[k] = pole * out[k - 1] + raw[k]
    return np.asarray(out * (m.rms * m.rng.uniform(0.005, 0.02) / out.std()))


def _scale(m: Plan) -> tuple[float, str]:
    """Return the nominal force per command unit, and that unit."""
    peak = float(np.abs(m.asked).max())
    unit = str(m.rng.choice(["A", "V", "N m" if m.rotary else "N"]))
    if unit == "A":
        return float(f"{peak / m.between(2, 20):.3g}"), unit
    return (float(f"{peak / m.rng.uniform(3, 9):.3g}"), unit) if unit == "V" else (1.0, unit)
