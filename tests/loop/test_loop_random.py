"""Whatever comes, in whatever order: no voltage where there must be none, and none out of range."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_bench import Hand, Still, gantry, homed_by, with_axes, with_driver

from motorctl.hal import Status
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import Reply, Verb
from motorctl.motion import point_to_point

MAX_VOLTAGE_V = 10.0
channel = st.integers(0, 1)
actions = st.one_of(
    st.tuples(st.just("post"), st.sampled_from(list(Verb)), channel, st.integers(-1, 2)),
    st.tuples(st.just("status"), channel, st.sampled_from([Status(0), *Status])),
    st.tuples(st.just("count"), channel, st.integers(-400, 400)),
    st.tuples(st.just("jump"), channel, st.integers(-(2**33), 2**33)),
    st.tuples(st.just("index"), channel, st.integers(-(2**40), 2**40)),
    st.tuples(st.just("skip"), st.integers(1, 3000)),
    st.tuples(st.just("overrun")),
    st.tuples(st.just("silence"), st.integers(1, 50)),
    st.tuples(st.just("run"), st.integers(1, 400)),
)


def machine():
    base = with_axes(gantry(), ["x"], encoder={"counter_bits": 16})
    return with_driver(with_axes(base, ["x"], homing=homed_by("switch_index")), Still)


def assert_sound(hand: Hand, numbers: list[int]) -> None:
    device = hand.driver
    assert np.isfinite(device.volts).all()
    assert np.abs(device.volts).max() <= MAX_VOLTAGE_V
    for i, axis in enumerate("xy"):
        status, row = hand.status(axis), hand.row(axis)
        state = AxisState(int(status["state"]))
        off = state in (AxisState.OFF, AxisState.FAULT)
        assert bool(device.enable[i]) is not off
        if off:
            assert device.volts[i] == 0.0
            assert status["slot"] == -1
        assert (state is AxisState.FAULT) <= (status["fault"] != FaultCause.NONE)
        assert (state is AxisState.OFF) <= (status["fault"] == FaultCause.NONE)
        assert (state is AxisState.RUNNING) is bool(status["slot"] >= 0)
        assert row["command_v"] == device.volts[i]
        assert all(
            np.isfinite(row[name]).all() for name in row.dtype.names if row.dtype[name].kind == "f"
        )
        faulty = device.status[i] & (Status.ENCODER_LOST | Status.AMPLIFIER_FAULT | Status.ESTOP)
        assert off or not faulty
    assert all(isinstance(hand.memory.reply(number), Reply) for number in numbers)


@pytest.mark.slow
@settings(max_examples=60)
@given(st.lists(actions, min_size=1, max_size=40))
def test_no_sequence_of_events_leaves_the_safe_ground(sequence):
    with Hand(machine()) as hand:
        hand.step()
        for axis in range(2):
            place = hand.memory.axis_status["reference_m"][axis]
            hand.memory.load_program(axis, point_to_point(place, 0.1, 0.5, 5.0, 500.0).segments)
        numbers: list[int] = []
        for kind, *values in sequence:
            beat, elapsed, ticks, overran = True, 1, 1, False
            match kind:
                case "post":
                    verb, axis, slot = values
                    numbers.append(hand.memory.post(verb, axis, slot=slot))
                case "status":
                    hand.driver.status[values[0]] = values[1]
                case "count" | "jump":
                    hand.driver.counts[values[0]] += values[1]
                case "index":
                    hand.driver.index_counts[values[0]] = values[1]
                case "skip":
                    elapsed = values[0]
                case "overrun":
                    overran = True
                case "silence":
                    beat, ticks = False, values[0]
                case "run":
                    ticks = values[0]
            for _ in range(ticks):
                hand.step(elapsed, overran=overran, beat=beat)
                assert_sound(hand, [])
            assert_sound(hand, numbers)
            numbers.clear()
            if hand.may_end:
                break
        # Whatever happened, an emergency stop ends it.
        hand.ask(Verb.ESTOP)
        assert hand.driver.enable.tolist() == [0, 0]
        assert hand.driver.volts.tolist() == [0.0, 0.0]
