"""The published experiment: C1 and C2 on the simulated gantry, compared."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from motorctl.config import load
from motorctl.config.axis_keys import Controller
from motorctl.identify.compare.pictures import plot_comparison, plot_turnaround
from motorctl.identify.compare.runs import Comparison, compare
from motorctl.log import read_recording
from motorctl.loop.simulation import Simulation, simulate

CONTROLLERS: tuple[Controller, ...] = ("C1", "C2")


@dataclass(frozen=True)
class Experiment:
    """C1 and C2 on the same motion."""

    comparison: Comparison
    simulations: dict[str, Simulation]
    pictures: list[Path]


def run_experiment(config: str, out: Path, progress: Callable[[str, float], None]) -> Experiment:
    """Simulate the machine's own programs with C1 and with C2; logs and pictures go into `out`."""
    simulations: dict[str, Simulation] = {}
    for controller in CONTROLLERS:
        doing = f"the published experiment with {controller}"
        progress(f"{doing}: compiling, where the cache is cold", 0.0)
        simulations[controller] = simulate(
            load(config, controller),
            out / f"{controller.lower()}.parquet",
            progress=partial(progress, doing),
        )
    progress("comparing C1 and C2", 0.0)
    comparison = compare([read_recording(run.log, gaps="keep") for run in simulations.values()])
    pictures = plot_comparison(comparison, out)
    turnarounds = {name: run.turnaround_s for name, run in simulations.items()}
    pictures.append(plot_turnaround(turnarounds, out / "turnaround.png"))
    return Experiment(comparison, simulations, pictures)
