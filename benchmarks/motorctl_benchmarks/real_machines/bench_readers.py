"""How public recordings of test benches, linear guides, trolleys and carts are read."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from scipy.io import loadmat

from motorctl_benchmarks.real_machines.readers import (
    Columns,
    Read,
    mat,
)
from motorctl_benchmarks.real_machines.repositories import (
    BELT_CART,
    COUPLED_MOTORS,
    CRANE,
    GUIDES,
    SEVENTH_JOINT,
    SMALL_SERVO,
    folder_of,
)

GUIDE_ROWS = 20_000
"""Of a guide's recording, which repeats its motion every 5 s, 20 times: 20 s tell as much."""

BELT_CART_ROWS = 2_200
"""Of a cart's recording at most: the longest has 7000 rows of one kind of step."""


def coupled_motors(kind: str, side: str) -> Read:
    """Return the reader of two motors on a flexible coupling, 2.5 kHz: rad and the current."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, COUPLED_MOTORS) / "Examples" / "private"
        rows = mat(folder / f"MultisineType{kind}.mat")
        return {
            "time_s": rows["time"] * 1e-6,
            "position": rows["theta_mx"] if side == "motor" else -rows["theta_my"],
            "command": rows["iq_adx"],
        }

    return read


def _dspace(recordings: Path, place: str, name: str) -> list[np.ndarray]:
    """Return the time and the signals of a recording by dSPACE."""
    path = folder_of(recordings, GUIDES) / "Examples" / "Standalone" / place / f"{name}.mat"
    run = loadmat(path, squeeze_me=True, struct_as_record=False)[name]
    return [np.asarray(each.Data, dtype=np.float64) for each in (run.X, *run.Y)]


def guide(number: int, encoder: int) -> Read:
    """Return the reader of a motor on a linear guide (1) and a mass on a spring (2), mm, 1 kHz."""

    def read(recordings: Path) -> Columns:
        signals = _dspace(recordings, "LAB_LSB250", f"exp{number}")
        time_s, first, second, volts = (signal[:GUIDE_ROWS] for signal in signals)
        return {"time_s": time_s, "position": (first, second)[encoder - 1], "command": volts}

    return read


def crane_cart(recordings: Path) -> Columns:
    """Read the cart of a crane, 50 Hz: its place in m, and the speed that it is sent with."""
    time_s, _, counts, _, sent, _ = _dspace(recordings, "Crane_LTI/measurements", "meas1")
    return {"time_s": time_s, "position": counts * 0.035 * np.pi / 9000.0, "command": -sent}


def trolley(name: str) -> Read:
    """Return the reader of a crane's trolley: place and voltage, each with times of its own."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, CRANE) / "PlotJuggler" / f"{name}.csv"
        with path.open(newline="") as file:
            rows = list(csv.DictReader(file))

        def column(of: str) -> np.ndarray:
            return np.array([float(row[of]) if row[of] else np.nan for row in rows])

        return {
            "time_s": column("__time") - float(rows[0]["__time"]),
            "position": column("/trolley_position/data"),
            "command": column("/trolley_motor_voltage/data"),
        }

    return read


def belt_cart(name: str) -> Read:
    """Return the reader of a cart on a belt that carries a pole: m and duty cycle."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, BELT_CART) / "Driver" / "ExperimentRecordings"
        with (folder / f"{name}.csv").open(newline="") as file:
            rows = list(
                csv.DictReader(line for line in file if line.strip("\r\n# ") and line[0] != "#")
            )

        def column(of: str) -> np.ndarray:
            return np.array([float(row[of]) for row in rows[:BELT_CART_ROWS]])

        return {
            "time_s": column("time"),
            "position": column("position"),
            "command": 100.0 * column("Q"),
        }

    return read


def small_servo(name: str) -> Read:
    """Return the reader of a servo motor that its torque moves, 1 kHz: rad and N m."""

    def read(recordings: Path) -> Columns:
        rows = np.genfromtxt(folder_of(recordings, SMALL_SERVO) / "data" / f"LuGre_{name}.txt")
        return {
            "time_s": np.arange(len(rows)) / 1000.0,
            "position": rows[:, 0],
            "command": rows[:, 4],
        }

    return read


def seventh_joint(speed: str) -> Read:
    """Return the reader of an arm's last joint at one speed, 999 Hz: rad and the current."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, SEVENTH_JOINT) / "data" / f"velocity_{speed}readings.csv"
        rows = np.loadtxt(path)
        return {
            "time_s": np.arange(len(rows)) / 999.0,
            "position": rows[:, 1],
            "command": rows[:, 5],
        }

    return read
