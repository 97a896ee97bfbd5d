"""A simulation runs a machine in virtual time and leaves a complete log."""

import numpy as np
import pytest
from loop_bench import Still, changed, gantry, with_axes, with_driver, with_sim

from motorctl.errors import RunError, UsageError
from motorctl.log import read_recording
from motorctl.log.sample import AxisState
from motorctl.loop.simulation import simulate, with_seed


def test_every_axis_follows_its_program_until_the_longest_has_ended(tmp_path):
    programs = {
        name: program.model_copy(update={"cycles": 1})
        for name, program in gantry().programs.items()
        if name.startswith("published")
    }
    done = simulate(changed(gantry(), programs=programs), tmp_path / "run.parquet")
    recording = read_recording(done.log)
    assert done.duration_s == pytest.approx(4.1, abs=0.01)
    assert len(recording.time_s) == round(done.duration_s * 5000)
    assert np.ptp(recording.axes["x"].reference) == pytest.approx(0.4)
    assert np.ptp(recording.axes["y"].reference) == pytest.approx(0.4)
    assert recording.axes["y"].state[-1] == AxisState.IDLE
    told = recording.metadata["virtual_time"]
    assert told == {"wall_s": done.wall_s, "turnaround": done.turnaround}
    assert len(done.turnaround_s) == len(recording.time_s)


def test_a_duration_ends_it_early(tmp_path):
    shares = []
    done = simulate(gantry(), tmp_path / "a.parquet", duration_s=0.5, progress=shares.append)
    assert len(read_recording(done.log).time_s) == 2500
    assert shares[-1] == 1.0


@pytest.mark.parametrize("duration_s", [0.0, -1.0, np.inf, np.nan])
def test_a_duration_that_is_none_is_refused(tmp_path, duration_s):
    with pytest.raises(UsageError, match="duration"):
        simulate(gantry(), tmp_path / "a.parquet", duration_s=duration_s)


def test_the_log_of_an_axis_that_trips_ends_there_and_is_complete(tmp_path):
    fault = {"kind": "amplifier_fault", "at_s": 0.3, "channel": 1}
    log = tmp_path / "a.parquet"
    with pytest.raises(RunError, match=r"axis y tripped \(amplifier\): .* at 0\.3.* s"):
        simulate(with_sim(gantry(), faults=[fault]), log, duration_s=3.0)
    recording = read_recording(log)
    assert recording.axes["y"].state[-1] == AxisState.FAULT
    assert recording.axes["y"].command[-1] == 0.0
    assert "virtual_time" in recording.metadata


def test_without_programs_a_machine_holds_its_position(tmp_path):
    machine = with_axes(with_sim(gantry()), program=None)
    done = simulate(machine, tmp_path / "a.parquet")
    recording = read_recording(done.log)
    assert done.duration_s == pytest.approx(1.0, abs=0.01)
    assert np.abs(recording.axes["x"].position).max() < 2e-6


def test_a_driver_without_virtual_time_is_refused_before_a_log_is_begun(tmp_path):
    class OnlyWallTime(Still):
        supports_virtual_time = False

    log = tmp_path / "a.parquet"
    with pytest.raises(UsageError, match=r"driver 'gantry' \(own\) does not support virtual time"):
        simulate(with_driver(gantry(), OnlyWallTime), log)
    assert list(tmp_path.iterdir()) == []


def test_a_seed_goes_to_every_driver_that_has_one():
    machine = with_seed(gantry(), 42)
    assert machine.drivers["gantry"].options.seed == 42
    assert machine.resolved["drivers"]["gantry"]["seed"] == 42
    assert gantry().drivers["gantry"].options.seed == 1
    with pytest.raises(UsageError, match="--seed 2 has no effect: no driver of published-gantry"):
        with_seed(with_driver(gantry(), Still), 2)
