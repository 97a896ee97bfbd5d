"""How the files of each public recording are read: one function a machine.

The recordings belong to their authors: `tools/fetch_recordings.py` fetches them.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat

Columns = dict[str, NDArray[np.float64]]
Read = Callable[[Path], Columns]
"""Gives time_s, position or velocity, command and, where there is one, reference, from the folder
of all recordings."""

UR10E = "shamilmamedov/dynamic_calibration"
BLDC = "heitor-andrade/laas_anti_cogging"
OPENARM = "YIZHIXIAOCANGSHU/Friction-Identification-for-Manipulators"
CAMBER = "nicolazande/camber-control"
PANDA = "marcocognetti/FrankaEmikaPandaDynModel"
CART = "lucafalcone/Inverted_pendulum_sys_ID_and_control"
PENDULUM = "dfki-ric-underactuated-lab/torque_limited_simple_pendulum"
DOUBLE = "dfki-ric-underactuated-lab/double_pendulum"
KUKA = "JonasWeigand/Robot_Identification"
DAMPER = "ARTS-Laboratory/Dataset-Friction-Damper-with-Backlash"
PROPELLER = "gergelytakacs/AutomationShield"
BEAM = "ryanGT/systemid"
TWO_MOTORS = "malik-robert/HSM150-data"
GO1 = "rimim/bam"
INSTRUMENT = "liamjosephnolan/thesis_matlab"
WHEEL = "vhsabino/MATLAB"
REPOSITORIES = (
    UR10E,
    BLDC,
    OPENARM,
    CAMBER,
    PANDA,
    CART,
    PENDULUM,
    DOUBLE,
    KUKA,
    DAMPER,
    PROPELLER,
    BEAM,
    TWO_MOTORS,
    GO1,
    INSTRUMENT,
    WHEEL,
)
"""On GitHub."""


def folder_of(recordings: Path, repository: str) -> Path:
    """Return where a repository's files are."""
    return recordings / repository.replace("/", "+")


def joint(number: int) -> Read:
    """Return the reader of a joint of an arm that moves joint by joint."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, UR10E) / "dataset_ur10e" / "jointwise_motion"
        (path,) = folder.glob(f"*joint_{number}.csv")
        rows = np.loadtxt(path, delimiter=",")
        return {
            "time_s": rows[:, 0] - rows[0, 0],
            "position": rows[:, number],
            "command": rows[:, 12 + number],
        }

    return read


def brushless(recordings: Path) -> Columns:
    """Read a brushless motor at constant speeds."""
    path = folder_of(recordings, BLDC) / "codes" / "Testing" / "speed_data" / "speed_test1.txt"
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    rows = rows[rows[:, 5] == 0.0]  # its own compensation is off
    return {"time_s": rows[:, 0], "position": rows[:, 1], "command": rows[:, 4]}


def arm(number: int) -> Read:
    """Return the reader of a joint of an arm of hobby motors."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, OPENARM) / "results"
        rows = np.load(folder / f"real_uart_capture_collect_joint_{number}.npz")
        return {
            "time_s": rows["time"] - rows["time"][0],
            "position": rows["q"][:, number - 1],
            "command": rows["tau_command"][:, number - 1],
            "reference": rows["q_cmd"][:, number - 1],
        }

    return read


def actuator(name: str) -> Read:
    """An actuator of a car's suspension: screws (mm) or a gear (deg), under its own controller."""

    def read(recordings: Path) -> Columns:
        rows = np.loadtxt(folder_of(recordings, CAMBER) / "actuators" / name)
        return {"time_s": rows[:, 0] / 1e3, "position": rows[:, 3], "command": rows[:, 5]}

    return read


def panda(number: int) -> Read:
    """One joint of an arm whose joints all move at once."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, PANDA) / "matlab" / "data" / "Exciting_Traj"
        folder = folder / "Trajectory_1" / "rbt_log"
        columns = {}
        for column, name in (("time_s", "time"), ("position", "positions"), ("command", "torques")):
            values = np.loadtxt(folder / f"exciting_traj_{name}.txt")
            columns[column] = values if column == "time_s" else values.reshape(-1, 7)[:, number - 1]
        return columns

    return read


def cart(name: str) -> Read:
    """A cart on a belt, a pendulum hanging from it, moved by a duty cycle."""

    def read(recordings: Path) -> Columns:
        rows = mat(folder_of(recordings, CART) / "sysID" / "real_data" / name)
        return {
            "time_s": rows["t"],
            "position": rows["x"],
            "command": 100.0 * rows["outu"].astype(float),
        }

    return read


def pendulum(name: str) -> Read:
    """A weight on a rod on a motor, angle and torque as the motor tells them."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, PENDULUM) / "results" / name
        rows = np.loadtxt(path, delimiter=",", skiprows=1)
        time, angle, torque = (1, 2, 4) if rows.shape[1] == 5 else (0, 1, 3)  # some are counted
        return {"time_s": rows[:, time], "position": rows[:, angle], "command": rows[:, torque]}

    return read


