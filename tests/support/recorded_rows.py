"""Recordings made up for tests: a log of two axes with a small error, a foreign file of one."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io

from motorctl.log import LogAxis, LogWriter
from motorctl.log.sample import TICK_SAMPLE, AxisState, axis_sample

RATE_HZ = 1000.0
PERIOD_S = 0.5
AXES = (LogAxis("x", ("inertia", "offset")), LogAxis("y", ("inertia",)))


def back_and_forth(time_s, period_s=PERIOD_S, distance_m=0.4):
    """Half a period out on a smooth step and dwell, half a period back."""
    phase = np.mod(time_s, period_s) / period_s
    out = np.clip(phase / 0.3, 0, 1)
    back = np.clip((phase - 0.5) / 0.3, 0, 1)

    def step(s):
        return s**3 * (10 - 15 * s + 6 * s**2)

    return distance_m * (step(out) - step(back))


def make_rows(count, axes=2, seed=0, ticks=None, error_m=1e-5, rate_hz=RATE_HZ):
    """Return TICK_SAMPLE (count,) and axis_sample (count, axes) filled with known signals."""
    random = np.random.default_rng(seed)
    tick = np.zeros(count, TICK_SAMPLE)
    tick["tick"] = np.arange(count) if ticks is None else ticks
    tick["time_s"] = tick["tick"] / rate_hz
    tick["lateness_s"] = random.uniform(0, 2e-6, count)
    tick["turnaround_s"] = random.uniform(5e-6, 3e-5, count)
    samples = np.zeros((count, axes), axis_sample(2))
    time_s = tick["time_s"][:, None]
    samples["reference_m"] = back_and_forth(time_s)
    samples["following_error_m"] = error_m * np.sin(2 * np.pi * 7 * time_s)
    samples["position_m"] = samples["reference_m"] + samples["following_error_m"]
    samples["command_v"] = 9 * np.sin(2 * np.pi * time_s / PERIOD_S)
    samples["theta_hat"] = random.normal(size=(count, axes, 2))
    samples["state"] = AxisState.RUNNING
    samples["flags"] = random.integers(0, 8, (count, axes))
    return tick, samples


def write_log(path, rows, metadata=None, axes=AXES, extra=None):
    """Write a finished log of given rows."""
    writer = LogWriter(path, metadata or {}, axes)
    writer.append(*rows)
    return writer.close(extra or {})


def columns(count=64):
    """A foreign recording of one axis at 200 Hz."""
    time_s = np.arange(count) / 200
    return {
        "time_s": time_s,
        "slide.position_m": np.sin(time_s),
        "slide.command_v": np.cos(time_s),
        "slide.reference_m": np.sin(time_s) + 1e-3,
    }


def write_csv(path, table, delimiter=",", head="", decimal="."):
    """Write columns as CSV in some dialect."""
    rows = [delimiter.join(table)]
    rows += [
        delimiter.join(repr(float(value)).replace(".", decimal) for value in row)
        for row in zip(*table.values(), strict=True)
    ]
    path.write_text(head + "\n".join(rows) + "\n")
    return path


def _in_struct(table):
    fields = {name.split(".")[1]: v for name, v in table.items() if "." in name}
    return {"time_s": table["time_s"], "slide": fields}


def sines(time_s):
    """Return columns of a foreign axis x that swings, at these times."""
    return {
        "time_s": time_s,
        "x.position_m": np.sin(6.0 * time_s),
        "x.command_v": np.sign(np.cos(6.0 * time_s)),
    }


def write_table(path, table):
    """Write columns in the format that the suffix says."""
    if path.suffix == ".csv":
        write_csv(path, table)
    elif path.suffix == ".parquet":
        pq.write_table(pa.table(table), path)
    else:
        scipy.io.savemat(path, _in_struct(table))
    return path
