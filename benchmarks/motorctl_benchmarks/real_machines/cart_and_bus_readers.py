"""How public recordings of a cart, motors on a bus, a balancing robot and a pump are read."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from motorctl_benchmarks.real_machines.readers import Columns, Read
from motorctl_benchmarks.real_machines.repositories import (
    BALANCING_ROBOT,
    BUS_MOTORS,
    CURRENT_CART,
    DIRECT_DRIVE,
    PUMP_ACTUATOR,
    TEST_INPUTS,
    folder_of,
)


def current_cart(name: str, position: int = 2, command: int = 1) -> Read:
    """Return the reader of a cart that a motor pulls by a belt, m and A, 150 Hz."""

    def read(recordings: Path) -> Columns:
        rows = np.loadtxt(folder_of(recordings, CURRENT_CART) / f"{name}.csv", delimiter=",")
        return {
            "time_s": rows[:, 0],
            "position": rows[:, position],
            "command": rows[:, command],
        }

    return read


def bus_motor(number: int) -> Read:
    """Return the reader of a bare geared motor, rad from -12.5 to 12.5 and N m, 48 Hz, uneven."""

    def read(recordings: Path) -> Columns:
        runs = folder_of(recordings, BUS_MOTORS) / "results" / "runs"
        group = runs / "20260425_162832_identify-all" / "group_01"
        rows = np.load(group / f"motor_{number:02d}" / "capture.npz")
        return {
            "time_s": rows["time"],
            "position": rows["position"],
            "command": rows["torque_feedback"],
        }

    return read


def driven_by_test(name: str) -> Read:
    """Return the reader of a bare motor that is sent a test signal, turns and V, 170 Hz, uneven."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, TEST_INPUTS) / "docs" / "motor_characterization_references"
        lines = (folder / "demo_data" / f"{name}.csv").read_text().splitlines()
        cells = [line.rstrip(";").split(",") for line in lines if line and not line.startswith("%")]
        rows = np.array([row for row in cells if len(row) == 4], dtype=np.float64)
        rows = rows[rows[:, 0] > 0.0]  # a row of nan is a message that was rejected
        return {"time_s": rows[:, 0] / 8000.0, "position": rows[:, 2], "command": rows[:, 1]}

    return read


def balancing_wheel(name: str, side: int) -> Read:
    """Return the reader of a wheel of a balancing robot, its speed and V, 67 Hz; 0 is the left."""

    def read(recordings: Path) -> Columns:
        text = (folder_of(recordings, BALANCING_ROBOT) / "logs" / f"{name}.txt").read_text()
        lines = [line.split() for line in text.splitlines() if line and line[0] != "%"]
        return {
            "time_s": np.array([float(line[0]) for line in lines]),
            "velocity": np.array([float(line[9 + side]) for line in lines]),
            "command": np.array([float(line[7 + side]) for line in lines]),
        }

    return read


def direct_drive(joint: int, speed: str) -> Read:
    """Return the reader of an upright arm's direct drive at one speed one way, 67 Hz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, DIRECT_DRIVE) / "Test 2"
        angle = np.loadtxt(folder / f"cin_pos{joint}_{speed}_exp_gan.t")
        torque = np.loadtxt(folder / f"cin_tau{joint}_{speed}_exp_gan.t")
        return {
            "time_s": angle[:, 0],
            "position": np.deg2rad(angle[:, 1]),
            "command": torque[: len(angle), 1],
        }

    return read


def pump_actuator(name: str, rod: bool) -> Read:
    """Return the reader of a motor that drives a pump, or of the rod that the oil moves, 1 kHz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, PUMP_ACTUATOR) / "2_EHA_desktop program_python_project"
        rows = np.genfromtxt(folder / "ARXIV" / f"{name}.csv", delimiter=";", skip_header=1)
        motion = 0.025e-3 * rows[:, 5] if rod else 2.0 * math.pi / 4096.0 * rows[:, 6]
        return {
            "time_s": rows[:, 0] / 1000.0,
            "position": motion,
            "command": rows[:, 12] / 100.0,
        }

    return read
