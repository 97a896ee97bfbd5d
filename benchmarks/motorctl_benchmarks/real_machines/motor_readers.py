"""How public recordings of two-armed robots, dynamometers and motors on test benches are read."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from motorctl.log.table_mat import MatTable
from motorctl_benchmarks.real_machines.readers import Columns, Read
from motorctl_benchmarks.real_machines.repositories import (
    COURSE_GROUP,
    DYNAMOMETER,
    LEARNT_ACTUATOR,
    LIFTED_ARM,
    MACHINE_AXIS,
    TWO_ARMS,
    folder_of,
)

ALL_JOINTS = "coupled_ident/dualArmV2_data_write_excitation_13.5.txt"
COLUMNS_OF_TWO_ARMS = 43
"""Time, and positions, speeds, currents, their references and torques of seven joints. Format."""


def two_arms(joint: int, name: str = ALL_JOINTS) -> Read:
    """Return the reader of a joint of a robot with two arms: degrees and A, 99 Hz."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, TWO_ARMS) / "code" / "para_est" / name
        lines = path.read_text().splitlines()
        rows = np.array([[float(x) for x in line.split()[:COLUMNS_OF_TWO_ARMS]] for line in lines])
        return {"time_s": rows[:, 0], "position": rows[:, joint], "command": rows[:, 14 + joint]}

    return read


def one_joint(joint: int) -> Read:
    """Return the reader of the same joint where it moves alone, at eight speeds."""
    return two_arms(joint, f"grav_fric_paras/arm_0_joint_{joint}_results.txt")


def course_group(name: str) -> Read:
    """Return the reader of a course's geared motor: rad/s and V, 2 kHz."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, COURSE_GROUP) / "PART2_study" / name
        names = {"time_s": "Time", "velocity": "Velo", "command": "Input"}
        columns = {signal: f"RawData.{column}" for signal, column in names.items()}
        rows = MatTable(path).read(columns.values())
        return {signal: rows[column] for signal, column in columns.items()}

    return read


def machine_axis(recordings: Path) -> Columns:
    """Read a machine tool's axis: a speed that is held for 14 ms, and duty cycle, 1.4 kHz."""
    path = folder_of(recordings, MACHINE_AXIS) / "dataset.mat"
    names = {"time_s": "X", "velocity": "Y(2)", "command": "Y(3)"}
    columns = {signal: f"cigan.{column}.Data" for signal, column in names.items()}
    rows = MatTable(path).read(columns.values())
    return {signal: rows[column] for signal, column in columns.items()}


def learnt_actuator(column: str) -> Read:
    """Return the reader of a joint's drive: rad, and A or where it is sent to, 50 Hz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, LEARNT_ACTUATOR) / "app" / "resources"
        rows = np.genfromtxt(folder / "2026-01-29_20-48-49.csv", delimiter=",", names=True)
        return {
            "time_s": rows["time"] - rows["time"][0],
            "position": rows["motorStatePos_0"],
            "command": rows[column],
        }

    return read


def shaft(name: str, command: str) -> Read:
    """Return the reader of a motor on a shaft with another: rad and N m, about 240 Hz."""
    wanted = ("time [s]", "a1 position [rad]", command)
    return _dynamometer("futek_data", name, wanted, "position")


def brake(name: str, velocity: str, command: str) -> Read:
    """Return the reader of a motor at a steady speed on a brake: turns/s and N m, 11 Hz."""
    return _dynamometer("brake-dynamometer/data", name, ("time [s]", velocity, command), "velocity")


def _dynamometer(folder: str, name: str, wanted: tuple[str, str, str], signal: str) -> Read:
    def read(recordings: Path) -> Columns:
        text = (folder_of(recordings, DYNAMOMETER) / folder / name).read_text()
        lines = [line for line in text.splitlines() if line and not line.startswith("#")]
        names, *data = (line.split(",") for line in lines)
        rows = np.array([[float(x) for x in line] for line in data if len(line) == len(names)])
        time_s, motion, command = (rows[:, names.index(column)] for column in wanted)
        return {"time_s": time_s, signal: motion, "command": command}

    return read


def lifted_arm(recordings: Path) -> Columns:
    """Read an arm that propellers lift: rad and V, 100 Hz."""
    path = folder_of(recordings, LIFTED_ARM) / "data" / "Data_Identification_26-Mar-2023_14h11m.mat"
    names = {"time_s": "tout", "position": "angle", "command": "inputU"}
    columns = {signal: f"objects{{2}}.{column}" for signal, column in names.items()}
    rows = MatTable(path).read(columns.values())
    return {signal: rows[column] for signal, column in columns.items()}
