"""The loop of each axis as a Bode plot, with its margins where they are read."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from motorctl.axis_units import AxisUnits
from motorctl.config.analysis import open_loop
from motorctl.config.loop_cases import USUAL_PHASE_DEG, LoopCase, loop_cases
from motorctl.config.machine import Axis, Machine
from motorctl.errors import UsageError
from motorctl.picture_style import colour, panels_in_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS = 600
"""Of a curve; only looks depend on it."""
DECADES = 3.0
"""How far below the Nyquist frequency the picture begins [decades]; only looks depend on it."""
LOWEST_DB = -60.0
"""Of the picture [dB]; only looks depend on it."""
HEIGHT_INCHES = 2.9


def draw_loops(machine: Machine, folder: Path) -> list[Path]:
    """Draw the open loop of every axis, over the bounds of its inertia, a period late.

    Parameters
    ----------
    machine
        A checked machine.
    folder
        Where the pictures go; made where it is not there.

    Returns
    -------
    list of Path
        A PNG file an axis.

    Raises
    ------
    UsageError
        Where they cannot be written.
    """
    written = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, axis in machine.axes.items():
            path = folder / f"bode_{name}.png"
            _draw(axis, machine.period_of(name), path)
            written.append(path)
    except OSError as error:
        raise UsageError(f"--out {folder}: cannot be written: {error.strerror}") from error
    return written


def _draw(axis: Axis, period_s: float, path: Path) -> None:
    late = list(loop_cases(axis, period_s))[1::2]
    with panels_in_file(2, path, height=HEIGHT_INCHES) as (figure, (size, phase)):
        figure.suptitle(
            f"Open loop of axis {axis.name}, k1 {axis.gains.k1_1_s:g} 1/s, ks "
            + axis.units.words(f"{axis.gains.ks_v_s_m:g} V s/m, ")
            + f"{late[0].delay_s * 1e3:g} ms of delay",
            x=0.01,
            ha="left",
        )
        for k, case in enumerate(late):
            _draw_case(size, phase, case, colour(k), axis.units)
        size.axhline(0.0, color="black", lw=0.7)
        size.set_ylim(bottom=LOWEST_DB)
        size.set_ylabel("|L| [dB]")
        size.legend(frameon=False, fontsize=8, loc="upper right")
        phase.axhline(-180.0, color="black", lw=0.7)
        phase.axhspan(-180.0 - USUAL_PHASE_DEG, -180.0 + USUAL_PHASE_DEG, color="black", alpha=0.06)
        phase.set_ylim(-360.0, 0.0)
        phase.set_yticks(range(-360, 1, 60))
        phase.set_ylabel(f"phase of L [degrees]\ngrey: within {USUAL_PHASE_DEG:g} of -180")
        phase.set_xlabel("frequency [Hz]")
        phase.set_xscale("log")


def _draw_case(size: Axes, phase: Axes, case: LoopCase, line: str, units: AxisUnits) -> None:
    nyquist = math.pi / case.period_s
    w = np.geomspace(nyquist / 10.0**DECADES, 0.999 * nyquist, POINTS)
    response = open_loop(case.plant, case.gains, w)
    turn = np.unwrap(np.angle(response))
    turn -= 2.0 * np.pi * np.ceil(turn[0] / (2.0 * np.pi))  # below 0, as a loop of integrators is
    margins = case.margins
    told = "unstable"
    if margins.stable and margins.phase_margin_deg is not None:
        told = f"{margins.phase_margin_deg:.0f}°"
        if margins.gain_margin:
            told += f", {20.0 * math.log10(margins.gain_margin):.1f} dB"
    inertia = units.words(f"{case.inertia:g} V s²/m")
    label = f"inertia {case.inertia_at}, {inertia}: {told}"
    hz = w / (2.0 * np.pi)
    size.plot(hz, 20.0 * np.log10(np.abs(response)), color=line, lw=1.2, label=label)
    phase.plot(hz, np.degrees(turn), color=line, lw=1.2)
    if margins.crossover_rad_s is not None and margins.phase_margin_deg is not None:
        crossover_hz = margins.crossover_rad_s / (2.0 * np.pi)
        size.plot([crossover_hz], [0.0], "o", color=line, ms=5)
        at = float(np.interp(crossover_hz, hz, np.degrees(turn)))
        phase.plot([crossover_hz] * 2, [-180.0, at], color=line, lw=0.9)
