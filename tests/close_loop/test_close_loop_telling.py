"""Motions that are chosen one after the other: what is run, and when it ends."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from motorctl.close_loop import telling
from motorctl.close_loop.motion import Motions
from motorctl.close_loop.telling import record_telling
from motorctl.config.shipped import locate
from motorctl.errors import RunError, UsageError
from motorctl.experiment.candidates import Candidate
from motorctl.experiment.session import Experiment, Standing
from motorctl.identify.diagnose.report.motion_advice import Stroke
from motorctl.log.recording import AxisRecording, Recording

CONFIG = locate("published_gantry")
TO_AND_FRO = Candidate(
    "to and fro", "to and fro", {"x": (Stroke(0.7, 0.5, 0.5), Stroke(0.3, 0.5, 0.5))}
)


@dataclass
class GivenRig:
    """Keeps what it is asked to run; trips as often as it is told."""

    goes_on: bool = False
    trips: int = 0
    verb: str = "keeping"
    ran: list = field(default_factory=list)

    def run(self, machine, log, duration_s, progress):
        if self.trips:
            self.trips -= 1
            raise RunError("axis x tripped")
        self.ran.append(machine)


def settled():
    return Standing({}, ())


def doubtful():
    return Standing({}, ("x",))


@pytest.fixture
def given(monkeypatch):
    """Return what is standing after each motion; the next motion is always the same."""
    after = []
    told = iter(range(100))

    def read(log, gaps):
        t = 100.0 * next(told) + np.arange(100) / 1000.0
        axes = {name: AxisRecording(name, np.sin(t), np.cos(t)) for name in "xy"}
        return Recording(str(log), 1000.0, t, axes)

    def chosen(standing, reaches, fallback, before):
        return Experiment(TO_AND_FRO, TO_AND_FRO.lasts_s(reaches), ("x: what is asked",))

    monkeypatch.setattr(telling, "read_recording", read)
    monkeypatch.setattr(telling, "_diagnosed", lambda *_: None)
    monkeypatch.setattr(telling, "standing", lambda *_: after.pop(0))
    monkeypatch.setattr(telling, "next_experiment", chosen)
    return after


def record(tmp_path, rig, motions=None):
    return record_telling(CONFIG, tmp_path, motions or Motions(), rig, lambda _what, _share: None)


def moves_of(machine, axis):
    return machine.programs[machine.axes[axis].program].moves


def test_in_virtual_time_what_was_run_before_is_run_again_in_front(given, tmp_path):
    given[:] = [doubtful(), doubtful(), settled()]
    rig = GivenRig()
    told = record(tmp_path, rig)
    first, second, third = (moves_of(machine, "x") for machine in rig.ran)
    assert second[: len(first)] == first
    assert third[: len(second)] == second
    assert len(first) < len(second) < len(third)
    assert len(told.experiments) == 3
    assert len(told.recording.time_s) == 100
    assert "nothing is left" in told.ended


def test_a_machine_runs_only_what_is_new_and_its_recordings_are_joined(given, tmp_path):
    given[:] = [doubtful(), doubtful(), settled()]
    rig = GivenRig(goes_on=True)
    told = record(tmp_path, rig)
    _, second, third = (moves_of(machine, "x") for machine in rig.ran)
    assert second == third
    assert len(told.recording.time_s) == 300
    paths = [m.programs[m.axes["x"].program].trajectories()["x"] for m in rig.ran]
    assert {round(path.start_m, 9) for path in paths} == {round(path.end_m, 9) for path in paths}


def test_after_a_gentler_run_everything_is_weighed_and_timed_as_it_can_be_run(
    given, tmp_path, monkeypatch
):
    given[:] = [doubtful(), settled()]
    weighed = []

    def chosen(_standing, reaches, *_):
        weighed.append(reaches)
        return Experiment(TO_AND_FRO, TO_AND_FRO.lasts_s(reaches), ("x: what is asked",))

    monkeypatch.setattr(telling, "next_experiment", chosen)
    rig = GivenRig(goes_on=True, trips=1)
    told = record(tmp_path, rig, Motions(rich_s=60.0))
    fastest = {m.max_velocity_m_s for m in moves_of(rig.ran[0], "x")}
    assert weighed[0]["x"].speed == pytest.approx(max(fastest), rel=0.05)
    first, second = told.experiments
    assert first.duration_s == pytest.approx(first.candidate.lasts_s(weighed[0]))
    assert second.duration_s == pytest.approx(second.candidate.lasts_s(weighed[0]))
    for each, machine in zip(told.experiments, rig.ran, strict=True):
        ran_s = of_axes(machine)["x"].trajectories()["x"].duration_s
        assert ran_s == pytest.approx(each.duration_s + telling.BETWEEN_S, abs=0.01)


def test_nothing_is_run_where_even_the_first_motion_lasts_longer_than_all_may(given, tmp_path):
    rig = GivenRig()
    with pytest.raises(UsageError, match=r"lasts .* s, all telling ones may last 0\.5 s"):
        record(tmp_path, rig, Motions(rich_s=0.5))
    assert rig.ran == []


def test_axes_begin_every_motion_together(given, tmp_path):
    given[:] = [doubtful(), settled()]
    rig = GivenRig()
    record(tmp_path, rig)
    for machine in rig.ran:
        lasts_s = [
            program.trajectories()[name].duration_s for name, program in of_axes(machine).items()
        ]
        assert max(lasts_s) - min(lasts_s) < 2e-3


def of_axes(machine):
    return {name: machine.programs[axis.program] for name, axis in machine.axes.items()}


def test_a_motion_that_trips_is_run_more_gently(given, tmp_path):
    given[:] = [settled()]
    rig = GivenRig(trips=1)
    told = record(tmp_path, rig)
    assert told.motions.effort < 1.0
    assert len(rig.ran) == 1


def test_a_machine_that_cannot_follow_at_all_is_told(given, tmp_path):
    with pytest.raises(RunError, match="tripped"):
        record(tmp_path, GivenRig(trips=99))


def test_it_ends_where_the_next_motion_would_use_more_than_the_time(given, tmp_path):
    given[:] = [doubtful()] * 99
    told = record(tmp_path, GivenRig(), Motions(rich_s=10.0))
    assert "the time is used up" in told.ended
    assert 5.0 < told.duration_s <= 10.0
