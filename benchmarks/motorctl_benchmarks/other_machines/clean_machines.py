"""Clean machines to order: each form of friction with each kind of noise, and nothing missing."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from motorctl.identify.columns.measured import Measured, with_others
from motorctl.log import read_recording
from motorctl_benchmarks.other_machines.machine_recording import MachineRecording

Array = NDArray[np.float64]

FRICTIONS = ("sign", "tanh", "arctan", "algebraic", "clipped")
"""Forms of Coulomb friction, in the order in which the generators count them."""
UNEVEN = "uneven"
NOISES = {"white": 1, "coloured": 2, "coarse": 3, UNEVEN: 0}
"""Noises, and what the generators call them. Uneven: the encoder is fine, but samples are taken, or
stamped, whenever the recorder comes to it, and some are missing."""
SEEDS = 100
"""Seeds of the generators from one of ours to the next: every kind draws a machine of its own."""
FIRST_SEED = 100_000
"""Of the generators, far from those of machines with an effect."""
JITTER = 0.3
"""How far samples that are taken unevenly lie off their time, in periods, at most."""
LATENESS = 0.2
"""Mean lateness of stamps, in periods; they are late by less than one."""
MISSING = 0.003
"""Part of the samples that are missing."""
HOLES, HOLE_SAMPLES = 3, 25
"""Longer holes, and the samples that each lacks."""


@dataclass(frozen=True)
class Order:
    """What a clean machine shall have."""

    friction: int
    noise: int
    seeds_on: int
    is_uneven: bool = False

    def seed(self, ours: int) -> int:
        """Return the generator's seed that stands for one of ours."""
        return FIRST_SEED + SEEDS * ours + self.seeds_on


CLEAN_KINDS: Mapping[str, Order] = {
    f"clean_{form}_{noise}": Order(i, number, len(NOISES) * i + k, noise == UNEVEN)
    for i, form in enumerate(FRICTIONS)
    for k, (noise, number) in enumerate(NOISES.items())
}
"""By kind."""


def unevenly_recorded(recording: MachineRecording, seed: int) -> tuple[Measured, str]:
    """Return a machine as a recorder wrote it down that keeps no time, and what that did.

    It is read from a file, as any recording with a column of times.
    """
    rng = np.random.default_rng([seed, 41])
    rows = len(recording.time_s)
    period_s = float(recording.time_s[-1] - recording.time_s[0]) / (rows - 1)
    ticks = np.arange(rows, dtype=np.float64)
    kept = rng.random(rows) >= MISSING
    for start in rng.integers(rows // 10, rows - rows // 10, HOLES):
        kept[start : start + HOLE_SAMPLES] = False
    kept[[0, -1]] = True
    if stamped_late := bool(rng.random() < 0.5):
        taken = ticks
        stamps = ticks + np.minimum(rng.exponential(LATENESS, rows), 0.9)
    else:
        taken = np.clip(ticks + rng.uniform(-JITTER, JITTER, rows), 0.0, rows - 1.0)
        stamps = taken
    columns = {
        "time_s": recording.time_s[0] + stamps * period_s,
        "position": _read_at(taken, recording.position, recording.resolution),
        "command": recording.command[np.floor(taken).astype(np.int64)],
    }
    if recording.reference is not None:
        columns["reference"] = np.asarray(CubicSpline(ticks, recording.reference)(taken))
    axis = {
        "position": {
            "column": "position",
            "unit": recording.position_unit,
            "resolution": recording.resolution,
            "resolution_unit": recording.position_unit,
        },
        "command": {"column": "command", "unit": recording.command_unit.replace(" ", "*")},
    }
    if recording.reference is not None:
        axis["reference"] = {"column": "reference", "unit": recording.position_unit}
    with TemporaryDirectory() as folder:
        np.savez(
            Path(folder, "machine.npz"), **{name: each[kept] for name, each in columns.items()}
        )
        description = Path(folder, "machine.yaml")
        document = {"file": "machine.npz", "time": {"column": "time_s"}, "axes": {"x": axis}}
        description.write_text(json.dumps(document))  # which is YAML as well
        measured = with_others(read_recording(description), "x")
    how = "stamped late" if stamped_late else "taken unevenly"
    return measured, f"samples {how}, {rows - int(kept.sum())} missing"


def _read_at(places: Array, position: Array, step: float) -> Array:
    """Return what the encoder shows between samples."""
    ticks = np.arange(len(position), dtype=np.float64)
    between = np.asarray(CubicSpline(ticks, position)(places))
    offset = position[0]
    return np.asarray(offset + np.rint((between - offset) / step) * step)
