"""Motions that could be run next, and the reach that they stay within."""

import dataclasses
import math

import pytest

from motorctl.config import load, load_resolved
from motorctl.errors import UsageError
from motorctl.experiment.candidates import LONGEST_S, SETTLED_S, candidates, kinds, probe
from motorctl.experiment.reach import reach_in_envelope, reach_of
from motorctl.identify.diagnose.report.motion_advice import Reach
from motorctl.motion import Moves, Points, check_program

GANTRY = load("published_gantry")


def reaches_of(machine):
    return {name: reach_in_envelope(machine, axis) for name, axis in machine.axes.items()}


def with_envelope(**keys):
    resolved = dict(GANTRY.resolved)
    x = resolved["axes"]["x"] | {"experiments": keys}
    return load_resolved(resolved | {"axes": resolved["axes"] | {"x": x}}, "enveloped")


@pytest.mark.parametrize("machine", [GANTRY, load("small_stage")])
def test_every_candidate_keeps_the_limits_and_ends_where_it_starts(machine):
    reaches = reaches_of(machine)
    limits = {name: axis.limits.for_motion() for name, axis in machine.axes.items()}
    for axis in machine.axes:
        every = [probe(reaches), *candidates(axis, reaches)]
        assert len(every) > 20
        for candidate in every:
            for moved in candidate.strokes:
                keys = candidate.program(moved, reaches[moved])
                program = Moves.model_validate({**keys, "name": "tried"})
                assert check_program(program, limits) == []
                path = program.trajectories()[moved]
                assert path.end_m == pytest.approx(path.start_m, abs=1e-9)


def test_candidates_are_short_and_their_axes_begin_and_end_together():
    reaches = reaches_of(GANTRY)
    for candidate in candidates("x", reaches):
        paths = candidate.trajectories(reaches)
        assert set(paths) == {"x", "y"}
        assert len({round(path.duration_s, 9) for path in paths.values()}) == 1
        assert 0.0 < paths["x"].duration_s - 2 * SETTLED_S <= LONGEST_S


SLOW = {"x": Reach(0.025, 0.475, 0.009, 0.4, 50.0)}


def test_a_slow_axis_has_a_motion_of_every_kind_that_a_fast_one_has():
    fast = {"x": Reach(0.025, 0.475, 0.9, 8.0, 500.0)}
    few = candidates("x", SLOW)
    assert {each.kind for each in few} == kinds("x", SLOW) == kinds("x", fast)
    long = [each.kind for each in few if each.lasts_s(SLOW) > LONGEST_S]
    assert long
    assert len(long) == len(set(long)), "the shortest of each alone"
    assert not any(each.lasts_s(fast) > LONGEST_S for each in candidates("x", fast))


def test_a_slow_axis_begins_within_the_time_that_is_given():
    assert probe(SLOW).lasts_s(SLOW) > 24.0
    short = probe(SLOW, 12.0)
    assert short.lasts_s(SLOW) <= 12.0
    places = [stroke.to for stroke in short.strokes["x"]]
    assert max(places) - min(places) > 0.01
    quick = reaches_of(GANTRY)
    assert probe(quick, 12.0) == probe(quick)


def test_an_envelope_that_lies_in_what_is_kept_free_is_refused_with_its_key():
    axis = with_envelope(travel_m=[-0.05, -0.03]).axes["x"]
    with pytest.raises(UsageError, match=r"axes\.x\.experiments\.travel_m: -0\.05 to -0\.03 m"):
        reach_in_envelope(GANTRY, axis)


def test_a_program_in_which_an_axis_stands_tells_nothing_of_its_reach(tmp_path):
    place = GANTRY.axes["y"].limits.travel_m[0] + 0.1
    times = [0.01 * k for k in range(201)]
    rows = (f"{t},{0.05 * (1 - math.cos(math.pi * t)):.9f},{place}" for t in times)
    (tmp_path / "line.csv").write_text("\n".join(["time_s,x_m,y_m", *rows]) + "\n")
    line = Points(name="line", axes=("x", "y"), file=tmp_path / "line.csv")
    alone = dataclasses.replace(GANTRY, programs={"line": line})
    none = dataclasses.replace(GANTRY, programs={})
    assert reach_of(alone, alone.axes["y"]) == reach_of(none, none.axes["y"])
    assert reach_of(alone, alone.axes["x"]).speed < reach_of(none, none.axes["x"]).speed


def test_a_declared_envelope_narrows_the_reach_and_none_widens_it():
    axis = with_envelope(travel_m=[0.1, 0.2], max_velocity_share=0.2).axes["x"]
    reach = reach_in_envelope(GANTRY, axis)
    assert (reach.low, reach.high) == (0.1, 0.2)
    assert reach.speed == pytest.approx(0.2 * axis.limits.max_velocity_m_s)
    assert reach.acceleration <= reach_of(GANTRY, axis).acceleration
    everything = with_envelope(travel_m=list(axis.limits.travel_m), max_velocity_share=1.0)
    wide = reach_in_envelope(GANTRY, everything.axes["x"])
    whole = reach_of(GANTRY, GANTRY.axes["x"])
    assert wide == dataclasses.replace(whole, acceleration=wide.acceleration)
    assert wide.acceleration <= whole.acceleration
