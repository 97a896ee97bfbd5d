"""Recordings of real machines by other hands: right, or honestly unknown, and never worse.

What each machine is was found by an analysis apart from `diagnose` (docs/real_machines.md). The
recordings are not ours to publish: `tools/fetch_recordings.py` fetches them.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from fetch_recordings import REPOSITORIES, folder_of
from fit_plant import C1
from scipy.io import loadmat

from motorctl.errors import DataError
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.diagnose.result import AxisDiagnosis
from motorctl.log import read_recording

RECORDINGS = Path(os.environ.get("MOTORCTL_RECORDINGS", "nowhere"))
MISSING = [name for name in REPOSITORIES if not folder_of(RECORDINGS, name).is_dir()]
UR10E, BLDC, OPENARM, CAMBER, PANDA = REPOSITORIES[:5]
CART, PENDULUM, DOUBLE, KUKA, DAMPER, PROPELLER, BEAM, TWO_MOTORS = REPOSITORIES[5:]

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


def cart(name: str) -> Callable[[], Columns]:
    """A cart on a belt, a pendulum hanging from it, moved by a duty cycle."""

    def read() -> Columns:
        rows = mat(folder_of(RECORDINGS, CART) / "sysID" / "real_data" / name)
        return {
            "time_s": rows["t"],
            "position": rows["x"],
            "command": 100.0 * rows["outu"].astype(float),
        }

    return read


def pendulum(name: str) -> Callable[[], Columns]:
    """A weight on a rod on a motor, angle and torque as the motor tells them."""

    def read() -> Columns:
        path = folder_of(RECORDINGS, PENDULUM) / "results" / name
        rows = np.loadtxt(path, delimiter=",", skiprows=1)
        time, angle, torque = (1, 2, 4) if rows.shape[1] == 5 else (0, 1, 3)  # some are counted
        return {"time_s": rows[:, time], "position": rows[:, angle], "command": rows[:, torque]}

    return read


def double(name: str, number: int) -> Callable[[], Columns]:
    """One joint of two that carry each other."""

    def read() -> Columns:
        path = folder_of(RECORDINGS, DOUBLE) / "data" / "experiment_records" / name
        rows = np.loadtxt(path, delimiter=",", skiprows=1)
        return {
            "time_s": rows[:, 0],
            "position": rows[:, number],
            "command": rows[:, 12 + number],
        }

    return read


def kuka(number: int) -> Callable[[], Columns]:
    """One axis of an arm for 300 kg whose axes all move at once, by the motor's encoder."""

    def read() -> Columns:
        folder = folder_of(RECORDINGS, KUKA) / "data" / "recorded_trajectories"
        rows = mat(folder / "2020-10-21 10s FF A 08ms" / "data.mat")["rec"]
        return {
            "time_s": rows["time_cont"].item(),
            "position": rows["act_pos_mot_deg"].item()[number - 1],
            "command": rows["act_torque_abs_nm"].item()[number - 1],
            "reference": rows["ref_pos_deg"].item()[number - 1],
        }

    return read


def damper(name: str) -> Callable[[], Columns]:
    """A band brake between two plates, pulled to and fro: inches and thousands of pounds."""

    def read() -> Columns:
        folder = folder_of(RECORDINGS, DAMPER) / "data" / "dataset-2" / "characterization datasets"
        rows = np.array(json.loads((folder / name).read_text())["data"])
        return {
            "time_s": rows[:, 0],
            "position": 25.4 * rows[:, 1],
            "command": 4448.22 * rows[:, 2],
        }

    return read


def propeller() -> Columns:
    """A pendulum lifted by a propeller, 100 Hz, and the voltage of its motor."""
    folder = folder_of(RECORDINGS, PROPELLER) / "matlab" / "examples" / "AeroShield"
    rows = mat(folder / "Identification_Data2.mat")
    return {
        "time_s": 0.01 * np.arange(len(rows["u"])),
        "position": rows["yrad"],
        "command": rows["u"],
    }


