"""How public recordings of an excavator, arms, gears and geared drives are read."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from scipy.io import loadmat

from motorctl_benchmarks.real_machines.readers import Columns, Read
from motorctl_benchmarks.real_machines.repositories import (
    EXCAVATOR,
    GEARED_TOOL,
    JOINT_DRIVE,
    LEARNT_ARM,
    LIGHT_ARM,
    PRINTED_GEAR,
    folder_of,
)

DRIVE_HZ = 1022.89
"""Rows of the joint drive over its time, whose milliseconds repeat."""
GEAR_HZ = 427.0
"""Rows of the printed gear over its time, which a clock of 15.6 ms tells."""


DRIVE_RUNS = {
    "position lines": "PMS42_0.25-25_1.4xlim",
    "torque lines": "TMS42_0.50-25_45",
    "torque steps": "Nm70_0.2_1.5_0.09",
}
GEARS = {
    "baseline": "2024-07-11__14-44-21__torqueramp__base init1",
    "split": "2024-07-10__16-35-37__torqueramp__split runin6",
}


def joint_drive(run: str) -> Read:
    """Return the reader of a geared joint drive on a bench, counts and mA, a clock beside each."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, JOINT_DRIVE) / "Raw Data" / "Main"
        path = folder / f"{DRIVE_RUNS[run]}.csv"
        rows = np.genfromtxt(path, delimiter=",", skip_header=2)[:, 1::2]
        rows = rows[np.isfinite(rows).all(axis=1)]
        return {
            "time_s": np.arange(len(rows)) / DRIVE_HZ,
            "position": 2.0 * np.pi * rows[:, 6] / 4096.0,
            "command": rows[:, 9] / 1e3,
        }

    return read


def printed_gear(kind: str) -> Read:
    """Return the reader of a printed gear whose output is held, turns and A."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, PRINTED_GEAR) / "Code" / "test_data" / f"{GEARS[kind]}.csv"
        rows = np.genfromtxt(path, delimiter=",", skip_header=1)
        return {
            "time_s": np.arange(len(rows)) / GEAR_HZ,
            "position": rows[:, 1],
            "command": rows[:, 4],
        }

    return read


def light_arm(number: int) -> Read:
    """Return the reader of a joint of an arm with torque sensors behind its gears, 200 Hz."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, LIGHT_ARM) / "data" / "KUKA" / "HW" / "measurements_1.npz"
        rows = np.load(path)
        return {
            "time_s": rows["times"],
            "position": rows["positions"][:, number - 1],
            "command": rows["torques"][:, number - 1],
            "reference": rows["target_positions"][:, number - 1],
        }

    return read


def excavator(cylinder: str) -> Read:
    """Return the reader of a cylinder of a small excavator that digs by itself, duty cycle."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, EXCAVATOR) / "tests" / "data"
        rows = np.genfromtxt(folder / "autonomous_1024_1959.csv", delimiter=",", names=True)
        return {
            "time_s": rows["Time"],
            "position": rows[f"{cylinder}_Ms"],
            "command": rows[f"{cylinder}_Cmd"],
        }

    return read


def geared_tool(run: str, number: int) -> Read:
    """Return the reader of a geared motor's moves, counts and duty cycle, 163 Hz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, GEARED_TOOL) / "src_cpp" / "motor_control_test" / "results"
        text = (folder / "Motor_07_PID_MotionProfile" / f"results_{run}.m").read_text()
        block = re.findall(r"=\s*\[(.*?)\]", text, re.DOTALL)[number]
        rows = np.array([line.split() for line in block.split("\n") if line], dtype=np.float64)
        rows = rows[rows[:, 0] > 0.0]
        return {"time_s": rows[:, 0] / 1e6, "position": rows[:, 2], "command": 100.0 * rows[:, 3]}

    return read


def learnt_arm(run: str) -> Read:
    """Return the reader of an arm's joint, velocity and torque, 200 Hz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, LEARNT_ARM) / "Exp2" / "Training_data"
        rows = loadmat(folder / "robotarmdata.mat", squeeze_me=True)
        velocity = rows[f"y{run}"]
        return {
            "time_s": np.arange(len(velocity)) / 200.0,
            "velocity": velocity,
            "command": rows[f"u{run}"],
        }

    return read
