"""How the files of further public arms are read: one function an arm."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from motorctl_benchmarks.real_machines.readers import (
    Columns,
    Read,
)
from motorctl_benchmarks.real_machines.repositories import (
    AR5,
    JOINT_FRICTION,
    LIGHT_ARMS,
    SCHUNK,
    SURGICAL,
    UR10,
    XMATE,
    folder_of,
)

MOVES = 0.3
"""Part of the top speed above which a position and its velocity tell the time between samples.
Larger leaves few rows, smaller divides noise. Chosen by hand."""


def _timed(rows: Columns) -> Columns:
    """Return columns with the time that position and velocity tell: their files have none."""
    position, velocity = rows["position"], rows.pop("velocity")
    moving = np.abs(velocity[1:-1]) > MOVES * np.abs(velocity).max()
    ways = (position[2:] - position[:-2])[moving] / velocity[1:-1][moving]
    time_s = np.arange(len(position), dtype=np.float64) * (float(np.median(ways)) / 2.0)
    return {"time_s": time_s, **rows}


def _of_all(path: Path, joints: int, number: int) -> Columns:
    """Return a joint of a file of positions, velocities and torques of all."""
    rows = np.loadtxt(path, delimiter=",")
    names = ("position", "velocity", "command")
    return _timed({name: rows[:, k * joints + number - 1] for k, name in enumerate(names)})


def surgical(arm: str, number: int) -> Read:
    """Return the reader of a joint of a surgeon's arm ("mtm") or instrument ("psm"), 200 Hz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, SURGICAL) / "data" / arm / "measured_trajectory"
        return _of_all(folder / "one_results.csv", 7, number)

    return read


def surgical_yaw(recordings: Path) -> Columns:
    """Read a joint of the surgeon's arm that moves alone."""
    path = folder_of(recordings, SURGICAL) / "data" / "mtm" / "joint_test" / "one_results.csv"
    return _of_all(path, 1, 1)


def ur10(number: int) -> Read:
    """Return the reader of a joint of an arm whose joints all move, 50 Hz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, UR10) / "data" / "recdata"
        return _of_all(folder / "ur10_traj1_results.csv", 6, number)

    return read


def xmate(number: int) -> Read:
    """Return the reader of a joint whose torques are its accelerations, 50 Hz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, XMATE) / "data" / "recdata"
        return _of_all(folder / "xMate7p_traj1_results.csv", 7, number)

    return read


def ur5(number: int) -> Read:
    """Return the reader of a joint of an arm whose joints all move, 100 Hz, uneven."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, LIGHT_ARMS) / "data" / "ur5" / "identification_data"
        rows = np.loadtxt(folder / "ur-20_02_05-20sec_8harm.csv", delimiter=",")
        return {
            "time_s": rows[:, 0] - rows[0, 0],
            "position": rows[:, number],
            "command": rows[:, 12 + number],
        }

    return read


def kinova(number: int) -> Read:
    """Return the reader of a joint that makes one slow move alone: the motor's current."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, LIGHT_ARMS) / "data" / "kinova" / "jointwise_motion"
        path = folder / f"joint_{number}_trapez.csv"
        rows = np.genfromtxt(path, delimiter=",", names=True)
        return {
            "time_s": (rows["Time"] - rows["Time"][0]) / 1e3,
            "position": rows[f"Position{number}"],
            "command": rows[f"Cur{number}"],
        }

    return read


def ar5(number: int) -> Read:
    """Return the reader of a joint of an arm whose joints all move, 50 Hz, slowly."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, AR5) / "src/config/dynamics_identification_data_real.csv"
        rows = np.genfromtxt(path, delimiter=",", names=True)
        return {
            "time_s": rows["time"],
            "position": rows[f"q{number - 1}"],
            "command": rows[f"tau{number - 1}"],
        }

    return read


def joint_friction(name: str) -> Read:
    """Return the reader of a joint's torque less that of a rigid model: what friction leaves."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, JOINT_FRICTION) / "Comparative data" / name
        rows = np.genfromtxt(path, delimiter=",", skip_header=1)[:, :5]
        rows = rows[np.isfinite(rows).all(axis=1)]
        return {"time_s": rows[:, 0], "position": rows[:, 1], "command": rows[:, 4]}

    return read


def schunk(move: int, number: int) -> Read:
    """Return the reader of a joint of a light arm that makes one move of all joints, 250 Hz."""

    def read(recordings: Path) -> Columns:
        data = folder_of(recordings, SCHUNK) / "autoKoopman_codeocean" / "data"
        folder = data / "Robot" / f"measurement_{move}"
        names = ("time", "trajectory", "input")
        time_s, motion, torque = (
            np.loadtxt(folder / f"{name}.csv", delimiter=",") for name in names
        )
        rows = len(torque)  # one less than there are of the motion
        return {
            "time_s": time_s[:rows],
            "position": motion[:rows, number - 1],
            "command": torque[:, number - 1],
        }

    return read
