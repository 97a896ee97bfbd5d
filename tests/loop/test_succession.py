"""Other models take over between two ticks: no bump, no fault; the old ones where they cannot."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from motorctl.config import Machine, load, load_resolved, shipped_config
from motorctl.config.machine import MOST_PARAMETERS
from motorctl.config.model_keys import axes_with_other_models, other_keys_that_differ
from motorctl.errors import ConfigError
from motorctl.log.sample import AxisState
from motorctl.loop import Verb, VirtualMachine
from motorctl.loop.plan import plan_move

pytestmark = pytest.mark.slow

Change = Callable[[dict[str, Any]], None]
LARGEST_BUMP = 0.01
"""Of the largest command: what a change of models may add to it in a tick."""


def gantry(folder: Path, change: Change | None = None) -> Machine:
    """Return the shipped gantry, its axis x changed."""
    document = yaml.safe_load(shipped_config("published_gantry").read_text())
    document["programs"] = {}  # which not every model has the voltage for
    for axis in document["axes"].values():
        axis["program"] = None
    if change is not None:
        change(document["axes"]["x"])
    path = folder / "machine.yaml"
    path.write_text(yaml.safe_dump(document))
    return load(path)


class Held:
    """The gantry in virtual time, its axes held where they were moved to."""

    def __init__(self, machine: Machine, x_m: float) -> None:
        self.rows: list[Any] = []
        self.virtual = VirtualMachine(machine, lambda _, samples: self.rows.append(samples.copy()))
        self.virtual.__enter__()
        for axis in machine.axes:
            self.virtual.order(Verb.START, axis)
        move = plan_move(machine, "x", float(self.virtual.state("x")["reference_m"]), x_m)
        self.virtual.follow({"x": move})
        self.virtual.advance(round(move.duration_s * machine.rate_hz) + 1500)
        assert self.virtual.state("x")["state"] == AxisState.IDLE

    def __enter__(self) -> Held:
        return self

    def __exit__(self, *_: object) -> None:
        self.virtual.__exit__(None, None, None)

    def column(self, name: str, axis: int = 0) -> Any:
        return np.concatenate(self.rows)[name][:, axis]


def commands_after(
    machine: Machine, x_m: float, other: Machine | None, ticks: int = 300
) -> tuple[Any, Any, float]:
    """Return the commands of x and y from the tick of the change on, and x's step in that tick [m].

    None: nothing changes.
    """
    with Held(machine, x_m) as held:
        before = sum(map(len, held.rows))
        if other is None:
            held.virtual.advance(1)
        else:
            assert held.virtual.change_models(other) is None
        held.virtual.advance(ticks)
        held.virtual.raise_faults()
        assert abs(held.virtual.state("x")["following_error_m"]) < 20e-6
        # the change is between the tick that `change_models` lets pass and the next
        first = before + 1
        step_m = float(np.diff(held.column("position_m"))[before])
        return held.column("command_v")[first:], held.column("command_v", 1)[first:], step_m


def answer_v_m(machine: Machine) -> float:
    """Return how x's law answers a step of the count [V/m], as any law with its gains does."""
    gains = machine.axes["x"].gains
    return gains.ks_v_s_m * (machine.rate_hz + gains.k1_1_s)


def without_nonlinearity(axis: dict[str, Any]) -> None:
    axis["controller"] = "C1"


def with_a_lag(axis: dict[str, Any]) -> None:
    axis["model"]["input_lag"] = {"time_s": 0.0004}


def with_cogging(axis: dict[str, Any]) -> None:
    axis["model"]["cogging"] = {
        "pitch_m": 0.06,
        "orders": [1],
        "parameters": {"sin_1": {"initial": 0.2}, "cos_1": {"initial": 0.1}},
    }


def with_a_filter(axis: dict[str, Any]) -> None:
    axis["gains"]["command_filter"] = {"kind": "low_pass", "frequency_hz": 600}


