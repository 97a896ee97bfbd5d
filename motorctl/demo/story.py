"""Run the published experiment with C1 and C2 and compare."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from motorctl.config import load
from motorctl.config.machine import Controller
from motorctl.demo.page import write_page
from motorctl.insight.compare import Comparison, compare
from motorctl.insight.plots import plot_comparison, plot_turnaround
from motorctl.log import read_recording
from motorctl.loop.simulation import Simulation, simulate

CONFIG = "published_gantry"
CONTROLLERS: tuple[Controller, ...] = ("C1", "C2")


@dataclass(frozen=True)
class Story:
    """What the demonstration found."""

    comparison: Comparison
    simulations: dict[str, Simulation]
    pictures: list[Path]
    page: Path


def tell(out: Path, progress: Callable[[str, float], None]) -> Story:
    """Run the demonstration, writing logs, pictures and a page into `out`.

    progress(what, share) is told what is being done, and how much of it is.
    """
    out.mkdir(parents=True, exist_ok=True)
    simulations: dict[str, Simulation] = {}
    for controller in CONTROLLERS:
        doing = f"the published experiment with {controller}"
        progress(f"{doing}: compiling, where the cache is cold", 0.0)
        simulations[controller] = simulate(
            load(CONFIG, controller),
            out / f"{controller.lower()}.parquet",
            progress=partial(progress, doing),
        )
    progress("comparing", 0.0)
    recordings = [read_recording(run.log, gaps="keep") for run in simulations.values()]
    comparison = compare(recordings)
    pictures = plot_comparison(comparison, out)
    turnarounds = {name: run.turnaround_s for name, run in simulations.items()}
    pictures.append(plot_turnaround(turnarounds, out / "turnaround.png"))
    page = write_page(out / "index.html", comparison, simulations, pictures)
    progress("done", 1.0)
    return Story(comparison, simulations, pictures, page)
