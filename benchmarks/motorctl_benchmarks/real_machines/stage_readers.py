"""How public recordings of stages, wheels, and balls and magnets that float are read."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from motorctl_benchmarks.real_machines.readers import (
    Columns,
    Read,
    mat,
)
from motorctl_benchmarks.real_machines.repositories import (
    PROPELLER,
    STAGES,
    WHEELS,
    folder_of,
)

STIFF = "Project1_360"
STIFF_LATER = "Project2/MTE360_Project2_Dataset"
TWO_MASSES = "Project3/Lab3 360 Data"


def stage(name: str, column: str) -> Read:
    """Return the reader of a lab's drive, stiff or with a spring, 1 kHz: voltage, mm or mm/s."""

    def read(recordings: Path) -> Columns:
        rows = mat(folder_of(recordings, STAGES) / f"{name}.mat")
        what = "velocity" if column.startswith("v") else "position"
        return {
            "time_s": np.arange(len(rows["u"])) / 1000.0,
            what: rows[column].astype(float),
            "command": rows["u"].astype(float),
        }

    return read


def wheel_of_mouse(name: str) -> Read:
    """Return the reader of the left wheel of a small robot: speed and duty cycle, uneven."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, WHEELS) / "matlab" / "data" / f"{name}.csv"
        rows = np.genfromtxt(path, delimiter=",", names=True)
        later = np.concatenate([[True], np.diff(rows["time"]) > 0.0])
        rows = rows[later]
        return {
            "time_s": (rows["time"] - rows["time"][0]) / 1e3,
            "velocity": rows["leftSpeed"] / 60.0,
            "command": 100.0 * rows["leftCommand"] / 255.0,
        }

    return read


def _shield(recordings: Path, name: str) -> dict[str, np.ndarray]:
    return mat(folder_of(recordings, PROPELLER) / "matlab" / "examples" / f"{name}.mat")


def geared_motor(recordings: Path) -> Columns:
    """Read a small geared motor, one way: voltage and speed, 50 Hz."""
    rows = _shield(recordings, "MotoShield/aprbsResult")
    return {"time_s": np.arange(len(rows["u"])) / 50.0, "velocity": rows["y"], "command": rows["u"]}


def levitated_magnet(recordings: Path) -> Columns:
    """Read a magnet that hangs below a coil, 308 Hz: distance in mm and current in mA."""
    rows = _shield(recordings, "MagnetoShield/MagnetoShield_ID_Data")["result"][100:]
    return {
        "time_s": np.arange(len(rows)) * 3.25e-3,
        "position": rows[:, 0],
        "command": rows[:, 2],
    }


def ball_in_tube(recordings: Path) -> Columns:
    """Read a ball in a tube on the air of a fan, 40 Hz: height in mm and the fan's power."""
    rows = _shield(recordings, "FloatShield/APRBS_R4_2")
    return {
        "time_s": np.arange(len(rows["u"])) / 40.0,
        "position": rows["y"].astype(float),
        "command": rows["u"].astype(float),
    }


def ball_on_beam(name: str, position: int, angle: int) -> Read:
    """Return the reader of a ball on a beam, 100 Hz: place in mm and the beam's angle."""

    def read(recordings: Path) -> Columns:
        rows = _shield(recordings, f"BoBShield/{name}")["dataAll"].astype(float)
        return {
            "time_s": np.arange(len(rows)) / 100.0,
            "position": rows[:, position],
            "command": rows[:, angle],
        }

    return read
