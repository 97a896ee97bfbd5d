"""The loop on the wall clock: a supervisor that falls silent, overruns, gaps, and the way out."""

import tracemalloc

import numpy as np
import pytest
from loop_bench import TS, Hand, changed, gantry, with_sim

from motorctl.config.keys import LoopSettings
from motorctl.log.sample import AxisState, FaultCause, SampleFlag
from motorctl.loop import Reply, Verb
from motorctl.loop.faults import lasting_words
from motorctl.motion import point_to_point

PATIENCE = round(LoopSettings().supervisor_timeout_s / TS)


def hand(**loop) -> Hand:
    machine = with_sim(gantry())
    return Hand(changed(machine, loop=loop) if loop else machine)


def moving(bench: Hand) -> None:
    """Enable both axes, let x move."""
    bench.step()
    bench.ask(Verb.START, "x")
    bench.ask(Verb.START, "y")
    bench.follow("x", point_to_point(0.0, 0.4, 0.5, 5.0, 500.0))


def test_a_silent_supervisor_stops_every_axis_and_ends_the_loop():
    with hand() as bench:
        moving(bench)
        bench.steps(500)
        assert not bench.may_end
        speeds = []
        for _ in range(PATIENCE):
            bench.step(beat=False)
        assert bench.status("x")["state"] == AxisState.RUNNING
        bench.step(beat=False)
        assert bench.status("x")["state"] == AxisState.STOPPING
        assert bench.status("x")["fault_time_s"] == pytest.approx(bench.number * TS)
        while not bench.may_end:
            bench.step(beat=False)
            speeds.append(abs(bench.row("x")["reference_velocity_m_s"]))
            assert len(speeds) < 5000
        assert max(np.diff(speeds)) <= 1e-9  # ramped down
        for axis in ("x", "y"):
            assert bench.status(axis)["state"] == AxisState.FAULT
            assert bench.status(axis)["fault"] == FaultCause.SUPERVISOR_LOST
        assert bench.tick.watch["orphaned"][0]


def test_how_long_the_supervisor_may_be_silent_is_configured():
    with hand(supervisor_timeout_s=2.0) as bench:
        moving(bench)
        bench.steps(500)
        for _ in range(round(2.0 / TS)):
            bench.step(beat=False)
        assert bench.status("x")["fault"] == FaultCause.NONE
        bench.step(beat=False)
        assert bench.status("x")["fault"] == FaultCause.SUPERVISOR_LOST


@pytest.mark.parametrize("pause_s", [0.6, 0.95])
def test_a_computer_that_stood_still_as_a_whole_is_told_and_the_loop_goes_on(pause_s):
    with hand() as bench:
        moving(bench)
        bench.steps(500)
        bench.step(round(pause_s / TS), beat=False)  # the loop is the first that wakes
        assert bench.status("x")["fault"] == FaultCause.HOST_FROZEN
        bench.steps(100, beat=False)
        bench.step()
        assert not bench.may_end
        assert not bench.tick.watch["orphaned"][0]


def test_a_supervisor_that_died_while_the_loop_stood_still_is_found_out():
    with hand() as bench:
        moving(bench)
        bench.step(2000, beat=False)
        bench.steps(PATIENCE + 1, beat=False)
        assert bench.tick.watch["orphaned"][0]


def test_a_supervisor_that_beats_now_and_then_is_enough():
    with hand() as bench:
        moving(bench)
        for _ in range(3):
            bench.steps(PATIENCE - 1, beat=False)
            bench.step()
        assert bench.status("x")["state"] in (AxisState.RUNNING, AxisState.IDLE)
        assert not bench.may_end


def test_a_supervisor_that_comes_back_too_late_starts_nothing_any_more():
    with hand() as bench:
        moving(bench)
        bench.steps(500)
        bench.steps(PATIENCE + 2, beat=False)
        bench.ask(Verb.RESET, "y")
        for verb in (Verb.START, Verb.HOME, Verb.FOLLOW):
            assert bench.ask(verb, "y") is Reply.WRONG_STATE
        while not bench.may_end:
            bench.step()
        assert bench.row("x")["command_v"] == 0.0


def test_shutdown_ramps_down_and_ends_the_loop():
    with hand() as bench:
        moving(bench)
        bench.steps(500)
        assert bench.ask(Verb.SHUTDOWN) is Reply.OK
        assert not bench.may_end
        assert bench.ask(Verb.START, "y") is Reply.WRONG_STATE
        ticks = 0
        while not bench.may_end:
            bench.step()
            ticks += 1
        assert 0.05 < ticks * TS < 0.3
        assert bench.status("x")["state"] == AxisState.OFF
        assert bench.status("x")["fault"] == FaultCause.NONE


def test_the_loop_of_axes_at_rest_ends_in_the_tick_of_the_shutdown():
    with hand() as bench:
        bench.step()
        bench.ask(Verb.SHUTDOWN)
        assert bench.may_end


@pytest.mark.parametrize("elapsed", [2, 3, 10])
def test_skipped_periods_keep_the_axis_on_its_way(elapsed):
    with hand() as bench:
        moving(bench)
        bench.steps(300)
        began, errors = bench.number, []
        for _ in range(20):
            bench.step(elapsed)
            assert bench.row("x")["flags"] & SampleFlag.SKIPPED
            for _ in range(50):
                bench.step()
                errors.append(abs(bench.row("x")["following_error_m"]))
        assert bench.status("x")["state"] == AxisState.RUNNING
        assert max(errors) < 1e-3
        # The reference is where it would have been without gaps.
        bench.steps(3)
        way = point_to_point(0.0, 0.4, 0.5, 5.0, 500.0)
        passed = (bench.number - began + 300) * TS
        assert bench.row("x")["reference_m"] == pytest.approx(way.sample(passed)[0], abs=1e-9)
        status = bench.memory.status[0]
        assert status["skipped_periods"] == 20 * (elapsed - 1)
        assert status["overruns"] == 0


