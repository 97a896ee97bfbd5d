"""How public recordings of course rigs are read: a cart, rods, wheels on pendulums, a thin link."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from motorctl.log.table_mat import MatTable
from motorctl_benchmarks.real_machines.readers import Columns, Read, mat
from motorctl_benchmarks.real_machines.repositories import (
    BARE_ROD,
    PENDULUM_WHEEL,
    REACTION_WHEEL,
    SEESAW_CART,
    THIN_LINK,
    TWO_RODS,
    folder_of,
)

SUPPLY_V = 12.0
"""That a duty cycle of 1 stands for, by the authors of the bare motor with a rod."""


def seesaw_cart(recordings: Path) -> Columns:
    """Read a cart on a rack, a chirp of 3 V, m, 500 Hz, a signal a row."""
    time_s, command, position, _ = mat(folder_of(recordings, SEESAW_CART) / "data/data.mat")["data"]
    return {"time_s": time_s, "position": position, "command": command}


def upper_rod(name: str) -> Read:
    """Return the reader of the upper of two rods on a geared motor, 1 kHz."""

    def read(recordings: Path) -> Columns:
        rows = mat(folder_of(recordings, TWO_RODS) / "data" / "oldData" / f"{name}.mat")
        time_s = rows["t"]
        command = 100.0 * rows["input"][: len(time_s)]
        return {"time_s": time_s, "position": rows["theta_1"], "command": command}

    return read


def reaction_wheel(name: str, what: str = "velocity") -> Read:
    """Return the reader of a wheel on a pendulum, 20 Hz: its speed, or the pendulum's angle."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, REACTION_WHEEL) / "Identification" / "Data" / f"{name}.mat"
        column = 2 if what == "velocity" else 1
        measured, sent = f"Meas.signals.values(:,{column})", "CtrlIn.signals.values"
        rows = MatTable(path).read([measured, sent])
        return {
            "time_s": np.arange(len(rows[sent])) / 20.0,
            what: rows[measured],
            "command": 100.0 * rows[sent],
        }

    return read


def pendulum_wheel(name: str, command: str = "u") -> Read:
    """Return the reader of another wheel on a pendulum, rad/s, 100 Hz, out of timeseries."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, PENDULUM_WHEEL) / f"{name}.mat"
        rows = MatTable(path).read(["t", "objects{20}", command])
        return {
            "time_s": rows["t"],
            "velocity": rows["objects{20}"],
            "command": 100.0 * rows[command],
        }

    return read


def bare_rod(name: str) -> Read:
    """Return the reader of a bare motor with a rod, 1 kHz, 15.7 mrad a count, V."""

    def read(recordings: Path) -> Columns:
        rows = np.loadtxt(folder_of(recordings, BARE_ROD) / "data" / f"{name}.txt")
        return {"time_s": rows[:, 0], "position": rows[:, 2], "command": SUPPLY_V * rows[:, 3]}

    return read


def thin_link(recordings: Path) -> Columns:
    """Read a servo that swings a thin link, degrees and V, 500 Hz, a file a signal."""
    folder = folder_of(recordings, THIN_LINK) / "Data"
    command = mat(folder / "data_vm.mat")["data_vm"]
    position = mat(folder / "data_theta.mat")["data_theta"][:, 2]
    return {"time_s": command[:, 0], "position": position, "command": command[:, 1]}