def beam() -> Columns:
    """A motor with an elastic ruler on its shaft; counts of an encoder, and of the amplifier."""
    path = folder_of(RECORDINGS, BEAM) / "example" / "2009-04-21" / "swept1-0-10hz.txt"
    rows = np.loadtxt(path)
    return {"time_s": rows[:, 0], "position": rows[:, 4], "command": rows[:, 3]}


def two_motors() -> Columns:
    """A motor against a motor: one step of the torque, and it turns one way."""
    path = folder_of(RECORDINGS, TWO_MOTORS) / "Data" / "Identification" / "idf_pos_0.06_1.mat"
    rows = mat(path)["data"]
    return {"time_s": rows[:, 0], "position": rows[:, 2], "command": rows[:, 4]}


def mat(path: Path) -> dict[str, np.ndarray]:
    return dict(loadmat(path, squeeze_me=True))


LIN_A = actuator("LinA/data/pp-sine-sweep-10mm-0.5Hz.txt")
LIN_B = actuator("LinB/data/no-load-square-wave-half-travel-3Hz.txt")
LIN_D = actuator("LinD/data/no-pp-sine-sweep-10mm-0.5Hz.txt")
ECC_A = actuator("EccA/data/load-square-wave-full-travel-1Hz.txt")
CART_CHIRP = cart("chirp2_20260608_113318.mat")
CART_LINES = cart("multisin_20260506_191743.mat")
IN_A = "design_A.0/20220815/sys_id/trajectory_03.csv"
IN_C = "design_C.1/sys_id/20230629/20230629-143601/trajectory.csv"
GRAVITY = ("gravity",)
CARRIED = ("gravity", "position_force", "cross_axis")
"""What a joint may be said to have that another joint carries."""
TURNS_IN_GEAR = ("cogging", "force_ripple", "gravity", "cross_axis", "stribeck")
"""The motors of an arm have eight poles' torque a turn, the gears their friction."""
SWINGING = ("flexible_mode", "dead_zone", "input_lag", "input_delay", "cross_axis", "stribeck")
"""The cart's: its authors found a dead zone, and the pendulum swings at 0.8 Hz."""
HYSTERESIS = ("presliding", "stribeck")
SWING_UP = pendulum("control_method_ddp/data_measured.csv")
SWING_UP_SHORT = pendulum("control_method_direct_collocation/data_measured.csv")
SWING_UP_SLOW = pendulum("control_method_ilqr/data_measured.csv")
SWINGING_ROD = pendulum("filter_method_fft/measured_data.csv")
BY_HAND = pendulum("control_method_gravity_compensation/data_measured.csv")
HELD_BY_TORQUE = pendulum("control_method_pd/1nm_torque_limited_swingup_failure/data_measured.csv")
BAND_BRAKE = damper("0.5Hz30lbtension1amplitude.json")
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
    *(Machine(f"Panda joint {k}", panda(k), "N*m") for k in (1, 2, 3, 5, 7)),
    Machine("cart, chirp", CART_CHIRP, "%", SWINGING, position_unit="m"),
    Machine("cart, many sines", CART_LINES, "%", SWINGING, position_unit="m"),
    Machine("pendulum, swing-up of 6 s", SWING_UP, "N*m", GRAVITY),
    Machine("pendulum, swing-up of 3.5 s", SWING_UP_SHORT, "N*m", GRAVITY),
    Machine("pendulum, swinging", SWINGING_ROD, "N*m", GRAVITY),
    *(Machine(f"two joints A, joint {k}", double(IN_A, k), "N*m", CARRIED) for k in (1, 2)),
    *(Machine(f"two joints C, joint {k}", double(IN_C, k), "N*m", CARRIED) for k in (1, 2)),
    *(
        Machine(f"KR 300 axis {k}", kuka(k), "N*m", TURNS_IN_GEAR, position_unit="deg")
        for k in range(1, 7)
    ),
    Machine("band brake", BAND_BRAKE, "N", HYSTERESIS, position_unit="mm"),
    Machine("ruler on a motor", beam, "%", ("flexible_mode", "input_lag", "input_delay")),
    Machine("motor against a motor", two_motors, "N*m"),
]


