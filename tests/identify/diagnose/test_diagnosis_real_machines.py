"""Recordings of real machines by other hands: right, or honestly unknown, and never worse.

What each machine is was found by an analysis apart from `diagnose` (docs/real_machines.md). The
recordings are not ours to publish: `tools/fetch_recordings.py` fetches them.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from fetch_recordings import REPOSITORIES, folder_of
from fit_plant import C1

from motorctl.errors import DataError
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.log import read_recording

RECORDINGS = Path(os.environ.get("MOTORCTL_RECORDINGS", "nowhere"))
MISSING = [name for name in REPOSITORIES if not folder_of(RECORDINGS, name).is_dir()]
UR10E, BLDC, OPENARM, CAMBER, PANDA = REPOSITORIES

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        bool(MISSING),
        reason="MOTORCTL_RECORDINGS names no folder with the recordings: tools/fetch_recordings.py",
    ),
]
Columns = dict[str, np.ndarray]
RELIED_UPON = 0.5
"""Confidence below which a name says itself that it is rather wrong."""


@dataclass(frozen=True)
class Machine:
    """One axis of a recording, and what may be said of it."""

    name: str
    read: Callable[[], Columns]
    """Gives time_s, position, command and, where there is one, reference."""
    unit: str
    may_name: tuple[str, ...] = ()
    """Effects that the machine has; none other may be named."""
    position_unit: str = "rad"
    scale: int = 1
    """Of the command; -1 where its sign is known to be the other one."""


def joint(number: int) -> Callable[[], Columns]:
    def read() -> Columns:
        folder = folder_of(RECORDINGS, UR10E) / "dataset_ur10e" / "jointwise_motion"
        (path,) = folder.glob(f"*joint_{number}.csv")
        rows = np.loadtxt(path, delimiter=",")
        return {
            "time_s": rows[:, 0] - rows[0, 0],
            "position": rows[:, number],
            "command": rows[:, 12 + number],
        }

    return read


def brushless() -> Columns:
    path = folder_of(RECORDINGS, BLDC) / "codes" / "Testing" / "speed_data" / "speed_test1.txt"
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    rows = rows[rows[:, 5] == 0.0]  # its own compensation is off
    return {"time_s": rows[:, 0], "position": rows[:, 1], "command": rows[:, 4]}


def arm(number: int) -> Callable[[], Columns]:
    def read() -> Columns:
        folder = folder_of(RECORDINGS, OPENARM) / "results"
        rows = np.load(folder / f"real_uart_capture_collect_joint_{number}.npz")
        return {
            "time_s": rows["time"] - rows["time"][0],
            "position": rows["q"][:, number - 1],
            "command": rows["tau_command"][:, number - 1],
            "reference": rows["q_cmd"][:, number - 1],
        }

    return read


def actuator(name: str) -> Callable[[], Columns]:
    """An actuator of a car's suspension: screws (mm) or a gear (deg), under its own controller."""

    def read() -> Columns:
        rows = np.loadtxt(folder_of(RECORDINGS, CAMBER) / "actuators" / name)
        return {"time_s": rows[:, 0] / 1e3, "position": rows[:, 3], "command": rows[:, 5]}

    return read


def panda(number: int) -> Callable[[], Columns]:
    """One joint of an arm whose joints all move at once."""

    def read() -> Columns:
        folder = folder_of(RECORDINGS, PANDA) / "matlab" / "data" / "Exciting_Traj"
        folder = folder / "Trajectory_1" / "rbt_log"
        columns = {}
        for column, name in (("time_s", "time"), ("position", "positions"), ("command", "torques")):
            values = np.loadtxt(folder / f"exciting_traj_{name}.txt")
            columns[column] = values if column == "time_s" else values.reshape(-1, 7)[:, number - 1]
        return columns

    return read