def double(name: str, number: int) -> Read:
    """One joint of two that carry each other."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, DOUBLE) / "data" / "experiment_records" / name
        rows = np.loadtxt(path, delimiter=",", skiprows=1)
        return {
            "time_s": rows[:, 0],
            "position": rows[:, number],
            "command": rows[:, 12 + number],
        }

    return read


def kuka(number: int) -> Read:
    """One axis of an arm for 300 kg whose axes all move at once, by the motor's encoder."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, KUKA) / "data" / "recorded_trajectories"
        rows = mat(folder / "2020-10-21 10s FF A 08ms" / "data.mat")["rec"]
        return {
            "time_s": rows["time_cont"].item(),
            "position": rows["act_pos_mot_deg"].item()[number - 1],
            "command": rows["act_torque_abs_nm"].item()[number - 1],
            "reference": rows["ref_pos_deg"].item()[number - 1],
        }

    return read


def damper(name: str) -> Read:
    """A band brake between two plates, pulled to and fro: inches and thousands of pounds."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, DAMPER) / "data" / "dataset-2" / "characterization datasets"
        rows = np.array(json.loads((folder / name).read_text())["data"])
        return {
            "time_s": rows[:, 0],
            "position": 25.4 * rows[:, 1],
            "command": 4448.22 * rows[:, 2],
        }

    return read


def propeller(recordings: Path) -> Columns:
    """A pendulum lifted by a propeller, 100 Hz, and the voltage of its motor."""
    folder = folder_of(recordings, PROPELLER) / "matlab" / "examples" / "AeroShield"
    rows = mat(folder / "Identification_Data2.mat")
    return {
        "time_s": np.arange(len(rows["u"])) / 100.0,
        "position": rows["yrad"],
        "command": rows["u"],
    }


def beam(recordings: Path) -> Columns:
    """A motor with an elastic ruler on its shaft; counts of an encoder, and of the amplifier."""
    path = folder_of(recordings, BEAM) / "example" / "2009-04-21" / "swept1-0-10hz.txt"
    rows = np.loadtxt(path)
    return {"time_s": rows[:, 0], "position": rows[:, 4], "command": rows[:, 3]}


def two_motors(recordings: Path) -> Columns:
    """A motor against a motor: one step of the torque, and it turns one way."""
    path = folder_of(recordings, TWO_MOTORS) / "Data" / "Identification" / "idf_pos_0.06_1.mat"
    rows = mat(path)["data"]
    return {"time_s": rows[:, 0], "position": rows[:, 2], "command": rows[:, 4]}


def walking_joint(name: str) -> Read:
    """Return the reader of a joint of a walking robot that swings a weight."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, GO1) / "example_data" / "data_raw_go1" / name
        entries = json.loads(path.read_text())["entries"]
        keys = {
            "time_s": "timestamp",
            "position": "position",
            "command": "torque_demand",
            "reference": "goal_position",
        }
        columns = {to: np.array([e[key] for e in entries], float) for to, key in keys.items()}
        columns["time_s"] -= columns["time_s"][0]
        return columns

    return read


def instrument(name: str, joint: str) -> Read:
    """Return the reader of a joint of a surgical instrument under a binary test signal."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, INSTRUMENT) / name
        rows = np.genfromtxt(path, delimiter=",", names=True, deletechars="")
        told = "/psm_joint_telemetry/"
        columns = {
            "time_s": rows[f"{told}header/stamp"],
            "position": rows[f"{told}{joint}/position"],
            "command": rows[f"{told}{joint}/velocity"],
        }
        known = np.isfinite(np.column_stack(list(columns.values()))).all(axis=1)
        return {name: values[known] for name, values in columns.items()}

    return read


def wheel(recordings: Path) -> Columns:
    """Read a wheel of a robot in the air, one way: duty cycle and speed, as long as they were."""
    path = folder_of(recordings, WHEEL) / "sysid" / "DATA_27_09_19.csv"
    rows = np.genfromtxt(path, delimiter=",", max_rows=48_500)
    rows = rows[np.isfinite(rows).all(axis=1)]
    return {
        "time_s": np.arange(len(rows)) / 500.0,
        "velocity": rows[:, 1],
        "command": rows[:, 0],
    }


def mat(path: Path) -> dict[str, Any]:
    """Return the variables of a MATLAB file."""
    return dict(loadmat(path, squeeze_me=True))
