"""Scan an axis of a running daemon with bluesky: how still does it hold, place by place?

motorctl run published_gantry --socket /tmp/m.sock
python examples/bluesky_scan.py /tmp/m.sock x 0.05 0.15 5
"""

from __future__ import annotations

import sys
from typing import Any

import bluesky.plans as bp
from bluesky.run_engine import RunEngine
from ophyd_async.core import init_devices
from ophyd_axis import Axis, StandstillNoise


def main(socket: str, axis: str, first_m: float, last_m: float, places: int) -> None:
    """Scan so many places between two positions [m] and print a line for each."""
    run_engine = RunEngine({})
    with init_devices():
        stage = Axis(socket, axis)
        noise = StandstillNoise(socket, axis)

    def tell(name: str, document: Any) -> None:
        if name == "event":
            read = document["data"]
            place_mm, noise_um = read["stage-position"] * 1e3, read["noise-rms"] * 1e6
            print(f"{axis} at {place_mm:8.4f} mm: following error {noise_um:.3f} µm rms")

    run_engine(bp.scan([noise], stage, first_m, last_m, places), tell)


if __name__ == "__main__":
    where, which, begin, end, count = sys.argv[1:]
    main(where, which, float(begin), float(end), int(count))
