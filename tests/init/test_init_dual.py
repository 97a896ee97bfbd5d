"""Two motors on one beam from `init`: one axis, on every driver, square and within its limits."""

from __future__ import annotations

import os
import pty
import subprocess
import sys

import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.config import load
from motorctl.errors import MotorctlError, UsageError

BEAM = [
    "--axis=x", "--motors=2", "--skew-limit=1mm", "--encoder=0.5um", "--mass=20kg",
    "--force-constant=35N/V", "--travel=-0.08..0.48", "--max-velocity=1m/s",
]  # fmt: skip
SWITCHES = ["--homing=switch", "--square-offset=0.4mm", "--home-position=-70mm"]


def run(*words):
    result = CliRunner().invoke(make_app(), [str(word) for word in words])
    if isinstance(result.exception, MotorctlError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


def test_a_beam_is_one_axis_over_the_force_of_both_its_motors(tmp_path):
    told = run("init", tmp_path / "beam.yaml", "--driver=sim", *BEAM)
    axis = load(tmp_path / "beam.yaml").axes["x"]
    assert (axis.channel, axis.dual_drive.channel) == (0, 1)
    assert axis.guards.skew.limit_m == pytest.approx(1e-3)
    assert axis.estimates[0].initial == pytest.approx(20 / 70, rel=5e-3)
    assert "two motors of 35 N/V: 70 N/V" in (tmp_path / "beam.yaml").read_text()
    assert "axes.x.dual_drive.skew.inertia_v_s2_m" in told


@pytest.mark.parametrize("driver", ["serial", "modbus", "can", "canopen"])
def test_a_beam_behind_a_bus_has_two_ends_that_its_driver_knows(tmp_path, driver):
    out = tmp_path / "beam.yaml"
    told = run("init", out, f"--driver={driver}", *BEAM, *SWITCHES)
    machine = load(out)  # which refuses a switch that no signal of either end tells of
    dual = machine.axes["x"].dual_drive
    assert dual.square_offset_m == pytest.approx(0.4e-3)
    assert dual.max_out_of_square_m >= machine.axes["x"].guards.skew.limit_m
    assert "motor_direction: -1 where" in told.replace("\n", " ")


def test_other_axes_take_the_channels_that_a_beam_leaves(tmp_path):
    out = tmp_path / "three.yaml"
    motors = ["--motors=y=2", "--skew-limit=y=1mm", "--axis=y", "--axis=z"]
    words = [word for word in BEAM if not word.startswith(("--motors", "--skew"))]
    run("init", out, "--driver=sim", *words, *motors)
    axes = load(out).axes
    assert [axis.channel for axis in axes.values()] == [0, 1, 3]
    assert axes["y"].dual_drive.channel == 2
    assert axes["x"].dual_drive is None
    run("init", out, "--force", "--driver=sim", *words, *motors, "--second-channel=y=0")
    axes = load(out).axes
    assert [axis.channel for axis in axes.values()] == [1, 2, 3]
    assert axes["y"].dual_drive.channel == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--motors=3"], "--motors 3: should be 1, or 2 for a beam"),
        (["--motors=1"], "axis x has one motor, and --skew-limit would be of a beam"),
        (["--second-channel=second"], "--second-channel second: should be a whole number, 0 to"),
        (["--skew-limit=1kg"], "--skew-limit 1kg: should be a length"),
        (["--skew-limit=0.2um"], r"guards\.skew\.limit_m: found 2e-07, should be above 2 enc"),
        (["--square-offset=1mm"], "axis x is homed by no switch or mark"),
        (["--axis=y", "--second-channel=x=3", "--second-channel=y=3"], "another motor's already"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_of_a_beam_is_one_clear_message(tmp_path, words, message):
    with pytest.raises(UsageError, match=message):
        run("init", tmp_path / "beam.yaml", "--driver=sim", *BEAM, *words)
    assert not list(tmp_path.iterdir())


def test_a_rotary_axis_has_one_motor(tmp_path):
    with pytest.raises(UsageError, match="axis c is rotary, and --motors 2 is of a beam"):
        run("init", tmp_path / "c.yaml", "--driver=sim", "--axis=c", "--kind=rotary", "--motors=2")


def test_without_a_terminal_a_beam_is_asked_how_far_its_ends_may_be_apart(tmp_path):
    words = [word for word in BEAM if not word.startswith("--skew")]
    with pytest.raises(UsageError, match="axis x: --skew-limit, how far the two ends may be apart"):
        run("init", tmp_path / "beam.yaml", "--driver=sim", *words)


@pytest.mark.slow
def test_at_a_terminal_two_motors_are_asked_for_with_channel_and_limit(tmp_path):
    answers = [
        "linear", "3", "2", "1", "0.5um", "20kg", "35N/V", "-0.08..0.48", "1m/s", "a millimetre",
        "1mm",
    ]  # fmt: skip
    main, side = pty.openpty()
    with subprocess.Popen(
        [sys.executable, "-c", "from motorctl.cli import main; main()", "init", "asked.yaml",
         "--driver=sim", "--axis=x"],
        stdin=side, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path, text=True,
    ) as process:  # fmt: skip
        os.write(main, "".join(f"{answer}\n" for answer in answers).encode())
        os.write(main, b"\x04")
        _, asked = process.communicate(timeout=60)
    os.close(main)
    os.close(side)
    assert process.returncode == 0, asked
    assert "x: motors: 1, or 2 on one beam (1)" in asked
    assert "--motors 3: should be 1, or 2" in asked
    assert "--skew-limit a millimetre: should be a length" in asked
    axis = load(tmp_path / "asked.yaml").axes["x"]
    assert (axis.dual_drive.channel, axis.guards.skew.limit_m) == (1, pytest.approx(1e-3))


@pytest.mark.slow
def test_a_new_beam_homes_both_ends_squares_and_moves_within_its_limit(tmp_path):
    run(
        "init", tmp_path / "beam.yaml", "--driver=modbus", *BEAM, *SWITCHES,
        "--simulated", tmp_path / "there.yaml",
    )  # fmt: skip
    run("simulate", tmp_path / "there.yaml", "--log", tmp_path / "run.parquet")
    log = pq.read_table(tmp_path / "run.parquet")
    position, skew = np.array(log["x.position_m"]), np.array(log["x.skew_m"])
    moved = np.array(log["x.reference_velocity_m_s"]) > 0.5
    assert moved.any()
    assert np.abs(skew[moved]).max() < 1e-4
    assert -0.08 < position[moved].min() < position[moved].max() < 0.48
