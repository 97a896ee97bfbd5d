"""Axes at a whole fraction of the loop's rate: the same control, in fewer ticks."""

import dataclasses

import numpy as np
import pytest
from loop_bench import Rig, gantry, with_axes

from motorctl.config import load
from motorctl.config.machine import DriverSetup
from motorctl.errors import ConfigError
from motorctl.hal import Outputs
from motorctl.identify.columns.measured import measured
from motorctl.identify.fit.recording import fit_recording
from motorctl.log import read_recording
from motorctl.log.sample import AxisState, SampleFlag
from motorctl.loop import Reply, Verb
from motorctl.loop.simulation import simulate
from motorctl.motion import point_to_point
from motorctl_sim import SimDriver, SimOptions

N = 10
SLOW = {
    "gains": {"k1_1_s": 40.0, "ks_v_s_m": 12.0, "gamma_d": 10.0},
    "adaptation": {"filter_rad_s": 60.0},
}


def sim(name: str, **options) -> DriverSetup:
    data = {"preset": "published_gantry", "seed": 3, **options}
    return DriverSetup(name, "sim", SimDriver, SimOptions.model_validate(data))


def alone(rate_hz: float, divisor: int):
    """Return a machine of axis x alone, in a loop of rate_hz, at a part of its rate."""
    machine = with_axes(gantry(), ["x"], divisor=divisor, **SLOW)
    only = {"x": machine.axes["x"]}
    return dataclasses.replace(
        machine, rate_hz=rate_hz, axes=only, drivers={"gantry": sim("gantry")}, programs={}
    )


def mixed():
    """Return a machine of x at 500 Hz beside y at 5 kHz, each with a driver of its own."""
    machine = with_axes(gantry(), ["x"], divisor=N, driver="slow", **SLOW)
    machine = with_axes(machine, ["y"], channel=0, driver="fast")
    drivers = {"slow": sim("slow"), "fast": sim("fast")}
    return dataclasses.replace(machine, drivers=drivers)


def rows_of_a_move(machine, per_second: float):
    with Rig(machine) as rig:
        rig.advance(round(0.02 * per_second))
        tick = round(0.06 * per_second)
        assert rig.ask(Verb.START) is Reply.OK
        rig.advance(round(0.04 * per_second) - rig.ticks)
        here = float(rig.state("x")["reference_m"])
        move = point_to_point(here, here + 0.2, 0.5, 5.0, 500.0)
        slot = rig.memory.load_program(0, move.segments)
        number = rig.memory.post(Verb.FOLLOW, 0, slot=slot, tick=tick)
        rig.advance(round(1.0 * per_second) - rig.ticks)
        assert rig.memory.reply(number) is Reply.OK
        return rig.rows("x"), rig.ticks_seen


@pytest.mark.slow
def test_an_axis_at_a_part_of_the_rate_is_controlled_as_in_a_loop_of_that_rate():
    slow, _ = rows_of_a_move(alone(500.0, 1), 500.0)
    part, ticks = rows_of_a_move(alone(5000.0, N), 5000.0)
    own = part[ticks["tick"] % N == 0]
    moving = own["state"] == AxisState.RUNNING
    assert moving.any()
    assert np.array_equal(moving, slow["state"] == AxisState.RUNNING)
    for name in ("reference_m", "position_m", "command_v", "theta_hat", "following_error_m"):
        # The loop's period times ten is the other loop's to the last digit or so.
        assert own[name] == pytest.approx(slow[name], abs=1e-9), name