@given(
    x_m=st.floats(0.02, 0.38),
    inertia=st.floats(0.06, 0.34),
    friction=st.floats(0.06, 0.39),
    offset=st.floats(-0.3, 0.3),
    ks=st.floats(30.0, 120.0),
    k1=st.floats(100.0, 300.0),
    d_hat_max_v=st.floats(1.0, 3.0),
)
# A step of the count is a speed for a tick: here the command has just been 0.25 V off for that.
@example(0.025188709232049987, 0.177, 0.25, 0.0, 30.0, 100.0, 1.0)
@settings(max_examples=8, deadline=None, phases=[Phase.explicit, Phase.generate])
def test_other_numbers_take_over_without_a_bump(
    tmp_path_factory: pytest.TempPathFactory,
    x_m: float,
    inertia: float,
    friction: float,
    offset: float,
    ks: float,
    k1: float,
    d_hat_max_v: float,
) -> None:
    folder = tmp_path_factory.mktemp("gantry")

    def change(axis: dict[str, Any]) -> None:
        axis["model"]["inertia"]["initial"] = inertia
        axis["model"]["coulomb_friction"]["initial"] = friction
        axis["model"]["offset"]["initial"] = offset
        axis["gains"] |= {"ks_v_s_m": ks, "k1_1_s": k1, "d_hat_max_v": d_hat_max_v}

    machine, other = gantry(folder), gantry(folder, change)
    as_before, _, step_m = commands_after(machine, x_m, None, 3)
    changed, *_ = commands_after(machine, x_m, other, 3)
    answers = [answer_v_m(one) for one in (machine, other)]
    explained = abs(step_m * (answers[1] - answers[0]))
    limit = machine.axes["x"].limits.max_voltage_v
    assert abs(changed[0] - as_before[0]) <= explained + LARGEST_BUMP * limit


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(without_nonlinearity, id="C1"),
        pytest.param(with_a_filter, id="filter"),
        pytest.param(with_cogging, id="cogging", marks=[pytest.mark.slow, pytest.mark.long]),
        pytest.param(with_a_lag, id="lag", marks=pytest.mark.slow),
    ],
)
def test_another_model_takes_over_without_a_bump_and_back(tmp_path: Path, change: Change) -> None:
    machine, other = gantry(tmp_path), gantry(tmp_path, change)
    limit = machine.axes["x"].limits.max_voltage_v
    for before, after in ((machine, other), (other, machine)):
        as_before, y_before, _ = commands_after(before, 0.123, None, 3)
        changed, y_changed, _ = commands_after(before, 0.123, after, 3)
        assert abs(changed[0] - as_before[0]) <= LARGEST_BUMP * limit
        # the axis beside knows nothing of it
        np.testing.assert_array_equal(y_changed, y_before)


def test_an_axis_under_way_keeps_its_model(tmp_path: Path) -> None:
    machine = gantry(tmp_path)
    other = gantry(tmp_path, without_nonlinearity)
    with Held(machine, 0.1) as held:
        held.virtual.follow({"x": plan_move(machine, "x", 0.1, 0.3)})
        held.virtual.advance(100)
        assert held.virtual.change_models(other) == "axis x neither holds nor is off"
        assert held.virtual.machine is machine
        held.virtual.advance(5000)
        held.virtual.raise_faults()
        assert held.virtual.state("x")["position_m"] == pytest.approx(0.3, abs=1e-5)


def test_what_the_fast_adaptation_could_not_hold_is_refused(tmp_path: Path) -> None:
    machine = gantry(tmp_path)

    def change(axis: dict[str, Any]) -> None:
        axis["model"]["offset"]["initial"] = 0.5
        axis["gains"]["d_hat_max_v"] = 0.01

    with Held(machine, 0.1) as held:
        told = held.virtual.change_models(gantry(tmp_path, change))
        assert told is not None
        assert "d_hat_max_v 0.01 V" in told
        assert "would jump" in told
        held.virtual.advance(500)
        held.virtual.raise_faults()


def test_an_axis_that_is_off_starts_with_the_other_model(tmp_path: Path) -> None:
    machine, other = gantry(tmp_path), gantry(tmp_path, without_nonlinearity)
    with VirtualMachine(machine, lambda *_: None) as virtual:
        assert virtual.change_models(other) is None
        virtual.start()
        virtual.advance(500)
        virtual.raise_faults()
        assert virtual.machine.axes["x"].controller == "C1"
        first = virtual.memory.models_row
        assert virtual.change_models(machine) is None
        before, last = virtual.memory.last_models_rows
        assert before == first < last, "readers know of changes that they have not seen"


def test_the_largest_model_that_a_configuration_may_have_takes_over_while_it_runs(
    tmp_path: Path,
) -> None:
    def with_waves_and_profiles(waves: int) -> Change:
        def change(axis: dict[str, Any]) -> None:
            axis["model"] |= {
                "position_force": {"knots": [0.0, 0.4, 24]},
                "position_dependent_friction": {"knots": [0.0, 0.4, 24]},
                "cogging": {"pitch_m": 0.06, "orders": [*range(1, waves + 1)]},
            }

        return change

    with Held(gantry(tmp_path), 0.1) as held:
        other = gantry(tmp_path, with_waves_and_profiles(6))
        assert len(other.axes["x"].model) == MOST_PARAMETERS
        assert held.virtual.change_models(other) is None
        held.virtual.advance(500)
        held.virtual.raise_faults()
    told = "66 parameters; at most 64 are possible: leave out an effect"
    with pytest.raises(ConfigError, match=told):
        gantry(tmp_path, with_waves_and_profiles(7))


def test_only_models_gains_adaptation_and_controllers_make_another_model(tmp_path: Path) -> None:
    machine = gantry(tmp_path)
    assert axes_with_other_models(machine, gantry(tmp_path)) == []
    assert axes_with_other_models(machine, gantry(tmp_path, without_nonlinearity)) == ["x"]

    def change(axis: dict[str, Any]) -> None:
        without_nonlinearity(axis)
        axis["limits"]["max_velocity_m_s"] = 1.4

    told = other_keys_that_differ(machine, gantry(tmp_path, change).resolved)
    assert told == [("axes.x.limits.max_velocity_m_s", 1.5, 1.4)]
    # as it comes from a log or over the control socket
    sent = load_resolved(machine.resolved, hardware=True)
    assert other_keys_that_differ(machine, sent.resolved) == []
    assert axes_with_other_models(machine, sent) == []
