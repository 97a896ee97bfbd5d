"""The machines of a simulated fleet: what each truly is on each day, drawn from a seed alone.

Nothing here knows what a diagnosis would find: sizes are those that a maintenance engineer would
call early, and the tracking error that a change costs is simulated, not chosen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from motorctl_benchmarks.fleet.fleet_physics import Axis, Drive, closed_loop

Array = NDArray[np.float64]

RATE_HZ = 5000.0
LOG_S = 4.0
TRAVEL_M = 0.3
DRIVE = Drive(
    bandwidth_1_s=150.0, integral_1_s=20.0, period_s=1.0 / RATE_HZ, resolution_m=0.1e-6,
    limit_v=10.0, turn_m_s=1.0 / 900.0,
)  # fmt: skip
FORCE_NOISE_V = 0.004
NOISE_POLE = 0.98
"""Of the disturbing force, which is coloured: 16 Hz at 5 kHz."""
SEEN_NOISE_M = 0.05e-6
LOG_TO_LOG = 0.015
"""Standard deviation of friction between logs, in parts: lubricant is never twice the same."""
REMEMBERED = 0.5
"""Correlation of that from a log to the next."""
VISCOUS_PER_K = -0.02
COULOMB_PER_K = -0.004
FORCE_PER_K = -0.001
"""Of the motor's magnets: all forces are over it."""
SWING_K = 1.0
"""Of the day in the hall."""
WANDER_K = 0.8
"""Standard deviation of the hall over weeks."""
WANDER_DAYS = 5.0
THERMOMETER_K = 0.3
"""Standard deviation of its readings."""
PASSING_M = 0.0113
"""Way of the carriage between two passings of a damaged rolling element."""
SCALE_M = 0.001
"""Pitch of the encoder's scale."""


@dataclass(frozen=True)
class Kind:
    """A way in which a machine changes, and what may be said of it."""

    form: Literal["step", "drift", "none"]
    story: str
    names: frozenset[str]
    """What a parameter that is told first may be called."""
    effects: frozenset[str] = frozenset()
    """What a diagnosis may say where only the fit's residual has grown."""


def _names(*names: str) -> frozenset[str]:
    return frozenset(names)


KINDS: Mapping[str, Kind] = {
    "friction rises": Kind(
        "drift", "Coulomb friction rises, as with worn seals", _names("coulomb_friction")
    ),
    "preload lost": Kind(
        "step", "a carriage loses its preload: less Coulomb friction", _names("coulomb_friction")
    ),
    "magnet lost": Kind(
        "step", "cogging changes, as a magnet came off", _names("cogging"), _names("cogging")
    ),
    "encoder dirty": Kind(
        "drift",
        "a periodic error of the measured position grows on a dirty scale",
        _names("encoder_error"),
        _names("encoder_error"),
    ),
    "amplifier lags": Kind(
        "drift", "the amplifier follows later and later", _names("input_delay_s", "input_lag")
    ),
    "payload changed": Kind("step", "another payload is carried", _names("inertia")),
    "bearing damaged": Kind(
        "drift",
        "a rolling element is damaged: a force at each of its passings",
        _names(),
        _names("cogging", "position_force", "force_ripple"),
    ),
    "cable pulls": Kind("step", "a cable carrier was laid otherwise and pulls", _names("offset")),
    "grease hardens": Kind("drift", "viscous friction rises", _names("viscous_friction")),
    "hall warms": Kind(
        "none", "the hall's temperature swings by 6 K over weeks: innocent", _names()
    ),
}
"""Ten kinds; a machine without any is sound."""
SOUND = "sound"


@dataclass(frozen=True)
class Machine:
    """A machine of the fleet, and its truth."""

    name: str
    kind: str
    onset_day: float
    """When the change begins; of a step, when it is there."""
    ends_day: float
    """When a drift has its full size."""
    size: float
    """Of the change; what it means, `axis_on` tells."""
    axis: Axis
    """When it was commissioned."""
    seed: int

    @property
    def form(self) -> str:
        """Step, drift or none."""
        return KINDS[self.kind].form if self.kind in KINDS else "none"

    def document(self) -> dict[str, Any]:
        """Return the truth as plain data."""
        return asdict(self) | {"form": self.form, "axis": self.axis._asdict()}

    def grown(self, day: float) -> float:
        """Return how much of the change is there, 0 to 1."""
        if self.form == "none":
            return 1.0
        if self.form == "step":
            return float(day >= self.onset_day)
        return float(np.clip((day - self.onset_day) / (self.ends_day - self.onset_day), 0.0, 1.0))


