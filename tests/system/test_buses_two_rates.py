"""A slow axis behind a bus beside a fast one: each at its own rate, in one loop."""

import copy

import numpy as np
import pytest

from motorctl.config import load, load_resolved
from motorctl.latency.loop_run import run_loop
from motorctl.log import read_recording
from motorctl.log.sample import AxisState, SampleFlag
from motorctl_benchmarks.buses.device import device_running
from motorctl_benchmarks.buses.machines import device_file
from motorctl_benchmarks.buses.transports import merged, transports

pytestmark = pytest.mark.wall_clock

SLOW_HZ, FAST_HZ = 500.0, 5000.0
GENTLE = {
    "gains": {"k1_1_s": 40.0, "ks_v_s_m": 12.0, "gamma_d": 10.0},
    "adaptation": {"filter_rad_s": 60.0},
    "limits": {"following_error": {"minimum_m": 0.02, "filter_time_s": 0.05}},
    "model": {"input_delay": {"time_s": 1.0 / SLOW_HZ}},
}
MOTION = {"max_velocity_m_s": 0.3, "max_acceleration_m_s2": 1.0, "jerk_time_s": 0.05, "period_s": 8}


def two_rates(endpoint: str):
    """Return a machine of x at 500 Hz on Modbus TCP beside y at 5 kHz, simulated directly."""
    (modbus,) = [t for t in transports() if t.name == "modbus tcp"]
    data = copy.deepcopy(dict(load("published_gantry").resolved))
    data["loop"]["without_realtime"] = "degrade"
    late = {"hold_ticks": 100, "predict": True}
    box = {**modbus.driver(endpoint), "rate_hz": SLOW_HZ, "late": late}
    data["drivers"] = {"box": box, "direct": data["drivers"]["gantry"] | {"late": late}}
    for name, driver in (("x", "box"), ("y", "direct")):
        data["axes"][name] |= {"driver": driver}
    data["axes"]["x"] = merged(data["axes"]["x"], GENTLE)
    data["programs"] = {
        f"published_{n}": data["programs"][f"published_{n}"] | MOTION for n in ("x", "y")
    }
    return load_resolved(data, "two_rates", hardware=True)


@pytest.mark.long
@pytest.mark.slow
def test_an_axis_on_modbus_at_500_hz_runs_beside_one_at_5_khz(tmp_path):
    (modbus,) = [t for t in transports() if t.name == "modbus tcp"]
    file = device_file(modbus) | {"rate_hz": SLOW_HZ}
    with device_running(file, tmp_path) as endpoint:
        machine = two_rates(endpoint)
        run = run_loop(machine, tmp_path / "run.parquet", 6.0, moving=True, progress=lambda _: None)
    recording = read_recording(run.log)
    x, y = recording.axes["x"], recording.axes["y"]
    own = (x.flags & SampleFlag.BETWEEN) == 0
    # After skipped periods every row may be one of its own.
    assert SLOW_HZ / FAST_HZ * 0.9 < np.mean(own) < 0.5
    assert not (y.flags & SampleFlag.BETWEEN).any()
    for axis in (x, y):
        moving = axis.state == AxisState.RUNNING
        assert np.ptp(axis.position[moving]) > 0.2
        # Pauses of the machine that the test runs on are no matter of the rates.
        assert np.percentile(np.abs(axis.following_error[moving]), 90) < 2e-3
