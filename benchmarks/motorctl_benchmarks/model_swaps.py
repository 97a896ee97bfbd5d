"""How late ticks are while other models are linked: `python -m motorctl_benchmarks.model_swaps`.

The shipped gantry runs at its 5 kHz, its axes hold, and models are changed again and again. Each
window around a change is held beside one in which nothing is changed, and so are the trips.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import yaml
from numpy.typing import NDArray

from motorctl.cli.say import say
from motorctl.config import load, shipped_config
from motorctl.config.machine import Machine
from motorctl.daemon.client import Client
from motorctl.errors import MotorctlError
from motorctl_benchmarks.running_daemon import running_daemon

BEFORE_S, AFTER_S = 0.03, 0.005
"""A window around the first tick of other models: linking takes a third of it before. By hand."""
IDLE_S = 0.3
"""How much later the window without a change is, by the loop's time: nothing is linked then."""
BETWEEN_S = 0.6
"""From a change to the next one, at least: room for the window without."""
LIMIT_PERIODS = 3
"""Ticks that the gantry's guards allow to be missing."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Windows:
    """The worst of each window, [s]."""

    delays_s: Array
    trips: int

    def line(self, name: str, limit_s: float) -> str:
        """Return them in words."""
        d = self.delays_s * 1e3
        return (
            f"{name}: {len(d)} windows, longest delay of a tick in ms: median {np.median(d):.3f}, "
            f"90 % {np.percentile(d, 90):.3f}, max {d.max():.3f}; "
            f"{int(np.sum(self.delays_s > limit_s))} above {limit_s * 1e3:g} ms; {self.trips} trips"
        )


def main() -> int:
    """Measure, and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--swaps", type=int, default=30)
    parser.add_argument(
        "--new", action="store_true", help="each time a model that was never linked before"
    )
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        document = yaml.safe_load(shipped_config("published_gantry").read_text())
        document["loop"]["without_realtime"] = "degrade"
        own = folder / "gantry.yaml"
        own.write_text(yaml.safe_dump(document))
        trips_s: list[float] = []
        with running_daemon(str(own), folder) as (_, client):
            for k in range(given.swaps):
                _let_hold(client, trips_s)
                machine = load(_other(document, folder, k, new=given.new))
                source = str(machine.source)
                client.ask("apply", config=machine.resolved, source=source)
                sys.stderr.write(f"\r{k + 1} of {given.swaps}")
                time.sleep(BETWEEN_S)
            _let_hold(client, trips_s)
        sys.stderr.write("\n")
        _tell(load(own), folder, np.array(trips_s))
    return 0


def _other(
    document: dict[str, dict[str, dict[str, object]]], folder: Path, k: int, *, new: bool
) -> Path:
    """Write the gantry with its x on C1 and on C2 in turn; with `new` on a lag of its own."""
    x = dict(document["axes"]["x"])
    if new:
        model = dict(x["model"])  # type: ignore[call-overload]
        x["model"] = model | {"input_lag": {"time_s": 2e-4 + 1e-6 * k}}
    else:
        x["controller"] = "C1" if k % 2 == 0 else "C2"
    path = folder / "other.yaml"
    path.write_text(yaml.safe_dump(document | {"axes": document["axes"] | {"x": x}}))
    return path


def _let_hold(client: Client, trips_s: list[float]) -> None:
    """Start what is off, and what has tripped, whose time is noted, until every axis holds."""
    while True:
        axes = client.ask("status")["axes"]
        for name, axis in axes.items():
            with suppress(MotorctlError):  # it may trip meanwhile
                if axis["state"] == "fault":
                    client.ask("reset", axis=name)
                    trips_s.append(float(axis["fault"]["message"].split(", at ")[1].split()[0]))
                if axis["state"] in ("fault", "off"):
                    client.ask("start", axis=name, hold=True)
        if all(axis["state"] == "idle" for axis in axes.values()):
            return
        time.sleep(0.05)


def _tell(machine: Machine, folder: Path, trips_s: Array) -> None:
    columns = ["time_s", "lateness_s", "turnaround_s", "x.command_v"]
    logs = [pq.read_table(path, columns=columns) for path in sorted(folder.glob("logs/*.parquet"))]
    time_s, late_s, turn_s, _ = (
        np.concatenate([log[name].to_numpy() for log in logs]) for name in columns
    )
    delays_s = late_s + np.maximum(turn_s - machine.period_s, 0.0)
    changes_s = np.array([log["time_s"][0].as_py() for log in logs[1:]])
    limit_s = LIMIT_PERIODS * machine.period_s
    for name, later_s in (("changes", 0.0), ("nothing", IDLE_S)):
        windows = [(at - BEFORE_S, at + AFTER_S) for at in changes_s + later_s]
        worst = [delays_s[(time_s >= low) & (time_s < high)].max() for low, high in windows]
        trips = sum(int(np.any((trips_s >= low) & (trips_s < high))) for low, high in windows)
        say(Windows(np.array(worst), trips).line(name, limit_s))
    lasts_s = len(time_s) * machine.period_s
    late = int(np.sum(delays_s > limit_s))
    say(
        f"whole run of {lasts_s:.0f} s: {late} ticks above {limit_s * 1e3:g} ms, {len(trips_s)} "
        "axes tripped"
    )
    bumps = [
        abs(after["x.command_v"][0].as_py() - before["x.command_v"][-1].as_py())
        for before, after in pairwise(logs)
    ]
    first_s = max(log["turnaround_s"][0].as_py() for log in logs[1:])
    limit_v = machine.axes["x"].limits.max_voltage_v
    say(
        f"x: the command steps by {max(bumps):.4g} V at most, of {limit_v:g} V; the first tick of "
        f"other models takes {first_s * 1e6:.0f} us at most"
    )


if __name__ == "__main__":
    sys.exit(main())