def test_a_gap_over_the_start_of_a_program_loses_no_time_of_it():
    with hand() as bench:
        bench.step()
        bench.ask(Verb.START, "x")
        way = point_to_point(0.0, 0.4, 0.5, 5.0, 500.0)
        first = bench.number + 10
        bench.follow("x", way, tick=first)
        bench.step(20)
        passed = (bench.number - first) * TS
        assert bench.row("x")["reference_m"] == pytest.approx(way.sample(passed)[0], abs=1e-15)


def test_a_gap_is_no_speed():
    with hand() as bench:
        moving(bench)
        bench.steps(800)
        before = bench.row("x")["velocity_m_s"]
        bench.step(5)
        assert bench.row("x")["velocity_m_s"] == pytest.approx(before, rel=0.1)
        assert abs(bench.row("x")["command_v"]) < 5.0


def test_counting_overruns_stops_nothing():
    with hand(overrun_policy="count") as bench:
        moving(bench)
        bench.steps(100, overran=True)
        bench.step(50)
        assert bench.status("x")["state"] == AxisState.RUNNING
        assert bench.memory.status["overruns"][0] == 100
        assert bench.memory.status["skipped_periods"][0] == 49


def test_the_stop_policy_stops_every_axis_at_the_first_overrun():
    with hand(overrun_policy="stop") as bench:
        moving(bench)
        bench.steps(300)
        bench.step(overran=True)
        assert bench.status("x")["state"] == AxisState.STOPPING
        bench.steps(3000)
        for axis in ("x", "y"):
            assert bench.status(axis)["state"] == AxisState.FAULT
            assert bench.status(axis)["fault"] == FaultCause.OVERRUN
            assert bench.status(axis)["fault_limit"] == 1.0
        assert not bench.may_end  # the loop itself goes on


def test_the_bucket_leaks():
    with hand(overrun_policy="leaky_bucket", bucket_size=5) as bench:
        moving(bench)
        for _ in range(40):  # one in two is as much as leaks out
            bench.step(overran=True)
            bench.step()
        assert bench.status("x")["state"] == AxisState.RUNNING
        for _ in range(3):  # two in three fill it
            bench.steps(2, overran=True)
            assert bench.status("x")["state"] == AxisState.RUNNING
            bench.step()
        bench.steps(2, overran=True)
        assert bench.status("x")["state"] == AxisState.STOPPING


def test_every_skipped_period_fills_the_bucket():
    with hand(overrun_policy="leaky_bucket", bucket_size=5) as bench:
        moving(bench)
        bench.step(5)  # four are missing
        assert bench.status("x")["state"] == AxisState.RUNNING
        bench.step(overran=True)
        assert bench.status("x")["state"] == AxisState.STOPPING


@pytest.mark.parametrize(
    ("loop", "good"),
    [({"overrun_policy": "leaky_bucket", "bucket_size": 5}, 5), ({"overrun_policy": "stop"}, 1)],
)
def test_an_axis_that_late_ticks_stopped_is_not_reset_before_as_many_came_in_time(loop, good):
    with hand(**loop) as bench:
        moving(bench)
        while bench.status("x")["state"] != AxisState.FAULT:
            bench.step(overran=True)
        assert bench.status("x")["fault"] == FaultCause.OVERRUN
        for _ in range(12):  # wherever the bucket may be by then
            number = bench.memory.post(Verb.RESET, 0)
            bench.step(overran=True)
            assert bench.memory.reply(number) is Reply.CAUSE_LASTS
        for _ in range(good - 1):
            assert bench.ask(Verb.RESET, "x") is Reply.CAUSE_LASTS
        assert bench.ask(Verb.RESET, "x") is Reply.OK
        assert bench.ask(Verb.START, "x") is Reply.OK
        bench.steps(3000)
        assert bench.status("x")["state"] == AxisState.IDLE
    assert "ticks still come late" in lasting_words(FaultCause.OVERRUN)


def test_an_axis_that_is_started_while_every_tick_comes_late_is_stopped_again():
    with hand(overrun_policy="leaky_bucket", bucket_size=5) as bench:
        bench.steps(20, overran=True)  # nothing was led yet
        bench.ask(Verb.START, "y")
        bench.step(overran=True)
        assert bench.status("y")["fault"] == FaultCause.OVERRUN


def test_a_tick_allocates_nothing_that_grows():
    with hand() as bench:
        moving(bench)
        bench.steps(600)
        tracemalloc.start()
        bench.steps(100)
        before = tracemalloc.get_traced_memory()[0]
        bench.steps(5000)
        grown = tracemalloc.get_traced_memory()[0] - before
        tracemalloc.stop()
    assert grown < 1024


def test_rows_are_numbered_by_the_periods_that_passed():
    with hand() as bench:
        bench.steps(3)
        bench.step(4)
        bench.step()
        ticks, _, lost = bench.memory.drain()
        assert ticks["tick"].tolist() == [0, 1, 2, 6, 7]
        assert ticks["time_s"] == pytest.approx(ticks["tick"] * TS)
        assert lost == 0


def test_a_reader_that_is_too_slow_is_told_how_many_rows_it_lost():
    with hand() as bench:
        rows = bench.memory.ring_rows
        bench.steps(rows + 500)
        ticks, samples, lost = bench.memory.drain()
        assert lost + len(ticks) == rows + 500
        assert 500 <= lost <= 502
        assert (np.diff(ticks["tick"]) == 1).all()
        assert len(samples) == len(ticks)
        assert ticks["tick"][-1] == bench.number
