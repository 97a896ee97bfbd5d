"""Recordings of real machines by other hands: right, or honestly unknown, and never worse.

What each machine is was found by an analysis apart from `diagnose` (docs/real_machines.md). The
recordings are not ours to publish: `tools/fetch_recordings.py` fetches them.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fit_plant import C1

from motorctl.errors import DataError
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.diagnose.result import AxisDiagnosis
from motorctl.identify.diagnose.search.whole_model import FAR_OFF
from motorctl.log import read_recording
from motorctl_benchmarks.real_machines.arm_readers import kinova
from motorctl_benchmarks.real_machines.axes import (
    AXES,
    BAND_BRAKE,
    BY_HAND,
    CART_CHIRP,
    HELD_BY_TORQUE,
    LIN_B,
    SWING_UP,
    SWING_UP_SHORT,
    SWING_UP_SLOW,
    SWINGING_ROD,
)
from motorctl_benchmarks.real_machines.bench_readers import (
    coupled_motors,
    guide,
    small_servo,
)
from motorctl_benchmarks.real_machines.description import described
from motorctl_benchmarks.real_machines.lab_readers import (
    egg_lift,
    milling_axis,
    position_servo,
    rack,
)
from motorctl_benchmarks.real_machines.readers import (
    Read,
    brushless,
    panda,
    propeller,
    wam,
)
from motorctl_benchmarks.real_machines.real_axis import RealAxis
from motorctl_benchmarks.real_machines.repositories import (
    REPOSITORIES,
    folder_of,
)
from motorctl_benchmarks.real_machines.run_axis import RELIED_UPON
from motorctl_benchmarks.real_machines.stage_readers import (
    ball_in_tube,
    ball_on_beam,
    levitated_magnet,
)

RECORDINGS = Path(os.environ.get("MOTORCTL_RECORDINGS", "nowhere"))
MISSING = [name for name in REPOSITORIES if not folder_of(RECORDINGS, name).is_dir()]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        bool(MISSING),
        reason="MOTORCTL_RECORDINGS names no folder with the recordings: tools/fetch_recordings.py",
    ),
]


MILL_X, MILL_Y = (milling_axis(letter, "Position") for letter in "XY")
BALL_RANDOM = ball_on_beam("dataAprbsAllNEW", 1, 0)


def diagnosed(machine: RealAxis, folder: Path) -> AxisDiagnosis:
    path = described(machine, machine.read(RECORDINGS), folder)
    return diagnose_recording(read_recording(path), {"x": C1}).axes["x"]


def refusal(machine: RealAxis, folder: Path) -> str:
    """Return why a machine is refused; nothing where it is not."""
    try:
        diagnosed(machine, folder)
    except DataError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("machine", AXES, ids=lambda machine: machine.name)
def test_a_real_machine_gets_a_right_answer_or_none(machine: RealAxis, tmp_path: Path) -> None:
    axis = diagnosed(machine, tmp_path)
    named = {effect.name for effect in axis.effects if effect.confidence >= RELIED_UPON}
    told = ", ".join(f"{e.name} ({e.confidence:.2f})" for e in axis.effects) or "-"
    print(f"{machine.name}: {axis.verdict}; {told}; {axis.sentence}")
    assert named <= set(machine.may_name)
    before, after = (
        axis.error.simulated_position_before_rms,
        axis.error.simulated_position_after_rms,
    )
    if before is None or after is None:  # beside a weight the declared model cannot move
        seen = None if axis.whole is None else axis.whole.seen_inertia
        assert axis.declared_theta[0] < 0.0 or (
            seen is not None and axis.declared_theta[0] > FAR_OFF * seen[1]
        )
    else:
        assert after <= 1.02 * before
    if machine.read is brushless:
        cogging = next(e for e in axis.effects if e.name == "cogging")
        assert cogging.effect.options.pitch_m == pytest.approx(2.0 * np.pi / 6.0, rel=1e-3)


def test_a_current_of_the_other_sign_is_told_as_that(tmp_path: Path) -> None:
    as_recorded = RealAxis("screw actuator B", LIN_B, "A", position_unit="mm")
    with pytest.raises(DataError, match="reversed"):
        diagnosed(as_recorded, tmp_path)


@pytest.mark.parametrize(
    ("machine", "told"),
    [
        (RealAxis("egg lift", egg_lift, "%", position_unit="deg"), "it is a magnitude"),
        (RealAxis("rack", rack, "%", position_unit="turn"), "at least 1 s are needed"),
        (RealAxis("position servo", position_servo, "%"), "explains none of the acceleration"),
        (RealAxis("ball in a tube", ball_in_tube, "%", position_unit="mm"), "only noise"),
        (RealAxis("ball, random", BALL_RANDOM, "%", position_unit="mm"), "explains none of"),
        (RealAxis("magnet as recorded", levitated_magnet, "mA", position_unit="mm"), "reversed"),
        (RealAxis("guide", guide(1, 1), "V", position_unit="mm"), "reversed"),
        (RealAxis("servo in stiction", small_servo("sigma0_1"), "N*m"), "6 counts, limit 10"),
        (RealAxis("servo, ramp", small_servo("Fs_1"), "N*m"), "% of the time: in motion are"),
        (RealAxis("mill, X", MILL_X, "A", position_unit="mm"), "the position jumps 94 times"),
        (RealAxis("mill, Y", MILL_Y, "A", position_unit="mm"), "Rows are missing there"),
    ],
    ids=lambda of: of.name if isinstance(of, RealAxis) else "",
)
def test_what_cannot_be_diagnosed_is_refused_with_the_reason(
    machine: RealAxis, told: str, tmp_path: Path
) -> None:
    assert told in refusal(machine, tmp_path)


@pytest.mark.parametrize(("kind", "side"), [("A", "motor"), ("B", "motor"), ("A", "load")])
def test_motors_on_a_coupling_have_its_resonance(kind: str, side: str, tmp_path: Path) -> None:
    """Seen at the motor, the load holds it still at 54 Hz; at the load, 76 Hz swing up."""
    axis = diagnosed(RealAxis("coupled", coupled_motors(kind, side), "A"), tmp_path)
    if side == "motor":
        (mode,) = axis.effects
        assert mode.effect.options.frequency_hz == pytest.approx(53.7, abs=0.5)
        assert mode.confidence > 0.9
        return
    assert any("through a spring: behind a resonance of 77 Hz" in note for note in axis.notes)


@pytest.mark.parametrize("number", [2, 6])
def test_a_joint_that_makes_one_move_against_its_weight_is_not_reversed(
    number: int, tmp_path: Path
) -> None:
    axis = diagnosed(RealAxis("Gen3", kinova(number), "A"), tmp_path)
    assert axis.verdict == "insufficient_data"
    assert "only twice" in axis.sentence


@pytest.mark.parametrize("read", [panda(4), wam(4)], ids=["Panda joint 4", "WAM joint 4"])
def test_a_joint_that_other_joints_load_is_refused_with_what_to_record(
    read: Read, tmp_path: Path
) -> None:
    loaded = RealAxis("a joint", read, "N*m")
    with pytest.raises(DataError, match="record them beside it"):
        diagnosed(loaded, tmp_path)


@pytest.mark.parametrize(
    "machine",
    [
        RealAxis("cart, chirp", CART_CHIRP, "%", position_unit="m"),
        RealAxis("pendulum, swinging", SWINGING_ROD, "N*m"),
    ],
    ids=lambda machine: machine.name,
)
def test_a_quarter_of_the_command_is_not_called_noise(machine: RealAxis, tmp_path: Path) -> None:
    axis = diagnosed(machine, tmp_path)
    assert axis.error.held_out_after_rms > 0.2 * axis.error.command_rms
    assert "only noise" not in axis.sentence


@pytest.mark.parametrize(
    "read",
    [
        pytest.param(
            SWING_UP,
            marks=pytest.mark.xfail(strict=True, reason="found, but too unsure to be named"),
        ),
        SWING_UP_SHORT,
    ],
)
def test_a_pendulum_has_gravity(read: Read, tmp_path: Path) -> None:
    axis = diagnosed(RealAxis("pendulum", read, "N*m"), tmp_path)
    assert axis.verdict == "effect" or "gravity takes" in axis.sentence
    assert [effect.name for effect in axis.effects] == ["gravity"]


@pytest.mark.parametrize(
    "machine",
    [
        RealAxis("pendulum with a propeller", propeller, "V"),
        RealAxis("pendulum, swing-up at 50 Hz", SWING_UP_SLOW, "N*m"),
    ],
    ids=lambda machine: machine.name,
)
def test_a_command_against_gravity_explains_the_motion(machine: RealAxis, tmp_path: Path) -> None:
    diagnosed(machine, tmp_path)


@pytest.mark.parametrize("read", [BY_HAND, HELD_BY_TORQUE], ids=["moved by hand", "held"])
def test_a_pendulum_that_the_motor_does_not_move_is_not_called_reversed(
    read: Read, tmp_path: Path
) -> None:
    assert "reversed" not in refusal(RealAxis("pendulum", read, "N*m"), tmp_path)


def test_no_spline_of_forces_beyond_any_command_is_offered(tmp_path: Path) -> None:
    axis = diagnosed(RealAxis("band brake", BAND_BRAKE, "N", position_unit="mm"), tmp_path)
    assert axis.unknown is not None
    assert axis.unknown.compensation is None
    assert axis.unknown.depends_on == ()


def test_the_bench_sets_the_position_that_peers_predict_beside_ours(tmp_path: Path) -> None:
    asked = ("bench", "recordings", "--only", "UR10e joint 3", "--recordings", str(RECORDINGS))
    done = subprocess.run(
        [sys.executable, "-c", "from motorctl.cli import main; main()", *asked, "--json"],
        capture_output=True,
        text=True,
        check=True,
    )
    (axis,) = json.loads(done.stdout)["axes"]
    assert axis["ours"] < 0.8 * axis["declared"]
    for peer, missed in axis["peers"].items():  # where they are installed
        assert missed > 0.0, peer
