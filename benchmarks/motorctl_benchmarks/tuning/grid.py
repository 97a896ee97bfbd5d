"""A grid of gains that keep the margins, each of which is run: what a tuning should come near."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from pathlib import Path

from motorctl.config.analysis import LoopGains
from motorctl.config.axis_keys import CommandFilterKeys
from motorctl.errors import RunError
from motorctl.identify.compare.measures import measure_axis
from motorctl.log import read_recording
from motorctl.loop.simulation import simulate
from motorctl.tune.candidates import MarginsWanted
from motorctl.tune.tuning import GAIN_KEYS, filter_keys
from motorctl_benchmarks.tuning.machines import TunedMachine

K1_1_S = (60.0, 100.0, 160.0, 250.0, 400.0)
K2_1_S = (3.0, 10.0, 30.0, 80.0, 160.0)
"""gamma_d/ks."""
PARTS = (1.0, 0.85, 0.7)
"""Of the largest ks that keeps the margins."""
STEP = 1.03
MOST_STEPS = 200


def best_of_grid(machine: TunedMachine, wanted: MarginsWanted, folder: Path) -> tuple[float, int]:
    """Return the least eF of the grid [m], and how many gains were run.

    The largest ks that keeps the margins around the true plant, and parts of it, at each pair of
    zeros; the loop is stable at every corner of the declared bounds.
    """
    least, runs = math.inf, 0
    for gains in allowed_gains(machine, wanted):
        runs += 1
        least = min(least, run_with(machine, gains, folder))
    return least, runs


def allowed_gains(machine: TunedMachine, wanted: MarginsWanted) -> Iterator[LoopGains]:
    """Yield the gains of the grid that keep the margins."""
    for k1 in K1_1_S:
        for k2 in K2_1_S:
            if k2 <= k1:
                yield from _at(machine, wanted, k1, k2)


def run_with(machine: TunedMachine, gains: LoopGains, folder: Path) -> float:
    """Return the eF of a run with these gains [m]; inf where it trips.

    A filter of the command stays as the machine has it, where the gains have none.
    """
    ready = machine.machine
    axis = ready.axes[machine.axis]
    changed = axis.gains.model_copy(update={key: getattr(gains, key) for key in GAIN_KEYS})
    if (own := filter_keys(gains)) is not None:
        keys = CommandFilterKeys.model_validate(own, strict=False)
        changed = changed.model_copy(update={"command_filter": keys})
    axes = {**ready.axes, machine.axis: axis.model_copy(update={"gains": changed})}
    log = folder / "grid.parquet"
    try:
        simulate(dataclasses.replace(ready, axes=axes), log)
    except RunError:
        return math.inf
    return measure_axis(read_recording(log, gaps="keep"), machine.axis).measures.eF_m


def _at(machine: TunedMachine, wanted: MarginsWanted, k1: float, k2: float) -> Iterator[LoopGains]:
    top = None
    ks = 20.0 * machine.plant["inertia_v_s2_m"]
    for _ in range(MOST_STEPS):
        gains = LoopGains(k1, ks, ks * k2)
        told = machine.margins(gains)
        if (
            told.stable
            and (told.phase_margin_deg or 0.0) >= wanted.phase_deg
            and (told.gain_margin or math.inf) >= wanted.gain
            and (told.gain_reduction or 0.0) <= 1.0 / wanted.gain
            and not machine.unstable_corners(gains)
        ):
            top = ks
        ks *= STEP
    for part in PARTS if top else ():
        yield LoopGains(k1, part * (top or 0.0), part * (top or 0.0) * k2)
