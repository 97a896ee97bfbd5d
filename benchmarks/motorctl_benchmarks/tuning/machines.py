"""Machines whose gains are chosen: the shipped gantry, and plants that are drawn by seed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from motorctl.config import Machine, load
from motorctl.config.analysis import DelayedPlant, LoopGains, LoopMargins, is_stable, loop_margins
from motorctl.config.loop_rules import parameter_range
from motorctl.config.shipped import locate
from motorctl_benchmarks.diagnosis.cases import draw_case
from motorctl_benchmarks.diagnosis.draw import Draw

CYCLES = 6
"""Of each program: two to learn, two to settle, two that count."""
LATE = ("input_lag", "input_delay")
EFFECTS = ("cogging", "presliding", "position_force", "stribeck", "force_ripple", "flexible_mode")
"""Of which a plant has two beside a lag or a delay: what disturbs it."""


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
        return loop_margins(
            plant["inertia_v_s2_m"],
            plant["viscous_friction_v_s_m"],
            k1_1_s=gains.k1_1_s,
            ks_v_s_m=gains.ks_v_s_m,
            gamma_d=gains.gamma_d,
            period_s=self.machine.period_s,
            delay_s=self._time_s("input_delay"),
            lag_s=self._time_s("input_lag"),
        )

    def unstable_corners(self, gains: LoopGains) -> int:
        """Return at how many corners of the declared bounds the loop is unstable."""
        machine = self.machine
        axis = machine.axes[self.axis]
        found = 0
        for theta1 in parameter_range(axis.model, axis.estimates, "acceleration")[1:]:
            for theta2 in parameter_range(axis.model, axis.estimates, "velocity")[1:]:
                plant = DelayedPlant(
                    (theta1, theta2, 0.0),
                    machine.period_s,
                    self._time_s("input_delay"),
                    self._time_s("input_lag"),
                )
                found += not is_stable(plant, gains)
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
