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

from motorctl_benchmarks.real_machines.repositories import (
    BARE_MOTOR,
    BEAM,
    BLDC,
    CALIBRATED_ARMS,
    CAMBER,
    CART,
    DAMPER,
    DOUBLE,
    FLEXIBLE_LINKS,
    GO1,
    HOBBY_SERVO,
    INSTRUMENT,
    KUKA,
    LINKS,
    OPENARM,
    PANDA,
    PENDULUM,
    PROPELLER,
    TWO_MOTORS,
    UR10E,
    WAM,
    WHEEL,
    folder_of,
)

Columns = dict[str, NDArray[np.float64]]
Read = Callable[[Path], Columns]
"""Returns time_s, position or velocity, command and, where there is one, reference, from the folder
of all recordings."""


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


def bare_motor(name: str) -> Read:
    """Return the reader of a hobby motor without a load, under a velocity or position loop."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, BARE_MOTOR) / "analysis" / "cogging_torque"
        time_s, counts, current = np.load(folder / f"{name}.npy")[:3]
        return {"time_s": time_s, "position": 2.0 * np.pi * counts / 8192.0, "command": current}

    return read


def wam(number: int) -> Read:
    """Return the reader of a joint of a cable-driven arm of which joints 2 and 4 move."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, WAM) / "pest_2dof_nogravity" / "wam_data"
        rows = json.loads((folder / "state_4.json").read_text())
        time = np.array([row["time"] for row in rows])
        return {
            "time_s": time - time[0],
            "position": np.array([row["position"][number - 1] for row in rows]),
            "command": np.array([row["effort"][number - 1] for row in rows]),
        }

    return read


def tx40(number: int) -> Read:
    """Return the reader of an axis of an industrial arm whose axes all move, 5 kHz, in degrees."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, CALIBRATED_ARMS) / "examples" / "staubli_TX40" / "data"
        angle, current = (
            np.genfromtxt(folder / name, delimiter=",", skip_header=1)[:, number - 1]
            for name in ("pos_read_data.csv", "curr_data.csv")
        )
        return {"time_s": 2e-4 * np.arange(len(angle)), "position": angle, "command": current}

    return read


def tiago(name: str) -> Read:
    """Return the reader of a joint of a service robot whose joints all move, 100 Hz, uneven."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, CALIBRATED_ARMS) / "examples/tiago/data/identification"
        columns: Columns = {}
        for column, what in (("position", "position"), ("command", "effort")):
            rows = np.genfromtxt(folder / f"dynamic/tiago_{what}.csv", delimiter=",", names=True)
            columns["time_s"] = rows["t"]
            columns[column] = rows[f"_{name}_joint_{what}"]
        return columns

    return read


def flywheel(number: int) -> Read:
    """Return the reader of a motor with a flywheel, 1.7 kHz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, LINKS) / "data" / "trajectories" / "dc_motor"
        path = folder / f"Identification_traj_{number}.csv"
        rows = np.genfromtxt(path, delimiter=",", skip_header=1)
        return {"time_s": rows[:, 1], "position": rows[:, 2], "command": rows[:, 4]}

    return read


def driven_pendulum(number: int) -> Read:
    """Return the reader of a pendulum on a motor that follows one sine, 500 Hz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, LINKS) / "data" / "trajectories" / "pendulum"
        rows = np.genfromtxt(folder / f"harmonic_input_{number}.csv", delimiter=",")
        return {"time_s": rows[:, 0], "position": rows[:, 1], "command": rows[:, 3]}

    return read


def two_links(speed: str, number: int) -> Read:
    """Return the reader of one link of two, 100 Hz; the drive is off after 50 s."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, LINKS) / "data" / "trajectories" / "two_link"
        rows = np.genfromtxt(folder / f"two_link_observer_05_{speed}.csv")
        return {
            "time_s": rows[:, 0],
            "position": rows[:, 2 * number - 1],
            "command": rows[:, 4 + number],
        }

    return read


def flexible_link(stage: int) -> Read:
    """Return the reader of one stage of two with a flexible link each, 500 Hz, in degrees."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, FLEXIBLE_LINKS) / "software" / "quanser_original" / "Results"
        current = loadmat(folder / f"data_fsf_Im{stage}.mat")[f"data_Im{stage}"]
        angle = loadmat(folder / f"data_fsf_th{stage}1.mat")[f"data_th{stage}1"]
        return {
            "time_s": angle[:, 0],
            "position": angle[:, 2],
            "command": current[:, 2],
            "reference": angle[:, 1],
        }

    return read


def hobby_servo(recordings: Path) -> Columns:
    """Read a hobby servo that lifts a weight: whole degrees, and current without a sign."""
    folder = folder_of(recordings, HOBBY_SERVO) / "processed"
    rows = np.loadtxt(folder / "processed400-1.txt")
    return {"time_s": rows[:, 0] / 1e3, "position": rows[:, 1], "command": rows[:, 2]}
