"""A machine of the MuJoCo generator while it is drawn, and how large its effect has to be.

Sizes are solved so that a share of the command's rms stays unexplained by inertia, viscous and
Coulomb friction and offset. "unit" is m or rad; forces are in N or N m.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from motorctl_benchmarks.other_machines.mujoco import mujoco_axis as ax
from motorctl_benchmarks.other_machines.mujoco.mujoco_axis import Array

GRAVITY = 9.81
ROTARY = ("robot joint", "wheel")


@dataclass
class Plan:
    """One machine while it is drawn: its numbers, its programme, its MuJoCo elements."""

    rng: np.random.Generator
    name: str
    inertia: float
    limits: tuple[float, float]
    speed: float
    accel: float
    coulomb: float
    viscous: float
    offset: float
    shape: int
    width: float
    rate_hz: int
    step_s: float
    share: float
    reference: Array = field(default_factory=lambda: np.zeros((1, 3)))
    path: Array = field(default_factory=lambda: np.zeros((1, 3)))  # time, place, speed
    accels: Array = field(default_factory=lambda: np.zeros(1))
    asked: Array = field(default_factory=lambda: np.zeros(1))
    effect: Array = field(default_factory=lambda: np.zeros(1))
    code: int = ax.BUILT_IN
    p: Array = field(default_factory=lambda: np.zeros(8))
    main_inertia: float = 0.0  # of the first body
    axis: str = ""
    xml: defaultdict[str, str] = field(default_factory=lambda: defaultdict(str))
    load_inertia: float = 0.0
    motor_share: float = 1.0
    encoder: int = 0
    delay: int = 0
    payload: tuple[int, float] = (-1, 0.0)
    held: bool = False
    second: Array = field(default_factory=lambda: np.zeros(1))
    start: tuple[float, float] = (0.0, 0.0)
    pole_limit: float = 200.0
    drag: float = 0.0
    reached: float = 1.0  # part of its share that the effect could reach

    @property
    def rotary(self) -> bool:
        """Return whether the axis turns."""
        return self.name in ROTARY

    @property
    def travel(self) -> float:
        """Return the length of the travel in units."""
        return self.limits[1] - self.limits[0]

    @property
    def rms(self) -> float:
        """Return the rms of the nominal force without the effect."""
        return float(np.sqrt(np.mean(self.asked**2)))

    def between(self, low: float, high: float) -> float:
        """Return a number drawn evenly on a logarithmic scale."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def period(self) -> float:
        """Return a period over position that the programme crosses often and the samples show."""
        few = 8 * self.speed / self.rate_hz
        if self.rotary:
            most = min(72, int(2 * np.pi / few))
            return 2 * np.pi / int(self.rng.integers(min(8, most - 1), most))
        low = max(0.008, few)
        return float(np.clip(self.between(low, 8 * low), low, max(self.travel / 5, low)))

    def solve(self, effect: Callable[[float], Array], low: float, high: float) -> float:
        """Return the size at which the effect leaves its share of the command unexplained."""
        v = self.path[:, 2]
        sign = np.array([ax.shaped(self.shape, x, self.width)[0] for x in v])
        basis = np.stack([np.ones_like(v), v, sign, self.accels], axis=1)
        basis = np.linalg.qr(basis)[0]

        def shares(size: float) -> tuple[float, float]:
            force = effect(size)
            total = np.sqrt(np.mean((self.asked - force) ** 2))
            rest = force - basis @ (basis.T @ force)
            rms = [float(np.sqrt(np.mean(x**2)) / total) for x in (rest, force)]
            return rms[0], rms[1]

        for _ in range(24):
            middle = float(np.sqrt(low * high))
            unexplained, raw = shares(middle)
            too_much = unexplained > self.share or raw > 0.5
            low, high = (low, middle) if too_much else (middle, high)
        self.effect, self.reached = effect(low), shares(low)[0] / self.share
        return low

    def formula(self, code: int, p: list[float], low: float, high: float) -> float:
        """Return and set the size p[0] of an effect of mujoco_axis."""
        self.code = code
        self.p[1 : 1 + len(p)] = p

        def effect(size: float) -> Array:
            q = self.p.copy()
            q[0] = size
            result: Array = ax.along(
                code, q, self.path, self.asked, self.coulomb, self.shape, self.width
            )
            return result

        self.p[0] = self.solve(effect, low, high)
        return float(self.p[0])

    def filtered(self, signal: Array, response: Callable[[Array], Any]) -> Array:
        """Return the signal behind a frequency response (of the angular frequency)."""
        ts = self.path[1, 0] - self.path[0, 0]
        omega = 2 * np.pi * np.fft.rfftfreq(2 * signal.size, ts)
        both = np.fft.rfft(np.concatenate([signal, signal[::-1]])) * response(omega)
        return np.asarray(np.fft.irfft(both)[: signal.size])
