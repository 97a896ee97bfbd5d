"""What the simulated machine shows: counts, wraps, index marks, switches."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sim_bench import Bench, bare

from motorctl.hal import Status


def count_at(x, resolution_m=0.5e-6, counter_bits=32, **plant):
    bench = Bench(
        bare(initial_position_m=x, **plant), resolution_m=resolution_m, counter_bits=counter_bits
    )
    bench.driver.read(bench.inputs)
    return int(bench.inputs.counts[0])


@settings(max_examples=40)
@given(x=st.floats(-9.0, 9.0), resolution_m=st.sampled_from([1e-9, 0.5e-6, 1e-3]))
def test_the_count_is_the_position_in_nearest_steps(x, resolution_m):
    count = count_at(x, resolution_m, 64)
    assert abs(count * resolution_m - x) <= 0.5 * resolution_m + 1e-15


@settings(max_examples=40)
@given(x=st.floats(-9.0, 9.0), bits=st.integers(8, 32))
def test_a_narrow_counter_wraps_in_twos_complement(x, bits):
    full, wrapped = count_at(x, counter_bits=64), count_at(x, counter_bits=bits)
    assert -(2 ** (bits - 1)) <= wrapped < 2 ** (bits - 1)
    assert (full - wrapped) % 2**bits == 0


def test_unwrapped_differences_of_a_16_bit_counter_follow_the_carriage():
    bench = Bench(bare(), resolution_m=0.5e-6, counter_bits=16)
    motion = bench.run(8.0, 500)  # past 0.1 m: three turns of the counter
    steps = (np.diff(motion.counts[:, 0]) + 2**15) % 2**16 - 2**15
    assert np.abs(np.diff(motion.counts[:, 0])).max() > 2**15
    assert np.cumsum(steps) * 0.5e-6 == pytest.approx(motion.position_m[1:, 0], abs=0.3e-6)


def test_an_incremental_encoder_starts_at_zero_and_a_reversed_one_counts_down():
    assert count_at(0.2) == 400_000
    assert count_at(0.2, encoder={"reversed": True}) == -400_000
    assert count_at(0.2, encoder={"absolute": False}) == 0
    bench = Bench(
        bare(initial_position_m=0.2, encoder={"absolute": False, "reversed": True}),
        resolution_m=0.5e-6,
    )
    motion = bench.run(5.0, 200)
    way = motion.position_m[-1, 0] - 0.2
    assert motion.counts[-1, 0] == pytest.approx(-way / 0.5e-6, abs=1)


@settings(max_examples=30)
@given(x=st.floats(-0.1, 0.1))
def test_an_interpolation_error_is_in_the_measurement_only(x):
    error = {"amplitude_m": 0.3e-6, "period_m": 20e-6, "phase_rad": 0.2}
    seen = count_at(x, 1e-10, 64, encoder_error=error) * 1e-10
    exact = x + 0.3e-6 * math.sin(2 * math.pi * x / 20e-6 + 0.2)
    assert seen == pytest.approx(exact, abs=1.1e-10)


def test_an_interpolation_error_does_not_move_the_carriage():
    error = {"amplitude_m": 0.3e-6, "period_m": 20e-6}
    with_error = Bench(bare(encoder_error=error)).run(2.0, 200)
    without = Bench(bare()).run(2.0, 200)
    assert np.array_equal(with_error.position_m, without.position_m)
    assert not np.array_equal(with_error.counts, without.counts)


def test_encoder_noise_has_its_rms():
    motion = Bench(bare(encoder={"noise_rms_m": 2e-7})).run(0.0, 5000)
    assert motion.counts[:, 0].std() * 1e-9 == pytest.approx(2e-7, rel=0.05)
    assert motion.position_m[-1, 0] == 0.0


@pytest.mark.parametrize("direction", [-1, 1])
def test_hardware_latches_the_index_at_its_mark_and_not_where_the_carriage_is(direction):
    mark = direction * 0.0101
    bench = Bench(bare(encoder={"index_marks_m": [mark]}), resolution_m=0.5e-6)
    motion = bench.run(direction * 8.0, 200)
    latched = (motion.status[:, 0] & Status.INDEX_LATCHED) != 0
    (row,) = np.flatnonzero(latched)  # told once, in the read after the passage
    assert abs(motion.position_m[row - 1, 0]) < abs(mark) <= abs(motion.position_m[row, 0])
    assert motion.index_counts[row, 0] == round(mark / 0.5e-6)
    assert motion.index_counts[-1, 0] == round(mark / 0.5e-6)


def test_a_latched_index_waits_for_the_next_read():
    bench = Bench(bare(encoder={"index_marks_m": [0.001]}, initial_velocity_m_s=1.0))
    for _ in range(50):
        bench.driver.advance()
    bench.driver.read(bench.inputs)
    assert bench.inputs.status[0] & Status.INDEX_LATCHED
    bench.driver.read(bench.inputs)
    assert not bench.inputs.status[0] & Status.INDEX_LATCHED


def test_the_index_count_of_an_incremental_encoder_is_in_its_own_coordinates():
    encoder = {"absolute": False, "index_marks_m": [0.21]}
    plant = bare(encoder=encoder, initial_position_m=0.2, initial_velocity_m_s=1.0)
    motion = Bench(plant, resolution_m=0.5e-6).run(0.0, 100)
    assert motion.index_counts[-1, 0] == 20_000


def test_switches_are_pressed_over_their_stretch_of_travel():
    switches = {"limit_switches_m": [-0.02, 0.03], "home_switch": {"from_m": 0.005, "to_m": 0.01}}
    plant = bare(initial_position_m=-0.04, initial_velocity_m_s=1.0, **switches)
    motion = Bench(plant).run(0.0, 400)
    x, status = motion.position_m[:, 0], motion.status[:, 0]
    assert np.array_equal((status & Status.LIMIT_NEGATIVE) != 0, x <= -0.02)
    assert np.array_equal((status & Status.LIMIT_POSITIVE) != 0, x >= 0.03)
    assert np.array_equal((status & Status.HOME_SWITCH) != 0, (x >= 0.005) & (x <= 0.01))
    assert ((status & Status.HOME_SWITCH) != 0).any()


def test_without_switches_none_is_pressed():
    motion = Bench(bare(initial_velocity_m_s=1.0)).run(0.0, 100)
    assert not motion.status.any()