def test_rows_between_an_axis_ticks_repeat_its_last_and_say_so():
    rows, ticks = rows_of_a_move(alone(5000.0, N), 5000.0)
    between = (rows["flags"] & SampleFlag.BETWEEN) > 0
    assert np.array_equal(between, ticks["tick"] % N != 0)
    last = (np.arange(len(rows)) // N) * N
    for name in ("position_m", "reference_m", "command_v", "theta_hat"):
        assert np.array_equal(rows[name], rows[name][last])


@pytest.mark.slow
def test_axes_of_different_rates_move_together():
    with Rig(mixed()) as rig:
        rig.start()
        here = {name: float(rig.state(name)["reference_m"]) for name in ("x", "y")}
        moves = {n: point_to_point(x, x + 0.1, 0.3, 3.0, 300.0) for n, x in here.items()}
        rig.follow(moves)
        rig.seconds(0.8)
        x, y = rig.rows("x"), rig.rows("y")
        own = (x["flags"] & SampleFlag.BETWEEN) == 0
        moved = [row["reference_m"][own] - row["reference_m"][own][0] for row in (x, y)]
        assert moved[0] == pytest.approx(moved[1], abs=1e-9)
        assert np.abs(x["following_error_m"]).max() < 0.5e-3
        assert np.abs(y["following_error_m"]).max() < 0.2e-3


@pytest.mark.slow
def test_the_driver_of_a_slow_axis_is_called_at_its_own_rate_only():
    rig = Rig(mixed())
    calls = dict.fromkeys(rig.tick.drivers, 0)
    for name, driver in rig.tick.drivers.items():
        write = driver.write

        def counted(outputs: Outputs, name=name, write=write) -> None:
            calls[name] += 1
            write(outputs)

        driver.write = counted
        rig.tick.put_in_place(name, driver)
    with rig:
        rig.advance(1000)
    assert calls == {"slow": 100, "fast": 1000}


def test_an_emergency_stop_reaches_a_slow_axis_in_its_next_tick():
    with Rig(mixed()) as rig:
        rig.start()
        rig.advance((3 - rig.ticks) % N)
        assert rig.ask(Verb.ESTOP) is Reply.OK
        assert rig.state_of("x") is AxisState.FAULT
        rig.advance(N)
        assert not rig.tick.drivers["slow"]._states["enable"].any()


CONFIG = """
name: two-rates
rate_hz: 5000
drivers:
  gantry: {type: sim, preset: published_gantry, rate_hz: RATE, late: {hold_ticks: 7, predict: true}}
axes:
  x:
    driver: gantry
    channel: 0
    encoder: {resolution_m: 0.5e-6}
    limits:
      travel_m: [-0.05, 0.45]
      max_velocity_m_s: 1.5
      max_acceleration_m_s2: 38
      max_jerk_m_s3: 8000
      max_voltage_v: 10
      following_error: {minimum_m: 0.001}
      stop: {acceleration_m_s2: 10, jerk_m_s3: 1000}
    gains: {k1_1_s: 40, ks_v_s_m: 12, gamma_d: 10, d_hat_max_v: 1}
    model: {inertia: {initial: 0.19, bounds: [0.1, 0.3]}}
    adaptation: {filter_rad_s: 60}
    homing: {method: absolute}
"""


def load_at(tmp_path, rate):
    file = tmp_path / "machine.yaml"
    file.write_text(CONFIG.replace("RATE", str(rate)))
    return load(file)


def test_a_driver_may_have_a_whole_part_of_the_loops_rate(tmp_path):
    machine = load_at(tmp_path, 500)
    assert machine.axes["x"].divisor == 10
    assert machine.period_of("x") == pytest.approx(2e-3)
    setup = machine.drivers["gantry"]
    assert (setup.late.hold_ticks, setup.late.predict) == (7, True)


@pytest.mark.parametrize("rate", [3000, 10_000, 4999.9])
def test_a_rate_that_does_not_divide_the_loops_is_refused(tmp_path, rate):
    with pytest.raises(ConfigError) as refusal:
        load_at(tmp_path, rate)
    (problem,) = [p for p in refusal.value.problems if p.key == "drivers.gantry.rate_hz"]
    assert "whole part" in problem.message
    assert problem.line == 5


def test_the_rules_of_an_axis_look_at_its_own_rate(tmp_path):
    file = tmp_path / "machine.yaml"
    file.write_text(CONFIG.replace("RATE", "500").replace("ks_v_s_m: 12", "ks_v_s_m: 250"))
    with pytest.raises(ConfigError, match=r"unstable.*at 500 Hz"):
        load(file)


def test_a_slow_axis_is_identified_from_its_own_ticks(tmp_path):
    machine = mixed()
    clean = {"preset": "published_gantry_clean"}
    drivers = {name: sim(name, **clean) for name in machine.drivers}
    machine = dataclasses.replace(machine, drivers=drivers)
    log = tmp_path / "run.parquet"
    simulate(machine, log, duration_s=5.0)
    recording = read_recording(log)
    x, y = (measured(recording, name) for name in ("x", "y"))
    assert (x.sample_rate_hz, y.sample_rate_hz) == (500.0, 5000.0)
    assert len(y.position) == N * len(x.position)
    model = machine.axes["x"].model
    fit = fit_recording(recording, {"x": model})
    # theta1 of the published X plant is 0.185 to 0.19 V*s^2/m.
    fitted = fit.axes["x"]
    theta = dict(zip(fitted.model.parameter_names, fitted.estimate.theta, strict=True))
    assert theta["inertia"] == pytest.approx(0.19, rel=0.1)


class Waits(SimDriver):
    """A driver whose reads may wait."""

    longest_wait_s = 1.4e-3


@pytest.mark.parametrize("rate", [500, 5000])
def test_a_driver_that_waits_longer_than_the_loop_has_time_is_refused(tmp_path, rate):
    file = tmp_path / "machine.yaml"
    text = CONFIG.replace("RATE", str(rate)).replace("type: sim", "type: test_loop_rates:Waits")
    file.write_text(text)
    with pytest.raises(ConfigError, match=r"gantry 1400 us.*leaves 160 us"):
        load(file)