def described(machine: Machine, folder: Path) -> Path:
    """Write the columns with the times that were recorded, and their description."""
    columns = machine.read()
    rows = np.column_stack(list(columns.values()))
    np.savetxt(folder / "r.csv", rows, delimiter=",", header=",".join(columns), comments="")
    text = "file: r.csv\ntime: {column: time_s}\naxes:\n  x:\n"
    text += f"    position: {{column: position, unit: {machine.position_unit}}}\n"
    text += f"    command: {{column: command, unit: '{machine.unit}', scale: {machine.scale}}}\n"
    if "reference" in columns:
        text += f"    reference: {{column: reference, unit: {machine.position_unit}}}\n"
    path = folder / "r.yaml"
    path.write_text(text)
    return path


def diagnosed(machine: Machine, folder: Path) -> AxisDiagnosis:
    return diagnose_recording(read_recording(described(machine, folder)), {"x": C1}).axes["x"]


def refusal(machine: Machine, folder: Path) -> str:
    """Return why a machine is refused; nothing where it is not."""
    try:
        diagnosed(machine, folder)
    except DataError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("machine", MACHINES, ids=lambda machine: machine.name)
def test_a_real_machine_gets_a_right_answer_or_none(machine: Machine, tmp_path: Path) -> None:
    axis = diagnosed(machine, tmp_path)
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
    loaded = Machine("Panda joint 4", panda(4), "N*m")
    with pytest.raises(DataError, match="record them beside it"):
        diagnose_recording(read_recording(described(loaded, tmp_path)), {"x": C1})


@pytest.mark.parametrize(
    "machine",
    [
        Machine("cart, chirp", CART_CHIRP, "%", position_unit="m"),
        Machine("pendulum, swinging", SWINGING_ROD, "N*m"),
    ],
    ids=lambda machine: machine.name,
)
def test_a_quarter_of_the_command_is_not_called_noise(machine: Machine, tmp_path: Path) -> None:
    axis = diagnosed(machine, tmp_path)
    assert axis.error.held_out_after_rms > 0.2 * axis.error.command_rms
    assert "only noise" not in axis.sentence


@pytest.mark.xfail(strict=True, reason="found, but its confidence is below what a name needs")
@pytest.mark.parametrize("read", [SWING_UP, SWING_UP_SHORT])
def test_a_pendulum_has_gravity(read: Callable[[], Columns], tmp_path: Path) -> None:
    axis = diagnosed(Machine("pendulum", read, "N*m"), tmp_path)
    assert [effect.name for effect in axis.effects] == ["gravity"]


@pytest.mark.parametrize(
    "machine",
    [
        Machine("pendulum with a propeller", propeller, "V"),
        Machine("pendulum, swing-up at 50 Hz", SWING_UP_SLOW, "N*m"),
    ],
    ids=lambda machine: machine.name,
)
def test_a_command_against_gravity_explains_the_motion(machine: Machine, tmp_path: Path) -> None:
    diagnosed(machine, tmp_path)


@pytest.mark.parametrize("read", [BY_HAND, HELD_BY_TORQUE], ids=["moved by hand", "held"])
def test_a_pendulum_that_the_motor_does_not_move_is_not_called_reversed(
    read: Callable[[], Columns], tmp_path: Path
) -> None:
    assert "reversed" not in refusal(Machine("pendulum", read, "N*m"), tmp_path)


def test_no_spline_of_forces_beyond_any_command_is_offered(tmp_path: Path) -> None:
    axis = diagnosed(Machine("band brake", BAND_BRAKE, "N", position_unit="mm"), tmp_path)
    assert axis.unknown is not None
    assert axis.unknown.compensation is None
    assert axis.unknown.depends_on == ()