LIN_A = actuator("LinA/data/pp-sine-sweep-10mm-0.5Hz.txt")
LIN_B = actuator("LinB/data/no-load-square-wave-half-travel-3Hz.txt")
LIN_D = actuator("LinD/data/no-pp-sine-sweep-10mm-0.5Hz.txt")
ECC_A = actuator("EccA/data/load-square-wave-full-travel-1Hz.txt")
GRAVITY = ("gravity",)
MACHINES = [
    Machine("brushless motor", brushless, "A", ("cogging", "periodic_disturbance")),
    Machine("UR10e joint 1", joint(1), "A"),
    Machine("UR10e joint 2", joint(2), "A", (*GRAVITY, "position_dependent_friction")),
    Machine("UR10e joint 3", joint(3), "A", GRAVITY),
    Machine("UR10e joint 4", joint(4), "A", (*GRAVITY, "position_force", "presliding")),
    Machine("UR10e joint 5", joint(5), "A"),
    Machine("UR10e joint 6", joint(6), "A"),
    Machine("OpenArm joint 1", arm(1), "N*m", GRAVITY),
    Machine("OpenArm joint 3", arm(3), "N*m"),
    Machine("OpenArm joint 6", arm(6), "N*m"),
    Machine("OpenArm joint 7", arm(7), "N*m"),
    Machine("screw actuator A", LIN_A, "mA", position_unit="mm"),
    Machine("screw actuator B", LIN_B, "A", position_unit="mm", scale=-1),
    Machine("screw actuator D", LIN_D, "mA", position_unit="mm"),
    Machine("eccentric actuator A", ECC_A, "A", position_unit="deg", scale=-1),
    *(Machine(f"Panda joint {k}", panda(k), "N*m") for k in (1, 2, 5, 7)),
]


def described(machine: Machine, folder: Path) -> Path:
    """Write the columns with the times that were recorded, and their description."""
    columns = machine.read()
    rows = np.column_stack(list(columns.values()))
    np.savetxt(folder / "r.csv", rows, delimiter=",", header=",".join(columns), comments="")
    text = "file: r.csv\ntime: {column: time_s}\naxes:\n  x:\n"
    text += f"    position: {{column: position, unit: {machine.position_unit}}}\n"
    text += f"    command: {{column: command, unit: {machine.unit}, scale: {machine.scale}}}\n"
    if "reference" in columns:
        text += "    reference: {column: reference, unit: rad}\n"
    path = folder / "r.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("machine", MACHINES, ids=lambda machine: machine.name)
def test_a_real_machine_gets_a_right_answer_or_none(machine: Machine, tmp_path: Path) -> None:
    axis = diagnose_recording(read_recording(described(machine, tmp_path)), {"x": C1}).axes["x"]
    named = {effect.name for effect in axis.effects if effect.confidence >= RELIED_UPON}
    print(f"{machine.name}: {axis.verdict}; {axis.sentence}")
    assert named <= set(machine.may_name)
    before, after = (
        axis.error.simulated_position_before_rms,
        axis.error.simulated_position_after_rms,
    )
    assert before is not None
    assert after is not None
    assert after <= 1.02 * before
    if machine.read is brushless:
        cogging = next(e for e in axis.effects if e.name == "cogging")
        assert cogging.effect.options.pitch_m == pytest.approx(2.0 * np.pi / 6.0, rel=1e-3)


def test_a_current_of_the_other_sign_is_told_as_that(tmp_path: Path) -> None:
    as_recorded = Machine("screw actuator B", LIN_B, "A", position_unit="mm")
    with pytest.raises(DataError, match="reversed"):
        diagnose_recording(read_recording(described(as_recorded, tmp_path)), {"x": C1})


def test_a_joint_that_other_joints_load_is_refused_with_what_to_record(tmp_path: Path) -> None:
    loaded = Machine("Panda joint 3", panda(3), "N*m")
    with pytest.raises(DataError, match="record them beside it"):
        diagnose_recording(read_recording(described(loaded, tmp_path)), {"x": C1})