SIZES: Mapping[str, tuple[float, float]] = {
    "friction rises": (0.6, 1.0),
    "preload lost": (-0.45, -0.25),
    "magnet lost": (0.35, 0.6),
    "encoder dirty": (0.4e-6, 0.8e-6),
    "amplifier lags": (0.4e-3, 0.8e-3),
    "payload changed": (0.06, 0.2),
    "bearing damaged": (0.06, 0.12),
    "cable pulls": (0.04, 0.1),
    "grease hardens": (0.6, 1.2),
    "hall warms": (6.0, 6.0),
    SOUND: (0.0, 0.0),
}
"""Between which a change's size is drawn: parts of the machine's own, but of dirt [m], lag [s],
marks and pull [V], and the hall [K]."""


def draw_fleet(machines: int, days: int, seed: int) -> list[Machine]:
    """Return the machines of a fleet: the kinds in turn, every sixth one sound."""
    order = [
        kind for k, kind in enumerate(KINDS) for kind in ((kind, SOUND) if k % 5 == 4 else (kind,))
    ]
    return [_draw(k, order[k % len(order)], days, seed) for k in range(machines)]


def _draw(k: int, kind: str, days: int, seed: int) -> Machine:
    rng = np.random.default_rng([seed, k])
    turn = rng.uniform(0.0, 2.0 * math.pi)
    cogging = rng.uniform(0.08, 0.15)
    axis = Axis(
        inertia=rng.uniform(0.12, 0.25),
        viscous=rng.uniform(0.2, 0.4),
        coulomb=rng.uniform(0.1, 0.2),
        offset=rng.uniform(-0.03, 0.03),
        cogging_sin=cogging * math.sin(turn),
        cogging_cos=cogging * math.cos(turn),
        cogging_second=0.2 * cogging,
        pitch_m=0.024,
        lag_s=rng.uniform(0.2e-3, 0.3e-3),
        mark=0.0,
        mark_pitch_m=PASSING_M,
        dirt_m=0.02e-6,
        dirt_pitch_m=SCALE_M,
    )
    onset = rng.uniform(0.35, 0.6) * days
    low, high = SIZES[kind]
    return Machine(
        name=f"machine-{k:02d}",
        kind=kind,
        onset_day=onset,
        ends_day=onset + rng.uniform(0.35, 0.5) * days,
        size=rng.uniform(low, high),
        axis=axis,
        seed=int(rng.integers(2**31)),
    )


def hall_k(days: Array, seed: int) -> Array:
    """Return how warm the hall is at some times, over its mean: the day, and a slow wandering."""
    rng = np.random.default_rng([seed, 2**20])
    wander = np.zeros_like(days)
    for _ in range(6):
        period = WANDER_DAYS * math.exp(rng.uniform(-0.7, 0.9))
        turn = 2.0 * math.pi * (days / period + rng.uniform())
        wander += WANDER_K * math.sqrt(2.0 / 6.0) * np.sin(turn)
    return np.asarray(wander + SWING_K * np.sin(2.0 * math.pi * (days - 0.4)))


def own_warmth_k(machine: Machine, day: float, days: int) -> float:
    """Return how much warmer than the hall it is at a machine, at a time."""
    if machine.kind != "hall warms":
        return 0.0
    swing = math.sin(2.0 * math.pi * day / days - 0.5 * math.pi)
    return 0.5 * machine.size * machine.grown(day) * swing


def thermometer_k(machine: Machine, readings: Array, days: int, seed: int) -> Array:
    """Return what a thermometer beside a machine tells at some times, over the hall's mean."""
    rng = np.random.default_rng([machine.seed, 2**21])
    own = np.array([own_warmth_k(machine, float(day), days) for day in readings])
    noise = THERMOMETER_K * rng.standard_normal(len(readings))
    return np.asarray(hall_k(readings, seed) + own + noise)


