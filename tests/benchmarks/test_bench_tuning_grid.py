"""The grid beside a tuning runs its gains on the machine as it is otherwise."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from motorctl.config import Machine
from motorctl.config.analysis import LoopGains
from motorctl.config.axis_keys import CommandFilterKeys
from motorctl.config.shipped import locate
from motorctl.errors import RunError
from motorctl_benchmarks.tuning import grid
from motorctl_benchmarks.tuning.machines import LATE, TunedMachine, drawn_machine


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


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_a_drawn_machine_knows_what_its_plant_has(tmp_path: Path, seed: int) -> None:
    drawn = drawn_machine(tmp_path, seed)
    assert drawn.axis in drawn.machine.axes
    assert drawn.plant["inertia_v_s2_m"] > 0.0
    assert any(drawn.plant[late] for late in LATE)
