"""Machines whose gains are chosen: the shipped gantry, and plants that are drawn by seed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from motorctl.config import Machine, load
from motorctl.config.analysis import DelayedPlant, LoopGains, LoopMargins, is_stable, loop_margins
from motorctl.config.loop_rules import parameter_range
from motorctl.config.shipped import locate
from motorctl.tune.candidates import LoopShapes
from motorctl_benchmarks.diagnosis.cases import draw_case
from motorctl_benchmarks.diagnosis.draw import Draw

CYCLES = 6
"""Of each program: two to learn, two to settle, two that count."""
LATE = ("input_lag", "input_delay")
EFFECTS = ("cogging", "presliding", "position_force", "stribeck", "force_ripple", "flexible_mode")
"""Of which a plant has two beside a lag or a delay: what disturbs it."""


Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class TruePlant:
    """A plant with a part on a spring, from what its simulator was told: known without an error."""

    rigid: DelayedPlant
    inertia_v_s2_m: float
    viscous_friction_v_s_m: float
    fraction: float
    """Of the inertia, which is on the spring."""
    frequency_hz: float
    """Of that part, with the carriage clamped."""
    damping_ratio: float

    @property
    def band_hz(self) -> tuple[float, float]:
        """All."""
        return 0.0, math.inf

    def frequencies(self, w: Array) -> Array:
        """Return frequencies [rad/s] with those around the resonance and the antiresonance."""
        rings = self.frequency_hz / math.sqrt(1.0 - self.fraction)
        around = [
            2.0 * np.pi * hz * np.geomspace(0.7, 1.4, 600) for hz in (self.frequency_hz, rings)
        ]
        every = np.unique(np.concatenate([w, *around]))
        inside: Array = every[(every >= w[0]) & (every <= w[-1])]
        return inside

    def response(self, w: Array) -> ComplexArray:
        """Return the transfer from command to position [m/V] at frequencies w [rad/s], (n,)."""
        s, omega = 1j * w, 2.0 * np.pi * self.frequency_hz
        stiff = self.inertia_v_s2_m + self.viscous_friction_v_s_m / s
        taken = s**2 / (s**2 + 2.0 * self.damping_ratio * omega * s + omega**2)
        loose = self.fraction * self.inertia_v_s2_m * taken
        return np.asarray(self.rigid.response(w) * stiff / (stiff - loose), np.complex128)

    def error(self, w: Array) -> Array:
        """Return zeros, (n,)."""
        return np.zeros(len(w))


@dataclass(frozen=True)
class TunedMachine:
    """A configuration, and the truth of one of its plants."""

    name: str
    config: Path
    axis: str
    plant: dict[str, Any]
    """The simulator's options of the axis."""

    @cached_property
    def machine(self) -> Machine:
        """The machine."""
        return load(self.config)

    def margins(self, gains: LoopGains) -> LoopMargins:
        """Return the margins of some gains around the true plant."""
        plant = self.plant
        delay_s, lag_s = self._time_s("input_delay"), self._time_s("input_lag")
        if self._sprung is not None:
            return self._sprung.margins(gains, delay_s, lag_s)
        return loop_margins(
            plant["inertia_v_s2_m"],
            plant["viscous_friction_v_s_m"],
            **vars(gains),
            period_s=self.machine.period_s,
            delay_s=delay_s,
            lag_s=lag_s,
        )

    @cached_property
    def _sprung(self) -> LoopShapes | None:
        """What tells the margins where a part is on a spring; None: none is."""
        mode, plant = self.plant.get("flexible_mode"), self.plant
        if not mode:
            return None
        rigid = self._stiff(plant["inertia_v_s2_m"], plant["viscous_friction_v_s_m"])
        true = TruePlant(
            rigid,
            plant["inertia_v_s2_m"],
            plant["viscous_friction_v_s_m"],
            mode["fraction"],
            mode["frequency_hz"],
            mode["damping_ratio"],
        )
        return LoopShapes(rigid, (), true)

    def _stiff(self, inertia_v_s2_m: float, viscous_friction_v_s_m: float) -> DelayedPlant:
        return DelayedPlant(
            (inertia_v_s2_m, viscous_friction_v_s_m, 0.0),
            self.machine.period_s,
            self._time_s("input_delay"),
            self._time_s("input_lag"),
        )

    def unstable_corners(self, gains: LoopGains) -> int:
        """Return at how many corners of the declared bounds the loop is unstable."""
        machine = self.machine
        axis = machine.axes[self.axis]
        found = 0
        for theta1 in parameter_range(axis.model, axis.estimates, "acceleration")[1:]:
            for theta2 in parameter_range(axis.model, axis.estimates, "velocity")[1:]:
                found += not is_stable(self._stiff(theta1, theta2), gains)
        return found

    def _time_s(self, name: str) -> float:
        return float((self.plant.get(name) or {}).get("time_s", 0.0))


def shipped_machines(folder: Path) -> list[TunedMachine]:
    """Write the shipped gantry, its programs shortened, and return it once for each axis."""
    config = folder / "published_gantry.yaml"
    text = locate("published_gantry").read_text(encoding="utf-8")
    config.write_text(text.replace("cycles: 12", f"cycles: {CYCLES}"), encoding="utf-8")
    plants = load(config).drivers["gantry"].options.model_dump()["plants"]
    return [
        TunedMachine(f"published_gantry {axis}", config, axis, plants[channel])
        for channel, axis in enumerate("xy")
    ]


def drawn_machine(folder: Path, seed: int) -> TunedMachine:
    """Write a machine that is drawn by seed: a lag or a delay, and two effects that disturb it."""
    draw = Draw(seed, "tuning")
    effects = [draw.pick(LATE), *draw.some(EFFECTS, 2)]
    case = draw_case(seed, effects=effects, motion="repeated")
    document = dict(case.config)
    document["programs"] = {
        name: {**program, "cycles": CYCLES} for name, program in document["programs"].items()
    }
    config = folder / f"{case.name}.yaml"
    config.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
    options = load(config).drivers["gantry"].options.model_dump()
    plant = options["plants"][load(config).axes[case.axis].channel]
    return TunedMachine(f"{case.name}: {' + '.join(effects)}", config, case.axis, plant)
