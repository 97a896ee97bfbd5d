"""How the files of further public machines of laboratories and workshops are read."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np

from motorctl.log.open_table import open_table
from motorctl_benchmarks.real_machines.readers import (
    Columns,
    Read,
)
from motorctl_benchmarks.real_machines.repositories import (
    CYLINDER,
    DISCS,
    DRIVETRAIN,
    EGG_LIFT,
    FLYWHEEL,
    MILL,
    POSITION_SERVO,
    RACK,
    ROD_MOTOR,
    TENDON_DRIVES,
    TWISTED_STRINGS,
    folder_of,
)

RUNS = ("slow-forward", "slow-backward", "fast-forward", "fast-backward")


def discs(recordings: Path) -> Columns:
    """Read a motor with discs on a torsion rod under a swept sine, 45 Hz."""
    text = (folder_of(recordings, DISCS) / "lab2" / "raw_data_freq.txt").read_text()
    lines = [line.split() for line in text.translate(str.maketrans("[];", "   ")).splitlines()[1:]]
    rows = np.array([[float(word) for word in line] for line in lines if len(line) == 6])
    return {
        "time_s": rows[:, 1],
        "position": 2.0 * np.pi * rows[:, 3] / 16_000.0,
        "command": rows[:, 5],
    }


def egg_lift(recordings: Path) -> Columns:
    """Read a small motor on a cord: a duty cycle without a sign, and counts taken for degrees."""
    path = folder_of(recordings, EGG_LIFT) / "Eggdrop" / "Matlab" / "serial_data.csv"
    rows = np.genfromtxt(path, delimiter=",", skip_header=1)
    rows = rows[np.isfinite(rows).all(axis=1)]
    return {
        "time_s": (rows[:, 0] - rows[0, 0]) / 1e3,
        "position": rows[:, 3],
        "command": rows[:, 2],
    }


def twisted_strings(motor: int) -> Read:
    """Return the reader of one of two motors that pull a slide by twisted strings, 500 Hz."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, TWISTED_STRINGS) / "data" / "chirp5.csv"
        rows = np.loadtxt(path, delimiter=",")[:, 5:]
        return {
            "time_s": (rows[0] - rows[0, 0]) / 1e6,
            "position": rows[2 + motor] / 1e3,
            "command": rows[4 + motor] / 1e3,
        }

    return read


def tendon_drive(number: int) -> Read:
    """Return the reader of a geared drive that starts and stops with a weight, 25 Hz, in turns."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, TENDON_DRIVES) / "experiments" / f"driveNo{number}"
        lines = (folder / "start_stop" / "200.csv").read_text().splitlines()[14:]
        rows = np.array([[float(word) for word in line.split(";")] for line in lines if line])
        return {
            "time_s": rows[:, 0] / 1e3,
            "velocity": rows[:, 1] / 60.0,
            "command": rows[:, 2],
        }

    return read


def rack(recordings: Path) -> Columns:
    """Read two thirds of a second of a servo motor with a rack, 1.5 kHz, in turns."""
    path = folder_of(recordings, RACK) / "input" / "a3MR.csv"
    rows = np.genfromtxt(path, delimiter=",", skip_header=6)
    return {"time_s": rows[:, 0] / 1e3, "velocity": rows[:, 1] / 60.0, "command": rows[:, 2]}


def four_runs(repository: str, position: int) -> Read:
    """Return the reader of a robot's drive: two slow ramps and two steps of the voltage."""

    def read(recordings: Path) -> Columns:
        told = json.loads((folder_of(recordings, repository) / "sysid_data.json").read_text())
        rows = np.vstack([np.array(told[run]) for run in RUNS])
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
        return {
            "time_s": rows[:, 0] - rows[0, 0],
            "position": rows[:, position],
            "command": rows[:, 1],
        }

    return read


DRIVETRAIN_RUNS = four_runs(DRIVETRAIN, 3)
FLYWHEEL_RUNS = four_runs(FLYWHEEL, 2)


def position_servo(recordings: Path) -> Columns:
    """Read a hobby servo of which only the angle it is sent to was recorded, 50 Hz."""
    folder = folder_of(recordings, POSITION_SERVO) / "src" / "sysid" / "dataset"
    runs = json.loads((folder / "dataset.json").read_text())["data"]
    sent, angle = (
        np.concatenate([np.array(run[key], float).ravel() for run in runs])
        for key in ("actions", "sensor_data")
    )
    read = np.isfinite(angle) & np.isfinite(sent)
    time_s = np.arange(len(sent)) / 50.0
    return {"time_s": time_s[read], "position": angle[read], "command": sent[read]}


def rod_motor(recordings: Path) -> Columns:
    """Read a small motor that carries a rod by its middle, swept from 0.1 to 10 Hz, of 10 kHz."""
    folder = folder_of(recordings, ROD_MOTOR) / "data" / "system_id_data"
    columns = open_table(folder / "id_result_chirp_rod_05_01_10_1.mat").read(
        ["output.pos_iddata.OutputData{1}", "output.pos_iddata.InputData{1}"]
    )
    position, duty = (column[::10] for column in columns.values())
    return {
        "time_s": np.arange(len(position)) / 1e3,
        "position": position,
        "command": 100.0 * duty,
    }


def pulled_cylinder(seal: str) -> Read:
    """Return the reader of a printed pneumatic cylinder that a machine pulls and pushes, 100 Hz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, CYLINDER) / "results_pneumatic-actuator" / "data"
        rows = np.loadtxt(folder / "friction" / f"{seal}.csv")
        return {"time_s": rows[:, 0] / 1e3, "position": rows[:, 4], "command": rows[:, 6]}

    return read


def milling_axis(letter: str, what: str = "Velocity") -> Read:
    """Return the reader of an axis of a milling machine that cuts wax, 10 Hz, by its velocity.

    Its position is rounded, to whole millimetres from 100 on, and jumps where rows are missing.
    """

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, MILL) / "data" / "experiment_11.csv"
        with path.open(newline="") as file:
            rows = list(csv.DictReader(file))
        return {
            "time_s": np.arange(len(rows)) / 10.0,
            what.lower(): np.array([float(row[f"{letter}1_Actual{what}"]) for row in rows]),
            "command": np.array([float(row[f"{letter}1_CurrentFeedback"]) for row in rows]),
        }

    return read
