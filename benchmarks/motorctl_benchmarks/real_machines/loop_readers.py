"""How public recordings of pendulums, hydraulics, propellers and wheels in loops are read."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from scipy.io import loadmat

from motorctl_benchmarks.real_machines.readers import Columns, Read
from motorctl_benchmarks.real_machines.repositories import (
    AERO,
    CYLINDER_LOAD,
    ROMI,
    ROTARY_PENDULUM,
    folder_of,
)


def rotary_pendulum(name: str) -> Read:
    """Return the reader of an arm that balances a pendulum, V, 500 Hz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, ROTARY_PENDULUM) / "dataset" / "controller_20230828"
        rows = np.loadtxt(folder / f"qube_{name}.csv", delimiter=",", skiprows=1)
        return {"time_s": rows[:, 0], "position": rows[:, 3], "command": rows[:, 7]}

    return read


def hanging_load(recordings: Path) -> Columns:
    """Read a load that a hydraulic cylinder carries, its place and its valve's voltage, 50 Hz."""
    path = folder_of(recordings, CYLINDER_LOAD) / "data" / "HangingLoad.csv"
    rows = np.loadtxt(path, delimiter=",")
    return {"time_s": rows[:, 0], "position": rows[:, 2], "command": rows[:, 3]}


def stairs_motor(recordings: Path) -> Columns:
    """Read a motor at stairs of the voltage, and its tachometer's voltage, 50 Hz."""
    path = folder_of(recordings, CYLINDER_LOAD) / "data" / "MotorRotation.csv"
    rows = np.loadtxt(path, delimiter=",")
    return {"time_s": rows[:, 0], "velocity": rows[:, 2], "command": rows[:, 1]}


def aero(experiment: str, axis: int) -> Read:
    """Return the reader of a beam that two propellers turn, pitch (0) and yaw (1), V, 500 Hz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, AERO) / "Chapter 4 - Control of Dual-Rotor Plant"
        folder = folder / "Experimental Results" / "data" / experiment
        motion = loadmat(folder / "measurements.mat")["ans"]
        command = loadmat(folder / "real_control.mat")["ans"]
        return {"time_s": motion[0], "position": motion[1 + axis], "command": command[1 + axis]}

    return read


def romi(run: str, test: str) -> Read:
    """Return the reader of a small robot's wheels, turns and V, 200 Hz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, ROMI) / "data" / "dadbot-3000"
        document = json.loads((folder / f"sysid_data{run}.json").read_text())
        rows = np.array(document[test])
        return {"time_s": rows[:, 0] - rows[0, 0], "position": rows[:, 3], "command": rows[:, 1]}

    return read
