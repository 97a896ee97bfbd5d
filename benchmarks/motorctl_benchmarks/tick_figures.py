"""A whole tick, with its parts, and how it grows with the number of axes."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from contextlib import ExitStack

import numpy as np

from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress
from motorctl_benchmarks.gantries import gantry_with
from motorctl_benchmarks.interleave import Array, interleaved, median_ratio
from motorctl_benchmarks.tick_probe import PARTS, TickProbe

AXES = (1, 2, 4, 8)
TICKS = 250
ROUNDS = 40
TICK_TARGET = Target("value", "<", 15.0)
LINEAR_TARGET = Target("value", "<=", 2.0)


def tick_figures(progress: Progress) -> tuple[list[Figure], list[str]]:
    """Measure the tick of simulated gantries in turn; return figures and notes."""
    parts: dict[int, list[Array]] = {axes: [] for axes in AXES}

    def measure(axes: int, probe: TickProbe) -> Callable[[], float]:
        def run() -> float:
            medians = np.median(probe.run(TICKS), axis=0)
            parts[axes].append(medians)
            return float(medians[0])

        return run

    with ExitStack() as machines:
        subjects = {}
        for axes in AXES:
            probe = machines.enter_context(TickProbe(gantry_with(axes)))
            subjects[str(axes)] = measure(axes, probe)
            progress(0.5 * len(subjects) / len(AXES))
        times = interleaved(subjects, ROUNDS, lambda share: progress(0.5 + 0.5 * share))
    two_us = np.median(parts[2], axis=0) * 1e6
    figures = [
        Figure(
            name="tick_2_axes",
            title="whole tick of 2 axes",
            value=float(two_us[0]),
            unit="us",
            target=TICK_TARGET,
        )
    ]
    figures += [
        Figure(name=f"tick_2_axes_{part}", title=f"  of it {part}", value=float(us), unit="us")
        for part, us in zip(PARTS[1:], two_us[1:], strict=True)
    ]
    figures += growth_figures({axes: times[str(axes)] * 1e6 for axes in AXES})
    notes = [
        "Ticks: the loop's own, on simulated axes that move; the time that simulating their "
        "motion takes is left out. Publish includes what Python takes between the parts."
    ]
    return figures, notes


def growth_figures(times_us: dict[int, Array]) -> list[Figure]:
    """Judge how tick times [us] grow with the axes: arrays of rounds for 1, 2, 4, … axes.

    No worse than linear: no doubling of the axes more than doubles the tick.
    """
    axes = sorted(times_us)
    medians = {n: float(np.median(times_us[n])) for n in axes}
    figures = []
    for n in axes:
        one = n == axes[0]
        figures.append(
            Figure(
                name=f"tick_{n}_axes_per_axis",
                title=f"tick of {n} {'axis' if one else 'axes'}, per axis",
                value=medians[n] / n,
                unit="us",
                peer=None if one else "a machine of one axis",
                peer_value=None if one else medians[axes[0]],
                ratio=None if one else median_ratio(times_us[axes[0]] * n, times_us[n]),
            )
        )
    slope, fixed = np.polyfit(axes, [medians[n] for n in axes], 1)
    off = max(abs(fixed + slope * n - medians[n]) for n in axes)
    doublings = [
        median_ratio(times_us[more], times_us[fewer]) for fewer, more in itertools.pairwise(axes)
    ]
    return [
        *figures,
        Figure(name="tick_fixed", title="fit a + b n: a", value=float(fixed), unit="us"),
        Figure(name="tick_per_axis", title="fit a + b n: b", value=float(slope), unit="us"),
        Figure(name="tick_fit_error", title="fit: furthest off", value=float(off), unit="us"),
        Figure(
            name="tick_growth",
            title="worst growth as the axes double",
            value=max(doublings),
            unit="x",
            peer="linear growth",
            peer_value=2.0,
            ratio=2.0 / max(doublings),
            target=LINEAR_TARGET,
        ),
    ]
