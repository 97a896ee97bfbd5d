"""How public recordings of legs, arms that are carried, loaders and balancing cars are read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.io import loadmat

from motorctl.log.table_mat import MatTable
from motorctl_benchmarks.real_machines.readers import Columns, Read
from motorctl_benchmarks.real_machines.repositories import (
    ANKLES,
    BALANCING_CAR,
    CARRIED_ARM,
    COMPASS,
    EXOSKELETON,
    LIGHT_ELBOW,
    LOADER,
    folder_of,
)


def compass_leg(leg: str) -> Read:
    """Return the reader of a leg that swings as a pendulum: degrees and volts, 200 Hz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, COMPASS) / "System Identification" / "SysID_Experiment 1"
        name = f"realVSmodel_fwAnd5vstepsx3AndChirp_{leg}SW.mat"
        names = {"time_s": "datatimeall", "position": "dataoutall", "command": "datainall"}
        rows = MatTable(folder / name).read(names.values())
        return {signal: rows[column] for signal, column in names.items()}

    return read


def walking_hip(recordings: Path) -> Columns:
    """Read the hip between two legs that walk: degrees and volts, 200 Hz."""
    folder = folder_of(recordings, COMPASS) / "System Identification" / "SysID_Experiment 2"
    rows = loadmat(folder / "SysID_data_12exp_120steps.mat", squeeze_me=True)
    return {
        "time_s": rows["datatime"],
        "position": rows["hipangle"],
        "command": rows["umaxonsatu"],
    }


def carried_arm(recordings: Path) -> Columns:
    """Read an arm that is moved by hand while its motor carries the weight: degrees and N m."""
    path = folder_of(recordings, CARRIED_ARM) / "motor_data_combined_comp.csv"
    rows = np.genfromtxt(path, delimiter=",", skip_header=1)[:, [0, 1, 7]]
    return {"time_s": rows[:, 0] - rows[0, 0], "position": rows[:, 1], "command": rows[:, 2]}


def exoskeleton_motor(number: int) -> Read:
    """Return the reader of a motor of an exoskeleton in the air: rad and A, 67 Hz."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, EXOSKELETON) / "Data" / "Exoskeleton" / "motorRawdata.mat"
        counts, current = (f"objects{{{(19, 37, 55, 73)[number - 1]}}}(:,{k})" for k in (2, 4))
        rows = MatTable(path).read([counts, current])
        return {
            "time_s": np.arange(len(rows[counts])) / (1.0 / 0.015),
            "position": rows[counts] * 2.0 * np.pi / 4096.0,
            "command": rows[current] / 1000.0,
        }

    return read


def light_elbow(log: int) -> Read:
    """Return the reader of an elbow that holds its forearm, and now and then moves: rad and N m."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, LIGHT_ELBOW) / "data" / "example_arm_logs" / f"armlog{log}.mat"
        names = {"time_s": 1, "position": 14, "command": 34}
        columns = {signal: f"objects{{2}}{{{k}}}" for signal, k in names.items()}
        rows = MatTable(path).read(columns.values())
        return {signal: rows[column] for signal, column in columns.items()}

    return read


def ankle(number: int) -> Read:
    """Return the reader of an ankle of a robot that walks: rad and N m, taken as 400 Hz."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, ANKLES) / "train_motor_csv"
        rows = np.genfromtxt(path / "robot_data_04_11_13_24_Ankle.csv", delimiter=",", names=True)
        return {
            "time_s": np.arange(len(rows)) / 400.0,
            "position": rows[f"joint_pos_{number}"],
            "command": rows[f"tau_est_{number}"],
        }

    return read


def loader(position: str, force: str) -> Read:
    """Return the reader of a wheel loader's boom or bucket at work: degrees and kN, 50 Hz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, LOADER)
        angle = np.loadtxt(folder / f"{position}_angle_deg.txt")
        return {
            "time_s": np.arange(len(angle)) / 50.0,
            "position": angle,
            "command": 1000.0 * np.loadtxt(folder / f"force_{force}_MN.txt"),
        }

    return read


def balancing_car(recordings: Path) -> Columns:
    """Read the body of a car on two wheels: its angle and how its wheels are accelerated."""
    rows = np.loadtxt(folder_of(recordings, BALANCING_CAR) / "data" / "10_23_1.dat")
    return {"time_s": rows[:, 0], "position": rows[:, 1], "command": rows[:, 4]}
