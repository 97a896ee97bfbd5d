"""Counts become a position: wrapped counters, both directions, and counts one cannot trust."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_bench import TS, Rig, Still, gantry, homed_by, with_axes, with_driver, with_sim

from motorctl.hal import Status
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import Reply, Verb
from motorctl.motion import point_to_point

RESOLUTION_M = 0.5e-6


def wrapped(count: int, bits: int, *, signed: bool) -> int:
    span = 1 << bits
    count %= span
    return count - span if signed and count >= span // 2 else count


def still(machine=None, **encoder) -> Rig:
    rig = Rig(with_driver(with_axes(machine or gantry(), ["x"], encoder=encoder), Still))
    rig.tick.open(virtual=True)
    return rig


@settings(max_examples=30)
@given(
    st.integers(8, 28),
    st.booleans(),
    st.integers(-(10**6), 10**6),
    st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=60),
)
def test_a_wrapped_counter_is_unwrapped(bits, signed, start, shares):
    # Steps of up to just below a quarter of the counter's range, or of what the axis can do.
    largest = min((1 << bits) // 4 - 1, 2000)
    rig = still(counter_bits=bits)
    rig.driver.counts[0] = wrapped(start, bits, signed=signed)
    rig.advance(1)
    first = rig.last("x")["position_m"]
    total = 0
    for share in shares:
        step = round(share * largest)
        total += step
        rig.driver.counts[0] = wrapped(start + total, bits, signed=signed)
        rig.advance(1)
        assert rig.last("x")["velocity_m_s"] == pytest.approx(step * RESOLUTION_M / TS)
    assert rig.state_of("x") is AxisState.OFF
    assert rig.last("x")["position_m"] - first == pytest.approx(total * RESOLUTION_M, abs=1e-10)


@pytest.mark.parametrize("bits", [12, 16, 32, 64])
def test_an_axis_moves_over_many_turns_of_its_counter(bits):
    machine = with_axes(with_sim(gantry()), ["x"], encoder={"counter_bits": bits})
    with Rig(machine) as rig:
        rig.start()
        rig.follow({"x": point_to_point(0.0, 0.4, 0.5, 10.0, 1000.0)})
        rig.seconds(1.1)
        rig.raise_faults()
        true = rig.driver.true_state().position_m[0]
        assert true == pytest.approx(0.4, abs=1e-5)
        assert rig.last("x")["position_m"] == pytest.approx(true, abs=RESOLUTION_M)


@pytest.mark.parametrize("direction", [-1, 1])
def test_direction_and_offset_give_machine_coordinates(direction):
    rig = still(direction=direction, offset_m=0.1)
    rig.driver.counts[0] = 1000
    rig.advance(1)
    assert rig.last("x")["position_m"] == pytest.approx(0.1 + direction * 1000 * RESOLUTION_M)
    rig.driver.counts[0] = 1010
    rig.advance(1)
    assert rig.last("x")["velocity_m_s"] == pytest.approx(direction * 10 * RESOLUTION_M / TS)


def test_a_reversed_encoder_closes_the_loop():
    machine = with_sim(gantry(), plants={0: {"encoder": {"reversed": True}}})
    machine = with_axes(machine, ["x"], encoder={"direction": -1})
    with Rig(machine) as rig:
        rig.start()
        rig.follow({"x": point_to_point(0.0, 0.1, 0.3, 5.0, 500.0)})
        rig.seconds(0.6)
        rig.raise_faults()
        assert rig.driver.true_state().position_m[0] == pytest.approx(0.1, abs=1e-5)


@pytest.mark.parametrize("step", [(1 << 16) // 4, -((1 << 16) // 4), (1 << 16) // 2])
def test_a_step_that_could_be_either_way_is_a_fault(step):
    rig = still(with_axes(gantry(), ["x"], limits={"max_velocity_m_s": 50.0}), counter_bits=16)
    rig.order(Verb.START, "x")
    rig.driver.counts[0] = step
    rig.advance(1)
    assert rig.fault_of("x") is FaultCause.ENCODER_JUMP


INCREMENTAL = homed_by("index", latch_velocity_m_s=0.01)


def homed(counter_bits: int, homing=INCREMENTAL) -> Rig:
    """Return a machine whose x has been homed to 0 at count 0 and is enabled."""
    rig = still(with_axes(gantry(), ["x"], homing=homing), counter_bits=counter_bits)
    rig.advance(1)
    rig.tick.axes["homed"][0] = 1
    rig.order(Verb.START, "x")
    return rig


@pytest.mark.parametrize("bits", [16, 32])
def test_an_incremental_encoder_that_was_lost_has_to_be_homed_again(bits):
    rig = homed(bits)
    rig.driver.status[0] = Status.ENCODER_LOST
    rig.driver.counts[0] = 20_000  # what comes in now is no position
    rig.advance(10)
    assert rig.fault_of("x") is FaultCause.ENCODER_LOST
    assert rig.last("x")["position_m"] == 0.0
    assert rig.last("x")["velocity_m_s"] == 0.0
    rig.driver.status[0], rig.driver.counts[0] = 0, 5
    rig.advance(1)
    assert not rig.state("x")["homed"]
    assert rig.ask(Verb.RESET) is Reply.OK
    assert rig.ask(Verb.START) is Reply.OK
    assert rig.ask(Verb.FOLLOW, slot=0) is Reply.NOT_HOMED


@pytest.mark.parametrize("bit", [Status.ENCODER_LOST, Status.COMMUNICATION_LOST])
def test_an_absolute_encoder_knows_its_position_again_after_a_loss(bit):
    rig = still(counter_bits=32)
    rig.order(Verb.START, "x")
    rig.driver.status[0], rig.driver.counts[0] = bit, 0x7FFFFFFF
    rig.advance(100)
    rig.driver.status[0], rig.driver.counts[0] = 0, 600_000  # carried 0.3 m on meanwhile
    rig.advance(2)
    assert rig.last("x")["position_m"] == pytest.approx(0.3)
    assert rig.last("x")["velocity_m_s"] == 0.0
    assert rig.state("x")["homed"]


def test_a_short_loss_of_communication_keeps_the_position():
    rig = homed(16)
    rig.driver.status[0] = Status.COMMUNICATION_LOST
    rig.advance(5)
    assert rig.fault_of("x") is FaultCause.COMMUNICATION
    rig.driver.status[0], rig.driver.counts[0] = 0, 1000
    rig.advance(1)
    assert rig.state("x")["homed"]
    assert rig.last("x")["position_m"] == pytest.approx(1000 * RESOLUTION_M)
    assert rig.last("x")["velocity_m_s"] == pytest.approx(1000 * RESOLUTION_M / (6 * TS))


def test_a_loss_in_which_the_counter_may_have_gone_round_drops_the_homing():
    # 16 bits are 32.8 mm, and at 1.8 m/s three quarters of that take 14 ms.
    for ticks, kept in ((40, True), (80, False)):
        rig = homed(16)
        rig.driver.status[0] = Status.COMMUNICATION_LOST
        rig.advance(ticks)
        rig.driver.status[0], rig.driver.counts[0] = 0, 10
        rig.advance(1)
        assert bool(rig.state("x")["homed"]) is kept
        assert rig.fault_of("x") is FaultCause.COMMUNICATION  # the first cause


def test_a_wide_counter_survives_any_loss_of_communication():
    rig = homed(32)
    rig.driver.status[0] = Status.COMMUNICATION_LOST
    rig.advance(5000)
    rig.driver.status[0], rig.driver.counts[0] = 0, 700_000
    rig.advance(1)
    assert rig.state("x")["homed"]
    assert rig.last("x")["position_m"] == pytest.approx(0.35)


def test_the_position_is_not_learned_from_before_it_is_known():
    machine = with_axes(with_sim(gantry()), ["x"], homing=homed_by("switch"))
    with Rig(machine) as rig:
        rig.order(Verb.HOME, "x")
        rig.seconds(1.0)
        rows = rig.rows("x")
        homing = rows["state"] == AxisState.HOMING
        assert np.ptp(rows["position_m"][homing]) > 0.01
        assert (rows["theta_hat"] == rows["theta_hat"][0]).all()
