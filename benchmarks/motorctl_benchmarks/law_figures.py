"""One step of the control law: compiled, beside plain numpy and beside the published times."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from motorctl.config import load
from motorctl.config.axis_keys import Controller
from motorctl.identify.compare.published import DEVICE, PAPER, TURNAROUND_S
from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress, part_of
from motorctl.model import EffectList
from motorctl_benchmarks.interleave import interleaved, median_ratio
from motorctl_benchmarks.law_data import LawData, record_law
from motorctl_benchmarks.law_loop import CompiledLaw
from motorctl_benchmarks.numpy_law import NumpyLaw

CONFIG = "published_gantry"
AXIS = "x"
STEPS = 1000
ROUNDS = 25
NUMPY_TARGET = Target("ratio", ">=", 15.0)
STEP_TARGET = Target("value", "<", 1.0)


def law_figures(progress: Progress) -> tuple[list[Figure], list[str]]:
    """Measure a step of C2 and of C1; return figures and notes."""
    figures: list[Figure] = []
    notes = [
        f"Law steps: the mean over {STEPS} steps of axis {AXIS} of {CONFIG}, recorded from the "
        "start of a move, in every one of which the estimator learns; processor time, so that "
        "other work on this machine counts for neither.",
        f"Published: turnaround on a {DEVICE} ({PAPER}); told, not measured.",
    ]
    controllers: tuple[Controller, ...] = ("C2", "C1")
    for k, controller in enumerate(controllers):
        data = record_law(load(CONFIG, controller), AXIS, STEPS)
        compiled, plain = _subjects(data)
        times = interleaved(
            {"compiled": compiled, "numpy": plain},
            ROUNDS,
            part_of(progress, k / len(controllers), (k + 1) / len(controllers)),
        )
        step_us = float(np.median(times["compiled"]))
        published_us = TURNAROUND_S[controller] * 1e6
        figures += [
            Figure(
                name=f"{controller.lower()}_step",
                title=f"{controller} step, compiled",
                value=step_us,
                unit="us",
                peer="the same law in numpy",
                peer_value=float(np.median(times["numpy"])),
                ratio=median_ratio(times["numpy"], times["compiled"]),
                target=NUMPY_TARGET,
            ),
            Figure(
                name=f"{controller.lower()}_step_published",
                title=f"{controller} step, compiled",
                value=step_us,
                unit="us",
                peer=f"published, {DEVICE}",
                peer_value=published_us,
                ratio=published_us / step_us,
                target=STEP_TARGET,
            ),
        ]
    return figures, notes


def _subjects(data: LawData) -> tuple[Callable[[], float], Callable[[], float]]:
    compiled = CompiledLaw(data)
    rows = list(zip(*(column.tolist() for column in data.motion), strict=True))
    slope_s_m = friction_slope_s_m(data.model)
    now = time.thread_time_ns

    def run_compiled() -> float:
        compiled.restart()
        began = now()
        compiled.run()
        return (now() - began) * 1e-3 / data.steps

    def run_numpy() -> float:
        law = NumpyLaw(data.settings[0], data.start[0], slope_s_m)
        step = law.step
        began = now()
        for y, xd, vd, ad in rows:
            step(y, xd, vd, ad)
        return (now() - began) * 1e-3 / data.steps

    return run_compiled, run_numpy


def friction_slope_s_m(model: EffectList) -> float:
    """Return the slope of Sf in a model's Coulomb friction [s/m]."""
    friction = next(effect for effect in model.effects if effect.name == "coulomb_friction")
    return friction.constants[0]
