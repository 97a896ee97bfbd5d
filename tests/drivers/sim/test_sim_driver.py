"""The simulated gantry as a driver: virtual and wall time, repeatability, safety."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sim_bench import PERIOD_S, Bench, bare

from motorctl.hal import Channel, Inputs, Outputs, driver_class
from motorctl_sim import SimDriver, SimOptions
from motorctl_sim.pace import Pace


def make(n=2, period_s=PERIOD_S, **options):
    channels = [Channel(f"axis{i}", i, 0.5e-6, 32, 10.0) for i in range(n)]
    return SimDriver(SimOptions.model_validate(options), channels, period_s)


def counts_of_a_run(n=2, periods=300, **options):
    driver = make(n, **options)
    driver.start_virtual_time()
    driver.open()
    inputs, outputs = Inputs(n), Outputs(n)
    outputs.enable[:] = 1
    counts = []
    for k in range(periods):
        outputs.volts[:] = 3.0 * np.sin(0.05 * k)
        driver.write(outputs)
        driver.advance()
        driver.read(inputs)
        counts.append(inputs.counts.copy())
    return np.array(counts)


def test_the_driver_is_found_under_its_name():
    assert driver_class("sim") is SimDriver


NOISY = {0: {"force_noise_rms_v": 0.2}, 1: {"force_noise_rms_v": 0.2}}


def test_the_same_seed_gives_the_same_counts_and_another_seed_others():
    first = counts_of_a_run(seed=7, plants=NOISY)
    assert np.array_equal(first, counts_of_a_run(seed=7, plants=NOISY))
    assert not np.array_equal(first, counts_of_a_run(seed=8, plants=NOISY))


def test_opening_again_starts_the_same_machine_over():
    driver = make(plants=NOISY)
    driver.start_virtual_time()
    runs = []
    for _ in range(2):
        driver.open()
        for _ in range(200):
            driver.advance()
        runs.append(driver.true_state().position_m)
        driver.close()
    assert np.array_equal(*runs)
    assert runs[0].any()


def test_noise_on_one_channel_does_not_depend_on_how_many_there_are():
    two, eight = counts_of_a_run(2, plants=NOISY), counts_of_a_run(8, plants=NOISY)
    assert np.array_equal(two, eight[:, :2])
    assert not np.array_equal(eight[:, 2], eight[:, 0])  # the same plant, noise of its own


def test_channels_follow_their_numbers_and_not_their_order():
    channels = [Channel("y", 1, 1e-9, 64, 10.0), Channel("x", 0, 1e-9, 64, 10.0)]
    driver = SimDriver(SimOptions(preset="published_gantry_clean"), channels, PERIOD_S)
    driver.start_virtual_time()
    driver.open()
    outputs = Outputs(2)
    outputs.enable[:], outputs.volts[:] = 1, 5.0
    driver.write(outputs)
    driver.advance()
    y, x = driver.true_state().acceleration_m_s2
    assert x / y == pytest.approx(0.670 / 0.197, rel=0.1)


def test_one_advance_is_one_period_whatever_the_wall_clock_says():
    driver = make()
    driver.start_virtual_time()
    driver.open()
    driver.advance()
    time.sleep(0.01)
    driver.read(Inputs(2))
    assert driver.true_state().time_s == pytest.approx(PERIOD_S)


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [250.0, 1000.0, 5000.0, 7300.0, 20000.0])
def test_the_physics_does_not_depend_on_the_rate_of_the_loop(rate_hz):
    plant = bare(coulomb_friction_v=0.1, viscous_friction_v_s_m=0.3, input_lag={"time_s": 0.4e-3})
    bench = Bench(plant, period_s=1.0 / rate_hz)
    motion = bench.run(1.0, round(0.2 * rate_hz))
    reference = Bench(plant, period_s=1e-5).run(1.0, 20000)
    exact = np.interp(motion.time_s[-1], reference.time_s, reference.position_m[:, 0])
    assert motion.position_m[-1, 0] == pytest.approx(exact, rel=1e-5)


def test_safe_may_be_called_at_any_time():
    driver = make()
    driver.safe()
    driver.start_virtual_time()
    driver.open()
    outputs = Outputs(2)
    outputs.enable[:], outputs.volts[:] = 1, 5.0
    driver.write(outputs)
    driver.advance()
    driver.safe()
    driver.advance()
    # behind delay and lag the thrust is on its way to zero
    for _ in range(50):
        driver.advance()
    assert driver.true_state().current_v == pytest.approx(0.0, abs=1e-6)
    driver.close()
    driver.safe()


def test_reading_before_open_and_after_close_moves_nothing():
    driver, inputs = make(), Inputs(2)
    driver.read(inputs)
    driver.open()
    driver.close()
    before = driver.true_state()
    time.sleep(0.005)
    driver.read(inputs)
    assert driver.true_state().time_s == before.time_s


def test_on_the_wall_clock_the_plant_moves_between_reads():
    driver = make(preset="published_gantry_clean", plants={0: bare(), 1: bare()})
    inputs, outputs = Inputs(2), Outputs(2)
    driver.open()
    driver.read(inputs)
    outputs.enable[:], outputs.volts[:] = 1, 1.0
    driver.write(outputs)
    start = time.monotonic()
    time.sleep(0.02)
    driver.read(inputs)
    passed = time.monotonic() - start
    state = driver.true_state()
    assert 0.02 - PERIOD_S <= state.time_s <= passed + PERIOD_S
    assert state.position_m[0] == pytest.approx(0.5 / 0.2 * state.time_s**2, rel=1e-6)
    driver.close()


def test_the_rate_budget_says_where_it_comes_from_and_falls_with_axes():
    few, many = make(2).rate_budget(), make(200).rate_budget()
    assert few.max_rate_hz == 20e3
    assert many.max_rate_hz < 2e3
    assert "2 axes x 10 substeps" in few.arithmetic
    assert "no bus" in few.arithmetic


class TestPace:
    PERIOD_NS = 200_000

    @settings(max_examples=50)
    @given(
        first=st.integers(0, 10**12),
        jitter=st.lists(st.integers(-60_000, 60_000), min_size=20, max_size=60),
    )
    def test_jitter_neither_doubles_nor_drops_a_period(self, first, jitter):
        pace = Pace(200e-6)
        pace.periods(first)
        steps = [pace.periods(first + (k + 1) * self.PERIOD_NS + j) for k, j in enumerate(jitter)]
        assert steps == [1] * len(jitter)

    def test_a_late_first_read_does_no_harm_for_long(self):
        pace = Pace(200e-6)
        pace.periods(90_000)  # 0.45 periods late
        rng = np.random.default_rng(0)
        late = rng.integers(-5_000, 5_000, 400)
        steps = [pace.periods((k + 1) * self.PERIOD_NS + int(j)) for k, j in enumerate(late)]
        assert steps == [1] * 400
        wild = rng.integers(-80_000, 80_000, 400)
        times = [(k + 401) * self.PERIOD_NS + int(j) for k, j in enumerate(wild)]
        assert [pace.periods(t) for t in times] == [1] * 400

    def test_skipped_periods_count(self):
        pace = Pace(200e-6)
        pace.periods(0)
        assert pace.periods(self.PERIOD_NS) == 1
        assert pace.periods(4 * self.PERIOD_NS) == 3
        assert pace.periods(5 * self.PERIOD_NS + 180_000) == 1  # late, but nothing was skipped
        assert pace.periods(6 * self.PERIOD_NS) == 1

    def test_work_after_a_long_pause_is_bounded(self):
        pace = Pace(200e-6)
        pace.periods(0)
        assert pace.periods(10**12) == Pace.MAX_PERIODS
        assert pace.periods(10**12 + self.PERIOD_NS) == 1
