"""How public recordings of winches, instruments' drives, tables, dampers and servos are read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat

from motorctl.log.table_mat import MatTable
from motorctl_benchmarks.real_machines.readers import (
    Columns,
    Read,
)
from motorctl_benchmarks.real_machines.repositories import (
    COURSE_MOTOR,
    FLUID_DAMPERS,
    GIMBAL_MOTOR,
    INSTRUMENT_DRIVE,
    RANDOM_VOLTS,
    SERVO_PROJECT,
    SHAKING_TABLE,
    SMALLER_SERVO,
    STUDENTS_MOTOR,
    TACHOMETER,
    WINCHES,
    folder_of,
)


def instrument_drive(name: str, command: str = "current") -> Read:
    """Return the reader of a spindle that turns a surgical instrument's jaw against a brake, 1 kHz.

    The angle is counted before a gear, 35 to 1; the torque is measured behind it.
    """

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, INSTRUMENT_DRIVE) / "data" / "Tool_4_Maryland_L_2"
        rows = np.loadtxt(folder / f"{name}.TXT", delimiter=",", comments="%")
        column = {"current": 3, "torque": 2}[command]
        factor = {"current": 1.0, "torque": 0.000039811}[command]
        return {
            "time_s": rows[:, 0],
            "position": rows[:, 8] * 2.0 * np.pi / (4096.0 * 35.0),
            "command": factor * rows[:, column],
        }

    return read


def winch(motor: int, name: str) -> Read:
    """Return the reader of a winch that hoists 5 kg: turns and current, 20 to 27 Hz, uneven."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, WINCHES) / "Lifting_tests" / "5kg" / f"ODrive{motor}"
        rows = np.genfromtxt(path / f"{name}.csv", delimiter=",", skip_header=1)
        rows = rows[:, [0, 1 + motor, 9 + motor]]
        rows = rows[np.isfinite(rows).all(axis=1)]
        return {"time_s": rows[:, 0], "position": rows[:, 1], "command": rows[:, 2]}

    return read


def students_motor(name: str) -> Read:
    """Return the reader of a small motor in the air: voltage and speed, 1 kHz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, STUDENTS_MOTOR) / "Lab_Results" / "New" / name
        speed, volts = "objects{20}", "objects{38}"
        rows = MatTable(folder / "Raw_Data.mat").read([speed, volts])
        return {
            "time_s": np.arange(len(rows[volts])) / 1000.0,
            "velocity": rows[speed],
            "command": rows[volts],
        }

    return read


def shaking_table(name: str) -> Read:
    """Return the reader of a table that a motor shakes through a screw: mm and volts, 200 Hz."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, SHAKING_TABLE) / "data" / f"{name}.mat"
        names = {
            "time_s": "objects{2}.timepos(:,1)",
            "position": "objects{2}.timepos(:,2)",
            "command": "objects{2}.Ut",
        }
        rows = MatTable(path).read(names.values())
        return {signal: rows[column] for signal, column in names.items()}

    return read


def _numbered(recordings: Path, repository: str, *parts: str) -> NDArray[np.float64]:
    return np.genfromtxt(
        folder_of(recordings, repository).joinpath(*parts), delimiter=",", skip_header=1
    )


def gimbal_motor(recordings: Path) -> Columns:
    """Read a motor for gimbals in a loop of the angle: degrees and the torque asked for, 500 Hz."""
    rows = _numbered(recordings, GIMBAL_MOTOR, "motor_data.csv")
    return {"time_s": rows[:, 0], "position": rows[:, 1], "command": rows[:, 6]}


def fluid_damper(name: str) -> Read:
    """Return the reader of a damper with a magnetic fluid, pulled to and fro: mm and N, 100 Hz."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, FLUID_DAMPERS) / "data" / f"{name}.mat"
        rows = loadmat(path, squeeze_me=True)
        return {"time_s": rows["Tout"], "position": rows["dist"], "command": rows["forc"]}

    return read


def creeping_servo(recordings: Path) -> Columns:
    """Read a rebuilt hobby servo that creeps one way and back: turns of its motor and PWM."""
    path = folder_of(recordings, SERVO_PROJECT) / "Python" / "tests" / "dataFiles"
    rows = np.loadtxt(path / "motorCoggingTorque.txt")
    turns = np.unwrap(rows[:, 3], period=2048.0) / 2048.0
    return {"time_s": rows[:, 0] - rows[0, 0], "position": turns, "command": rows[:, 2]}


def course_motor(name: str, command: str = "volts") -> Read:
    """Return the reader of a geared motor of a course: rad/s and volts or amperes, 1 kHz."""

    def read(recordings: Path) -> Columns:
        path = folder_of(recordings, COURSE_MOTOR) / "Raw Signal" / f"{name}.mat"
        speed, driven = "objects{50}", {"volts": "objects{24}", "current": "objects{75}"}[command]
        rows = MatTable(path).read([speed, driven])
        return {
            "time_s": np.arange(len(rows[speed])) / 1000.0,
            "velocity": rows[speed],
            "command": rows[driven],
        }

    return read


def smaller_servo(name: str) -> Read:
    """Return the reader of a servo motor that turns to and fro once: rad and N m, 1 kHz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, SMALLER_SERVO) / "Lorenz_id" / "Lorenz_id" / "data"
        rows = np.genfromtxt(folder / f"data_{name}.txt")
        time_s = np.arange(len(rows)) / 1000.0
        return {"time_s": time_s, "position": rows[:, 0], "command": rows[:, 4]}

    return read


def random_volts(recordings: Path) -> Columns:
    """Read a geared motor that is given random volts: rad/s, 100 Hz."""
    folder = folder_of(recordings, RANDOM_VOLTS) / "stm32" / "motor_sys_id" / "SWV_export"
    rows = np.genfromtxt(folder / "random_input_rsp.csv", delimiter=",", skip_header=1)
    return {"time_s": rows[:, 0], "velocity": rows[:, 2], "command": rows[:, 1]}


def tachometer(looped: bool) -> Read:
    """Return the reader of a motor that drives a tachometer by a belt: V and V, 100 or 500 Hz."""

    def read(recordings: Path) -> Columns:
        folder = folder_of(recordings, TACHOMETER)
        path = folder / "Dados-de-leitura" / "PRBS-FS500.csv"
        if looped:
            path = folder / "Controles" / "PRBS-FS10" / "ord1" / "real"
            path /= "data-cavlr1-kc-fs100.csv"
        rows = np.genfromtxt(path, delimiter=",", names=True, usecols=range(2 + looped))
        time_s = np.arange(len(rows)) / (100.0 if looped else 500.0)
        return {"time_s": time_s, "velocity": rows["y"], "command": rows["u"]}

    return read