def axis_on(machine: Machine, day: float, friction: float, warm_k: float, days: int) -> Axis:
    """Return what a machine is at a time.

    Parameters
    ----------
    machine
        Which.
    day
        Time since the fleet began.
    friction
        What its lubricant is just then, in parts of its friction.
    warm_k
        How warm the hall is over its mean.
    days
        Of the whole fleet: over them a hall that warms does so once.
    """
    axis, size = machine.axis, machine.size * machine.grown(day)
    kind = machine.kind
    warm_k += own_warmth_k(machine, day, days)
    viscous = axis.viscous * math.exp(VISCOUS_PER_K * warm_k) * (1.0 + friction)
    coulomb = axis.coulomb * math.exp(COULOMB_PER_K * warm_k) * (1.0 + friction)
    force = 1.0 + FORCE_PER_K * warm_k
    now = axis._replace(
        inertia=axis.inertia / force, viscous=viscous / force, coulomb=coulomb / force
    )
    if kind in ("friction rises", "preload lost"):
        return now._replace(coulomb=now.coulomb * (1.0 + size))
    if kind == "grease hardens":
        return now._replace(viscous=now.viscous * (1.0 + size))
    if kind == "magnet lost":
        return now._replace(
            cogging_sin=axis.cogging_sin * (1.0 - size),
            cogging_second=axis.cogging_second + 0.2 * size,
        )
    if kind == "encoder dirty":
        return now._replace(dirt_m=axis.dirt_m + size)
    if kind == "amplifier lags":
        return now._replace(lag_s=axis.lag_s + size)
    if kind == "payload changed":
        return now._replace(inertia=now.inertia * (1.0 + size))
    if kind == "bearing damaged":
        return now._replace(mark=size)
    if kind == "cable pulls":
        return now._replace(offset=axis.offset + size)
    return now


@dataclass(frozen=True)
class Run:
    """One log's columns, (N,), and what it cost."""

    time_s: Array
    position_m: Array
    command_v: Array
    reference_m: Array
    reference_velocity_m_s: Array
    tracking_m: float
    """Root mean square of desired less true position."""


def log_times(machine: Machine, days: int, logs_a_day: int) -> Array:
    """Return when a machine's logs begin, in days since the fleet began."""
    rng = np.random.default_rng([machine.seed, 1])
    shifts = np.arange(days * logs_a_day) / logs_a_day
    return np.asarray(shifts + rng.uniform(0.02, 0.9 / logs_a_day, len(shifts)) * 0.5)


def lubricant(machine: Machine, logs: int) -> Array:
    """Return how friction differs from log to log, in parts."""
    rng = np.random.default_rng([machine.seed, 2])
    fresh = rng.standard_normal(logs) * LOG_TO_LOG * math.sqrt(1.0 - REMEMBERED**2)
    found = np.zeros(logs)
    found[0] = LOG_TO_LOG * rng.standard_normal()
    for k in range(1, logs):
        found[k] = REMEMBERED * found[k - 1] + fresh[k]
    return found


def run_log(machine: Machine, number: int, axis: Axis) -> Run:
    """Simulate one log: the machine's own programme, with fresh noise."""
    goal = programme(machine)
    n = int(goal.shape[1])
    rng = np.random.default_rng([machine.seed, 3, number])
    noise = rng.standard_normal(n)
    gain = FORCE_NOISE_V * math.sqrt(1.0 - NOISE_POLE**2)
    force = np.asarray(lfilter([gain], [1.0, -NOISE_POLE], noise))
    seen = SEEN_NOISE_M * rng.standard_normal(n)
    position, command, true = closed_loop(goal, force, seen, axis, machine.axis, DRIVE)
    error = float(np.sqrt(np.mean((goal[0] - true) ** 2)))
    return Run(np.arange(n) / RATE_HZ, position, command, goal[0], goal[1], error)


def programme(machine: Machine) -> Array:
    """Return what a machine is to follow in each log: position, velocity, acceleration, (3, N)."""
    rng = np.random.default_rng([machine.seed, 4])
    count = int(LOG_S * RATE_HZ)
    goal = np.zeros((3, count))
    k, here = int(0.1 * RATE_HZ), 0.0
    while k < count:
        there = rng.uniform(0.0, TRAVEL_M)
        span = there - here
        acceleration, speed = rng.uniform(6.0, 25.0), rng.uniform(0.15, 0.9)
        length = max(math.sqrt(5.7735 * abs(span) / acceleration), 1.875 * abs(span) / speed, 0.01)
        s = np.arange(int(length * RATE_HZ)) / (length * RATE_HZ)
        s = s[: count - k]
        stop = k + len(s)
        goal[0, k:stop] = here + span * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        goal[1, k:stop] = span / length * 30.0 * s**2 * (1.0 - s) ** 2
        goal[2, k:stop] = span / length**2 * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)
        rest = min(stop + int(rng.uniform(0.02, 0.15) * RATE_HZ), count)
        goal[0, stop:rest] = there
        here, k = there, rest
    return goal
