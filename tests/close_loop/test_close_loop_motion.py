import copy
import dataclasses

import numpy as np
import pytest

from motorctl.close_loop.motion import Motions, machine_on, moves_by_itself
from motorctl.config import load, load_resolved
from motorctl.config.experiment_envelope import beyond_envelope
from motorctl.loop.plan import plan_program
from motorctl.motion import AxisLimits, check_program

GANTRY = load("published_gantry")


def limits_of(machine):
    return {
        name: AxisLimits(
            axis.limits.travel_m,
            axis.limits.max_velocity_m_s,
            axis.limits.max_acceleration_m_s2,
            axis.limits.max_jerk_m_s3,
            axis.limits.max_voltage_v,
        )
        for name, axis in machine.axes.items()
    }


def without_programs(machine):
    axes = {n: axis.model_copy(update={"program": None}) for n, axis in machine.axes.items()}
    return dataclasses.replace(machine, axes=axes, programs={})


@pytest.mark.parametrize("motion", ["rich", "unused"])
@pytest.mark.parametrize("machine", [GANTRY, without_programs(GANTRY), load("small_stage")])
def test_motions_that_are_made_respect_every_limit_and_last_long_enough(machine, motion):
    ready = machine_on(machine, motion, Motions(rich_s=15.0, unused_s=15.0))
    for axis in ready.axes.values():
        program = ready.programs[axis.program]
        assert check_program(program, limits_of(machine)) == []
        assert 15.0 <= program.trajectories()[axis.name].duration_s < 25.0


def test_an_axis_is_driven_no_harder_than_by_its_own_programs():
    ready = machine_on(GANTRY, "rich", Motions())
    for name, axis in ready.axes.items():
        own = GANTRY.programs[GANTRY.axes[name].program].trajectories()[name].peaks()
        made = ready.programs[axis.program].trajectories()[name].peaks()
        assert made.max_acceleration_m_s2 <= own.max_acceleration_m_s2
        assert made.max_velocity_m_s <= own.max_velocity_m_s


def test_axes_do_not_move_in_step():
    ready = machine_on(GANTRY, "rich", Motions())
    t = np.linspace(1.0, 30.0, 5000)
    x, y = (ready.programs[f"rich_{a}"].trajectories()[a].sample(t)[1] for a in "xy")
    assert abs(np.corrcoef(x, y)[0, 1]) < 0.2


def test_the_unused_motion_is_another_one_than_the_rich_motion():
    rich, unused = (machine_on(GANTRY, motion, Motions()) for motion in ("rich", "unused"))
    targets = [
        {move.target_m for move in ready.programs[f"{motion}_x"].moves[:-1]}
        for ready, motion in ((rich, "rich"), (unused, "unused"))
    ]
    assert not targets[0] & targets[1]


def test_less_effort_is_gentler():
    peaks = [
        machine_on(GANTRY, "rich", Motions(effort=effort))
        .programs["rich_x"]
        .trajectories()["x"]
        .peaks()
        for effort in (1.0, 0.5)
    ]
    assert peaks[1].max_acceleration_m_s2 < 0.6 * peaks[0].max_acceleration_m_s2


def test_its_own_motion_is_the_machine_as_it_is():
    assert machine_on(GANTRY, "own", Motions()) is GANTRY
    assert moves_by_itself(GANTRY)
    assert not moves_by_itself(without_programs(GANTRY))


def test_the_plain_data_of_the_machine_tell_the_motion():
    ready = machine_on(GANTRY, "unused", Motions(unused_s=5.0))
    again = load_resolved(ready.resolved)
    assert again.axes["y"].program == "unused_y"
    assert again.programs["unused_y"] == ready.programs["unused_y"]


def test_what_is_made_stays_within_the_declared_envelope_with_the_way_to_its_start():
    document = copy.deepcopy(dict(GANTRY.resolved))
    for axis in document["axes"].values():
        axis["experiments"] = {"travel_m": [0.1, 0.3], "max_velocity_share": 0.2}
    machine = load_resolved(document, "gantry")
    for motion in ("rich", "unused"):
        ready = machine_on(machine, motion, Motions(rich_s=8.0, unused_s=8.0))
        for name, axis in ready.axes.items():
            plan = plan_program(ready, ready.programs[axis.program], {name: 0.3})
            peaks = plan.trajectories[name].peaks()
            assert list(beyond_envelope(axis, peaks, 1.0)) == []
            assert peaks.max_velocity_m_s > 0.1 * axis.limits.max_velocity_m_s
