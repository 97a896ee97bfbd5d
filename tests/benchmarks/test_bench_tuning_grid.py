"""The grid beside a tuning runs its gains on the machine as it is otherwise."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from motorctl.config import Machine
from motorctl.config.analysis import DelayedPlant, LoopGains
from motorctl.config.axis_keys import CommandFilterKeys
from motorctl.config.shipped import locate
from motorctl.control import command_filter
from motorctl.errors import RunError
from motorctl_benchmarks.tuning import grid
from motorctl_benchmarks.tuning.machines import LATE, TruePlant, TunedMachine, drawn_machine


def test_gains_of_the_grid_leave_the_machine_its_filter_of_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "filtered.yaml"
    text = locate("published_gantry").read_text(encoding="utf-8")
    own = "command_filter: {kind: low_pass, frequency_hz: 500}"
    path.write_text(text.replace("gains: {k1", f"gains: {{{own}, k1", 1), encoding="utf-8")
    ran: list[Machine] = []

    def simulated(machine: Machine, _log: Path) -> None:
        ran.append(machine)
        raise RunError("an axis tripped")

    monkeypatch.setattr(grid, "simulate", simulated)
    machine = TunedMachine("filtered", path, "x", {})
    assert grid.run_with(machine, LoopGains(200.0, 90.0, 400.0), tmp_path) == math.inf
    gains = ran[0].axes["x"].gains
    assert (gains.k1_1_s, gains.ks_v_s_m, gains.gamma_d) == (200.0, 90.0, 400.0)
    assert gains.command_filter == CommandFilterKeys(kind="low_pass", frequency_hz=500.0)
    own = command_filter("notch", 300.0, 0.1, 0.3, machine.machine.period_s)
    grid.run_with(machine, LoopGains(200.0, 90.0, 400.0, own), tmp_path)
    assert ran[1].axes["x"].gains.command_filter == CommandFilterKeys(
        kind="notch", frequency_hz=300.0, damping=0.1, depth=0.3
    )


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_a_drawn_machine_knows_what_its_plant_has(tmp_path: Path, seed: int) -> None:
    drawn = drawn_machine(tmp_path, seed)
    assert drawn.axis in drawn.machine.axes
    assert drawn.plant["inertia_v_s2_m"] > 0.0
    assert any(drawn.plant[late] for late in LATE)


def test_a_true_plant_with_a_part_on_a_spring_is_stiff_below_and_light_above_its_resonance() -> (
    None
):
    rigid = DelayedPlant((0.2, 0.3, 0.0), 2e-4, 1e-4, 4e-4)
    plant = TruePlant(rigid, 0.2, 0.3, fraction=0.36, frequency_hz=80.0, damping_ratio=1e-4)
    w = 2.0 * np.pi * np.array([1.0, 80.0, 100.0, 1500.0])
    beside = np.abs(plant.response(w) / rigid.response(w))
    assert beside[0] == pytest.approx(1.0, rel=1e-3)
    assert beside[1] < 1e-3  # the part takes all of the force
    assert beside[2] > 100.0  # 80 Hz over the root of what is not on the spring
    assert beside[3] == pytest.approx(1.0 / (1.0 - 0.36), rel=1e-2)
