"""`motorctl init` as a person meets it: options with units, questions, and what devices tell."""

from __future__ import annotations

import json
import math
import os
import pty
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.config import load
from motorctl.errors import MotorctlError, UsageError
from motorctl.init.quantities import LENGTH, VELOCITY, quantity, resolution, travel

STAGE = ["--encoder=0.5um", "--mass=12kg", "--force-constant=30N/V", "--travel=-0.2..0.3"]
FAST = "--max-velocity=0.8m/s"


def run(*words):
    result = CliRunner().invoke(make_app(), [str(word) for word in ("init", *words)])
    if isinstance(result.exception, MotorctlError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


def test_a_screw_axis_is_told_by_torque_counts_a_turn_and_what_turns_with_it(tmp_path):
    out = tmp_path / "screw.yaml"
    told = run(
        out, "--driver=sim", "--axis=z", "--encoder=10000/turn", "--screw-pitch=5mm",
        "--mass=20kg", "--rotor-inertia=0.4kg*cm^2", "--force-constant=0.1N*m/A",
        "--amplifier=1A/V", "--travel=0..400mm", "--max-velocity=12m/min",
    )  # fmt: skip
    axis = load(out).axes["z"]
    turn = 2.0 * math.pi / 0.005
    assert axis.encoder.resolution_m == 0.5e-6
    assert axis.limits.travel_m == (0.0, 0.4)
    assert axis.limits.max_velocity_m_s == pytest.approx(0.2)
    expected = (20.0 + 0.4e-4 * turn**2) / (0.1 * turn)
    assert axis.estimates[0].initial == pytest.approx(expected, rel=5e-3)
    assert "mass: 20 kg and 63.17 kg, as which 4e-05 kg*m^2 on the screw" in out.read_text()
    assert f"motorctl simulate {out} --log screw.parquet" in " ".join(told.split())


def test_an_option_holds_for_every_axis_or_for_the_one_that_it_names(tmp_path):
    out, simulated = tmp_path / "three.yaml", tmp_path / "three_simulated.yaml"
    told = json.loads(
        run(
            out, "--driver=sim", "--driver=z=modbus", "--axis=x", "--axis=y", "--axis=z", *STAGE,
            FAST, "--mass=y=40kg", "--max-velocity=z=0.1m/s", "--homing=z=switch",
            "--driver-option=modbus.tcp.host=10.0.0.7", f"--simulated={simulated}", "--json",
        )
    )  # fmt: skip
    machine = load(out)
    first = {name: axis.estimates[0].initial for name, axis in machine.axes.items()}
    assert first == {"x": 0.4, "y": 1.33, "z": 0.4}
    assert machine.axes["z"].limits.max_velocity_m_s == 0.1
    assert machine.drivers["modbus"].options.tcp.host == "10.0.0.7"
    assert told["axes"]["z"]["delay_s"] == pytest.approx(1e-3)
    assert load(simulated).axes["z"].homing.method == "switch"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--encoder=0.1mrad",), "is an angle, and this axis is linear.* --kind rotary"),
        (("--travel=0..360deg",), "is an angle, and this axis is linear.* --kind rotary"),
        (("--max-velocity=3000rpm",), "is an angle, and this axis is linear.* --kind rotary"),
        (("--mass=12",), None),
        (("--mass=12lb",), r"--mass 12lb: should be a mass, as in 12kg; units: kg, g, t"),
        (("--mass=-1kg",), "--mass -1kg: should be above 0"),
        (("--force-constant=30",), r"units: N/V, N/A"),
        (("--force-constant=45N/A",), "--amplifier, amperes that the amplifier gives a volt"),
        (("--encoder=1000/turn",), "--screw-pitch, travel of one turn of the screw"),
        (("--travel=0.3..-0.2",), "the lower end should stand first"),
        (("--mass=w=3kg",), "--mass w=3kg: there is no axis 'w'; x"),
        (("--driver=simm",), "unknown driver 'simm'; installed:"),
        (("--from=device",), "--from device: should be devices"),
        (("--driver-option=can.channel=can1",), "should be DRIVER.KEY=VALUE"),
    ],
)
def test_what_makes_no_sense_is_one_message_that_names_the_option(tmp_path, words, message):
    given = [*STAGE, FAST, *words]
    if not any(word.startswith("--driver=") for word in words):
        given.append("--driver=sim")
    if message is None:
        run(tmp_path / "machine.yaml", *given)
        return
    with pytest.raises(UsageError, match=message):
        run(tmp_path / "machine.yaml", *given)
    assert list(tmp_path.iterdir()) == []


def test_without_a_terminal_all_that_is_missing_is_told_at_once(tmp_path):
    with pytest.raises(UsageError) as told:
        run(tmp_path / "machine.yaml", "--driver=canopen", "--axis=x", "--mass=3kg")
    for option in ("encoder", "force-constant", "travel", "max-velocity", "homing"):
        assert f"axis x: --{option}, " in str(told.value)
    assert "--mass," not in str(told.value)


def test_the_simulation_tells_what_is_there(tmp_path):
    out = tmp_path / "found.yaml"
    run(
        out, "--from=devices", "--driver=sim", "--driver-option=sim.preset=small_stage",
        "--encoder=0.1um", "--max-velocity=0.5m/s",
    )  # fmt: skip
    machine = load(out)
    axis = machine.axes["x"]
    assert axis.estimates[0].initial == 0.05
    assert axis.homing.method == "switch_index"
    assert axis.homing.home_position_m == -0.07
    assert machine.drivers["sim"].options.preset == "small_stage"
    assert machine.drivers["sim"].options.plant(0).cogging is not None  # as found, nothing less


FOUND = [
    "--from=devices", "--driver=sim", "--driver-option=sim.preset=small_stage", "--encoder=0.1um",
    "--max-velocity=0.5m/s",
]  # fmt: skip


@pytest.mark.parametrize(
    "words",
    [
        ("--friction=2N",),
        ("--mass=20kg",),
        ("--force-constant=30N/V", "--friction=2N"),
        ("--rotor-inertia=1e-5kg*m^2", "--screw-pitch=5mm"),
        ("--amplifier=2A/V",),
    ],
)
def test_newtons_beside_a_device_that_tells_volts_are_refused_not_dropped(tmp_path, words):
    option = words[0].partition("=")[0]
    with pytest.raises(UsageError, match=rf"axis x: .*{option}.*give both --mass and --force-con"):
        run(tmp_path / "found.yaml", *FOUND, *words)
    assert list(tmp_path.iterdir()) == []


def test_mass_and_force_constant_go_before_the_inertia_that_a_device_tells(tmp_path):
    out = tmp_path / "found.yaml"
    run(out, *FOUND, "--mass=3kg", "--force-constant=30N/V", "--friction=6N")
    first = [estimate.initial for estimate in load(out).axes["x"].estimates]
    assert first[0] == 0.1
    assert 0.2 in first  # 6 N / 30 N/V


def channels(folder, *names):
    out = folder / "found.yaml"
    preset = "--driver-option=sim.preset=published_gantry"  # which tells x and y
    words = [f"--axis={name}" for name in names]
    run(out, "--from=devices", "--driver=sim", preset, *words, "--encoder=0.5um", FAST)
    return {name: axis.channel for name, axis in load(out).axes.items()}


@pytest.mark.parametrize("names", [("y", "z"), ("b", "x")])
def test_no_channel_is_two_axes(tmp_path, names):
    with pytest.raises(UsageError, match=r"axes \w and \w: both would be channel .*x on 0, y on 1"):
        channels(tmp_path, *names)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("names", [("y", "x"), ("right", "left")])
def test_axes_are_the_devices_of_their_names_or_in_order(tmp_path, names):
    assert channels(tmp_path, *names) == (
        {"y": 1, "x": 0} if "x" in names else {"right": 0, "left": 1}
    )


def test_a_driver_of_ones_own_is_named_by_its_class_and_called_by_a_plain_name(tmp_path):
    out = tmp_path / "own.yaml"
    run(
        out, "--driver=config_bench:BenchDriver", "--axis=x", *STAGE, FAST, "--homing=absolute",
        "--driver-option=bench_driver.baud=2000000",
    )  # fmt: skip
    driver = load(out).drivers["bench_driver"]
    assert driver.type == "config_bench:BenchDriver"
    assert driver.options.baud == 2_000_000
    with pytest.raises(UsageError, match=r"--driver-option bench_driver\.buad: "):
        run(
            tmp_path / "other.yaml", "--driver=config_bench:BenchDriver", *STAGE, FAST,
            "--homing=absolute", "--driver-option=bench_driver.buad=1",
        )  # fmt: skip


@pytest.mark.parametrize("driver", ["serial", "modbus", "can"])
def test_devices_that_cannot_tell_are_one_clear_message(tmp_path, driver):
    with pytest.raises(UsageError, match=f"devices of driver {driver} have no way to tell"):
        run(tmp_path / "machine.yaml", "--from=devices", f"--driver={driver}")


@pytest.mark.slow
def test_at_a_terminal_what_is_missing_is_asked_until_it_makes_sense(tmp_path):
    answers = ["12 stone", "12kg", "45N/A", "2A/V", "-0.2..0.3", "0.8m/s"]
    code = "from motorctl.cli import main; main()"
    words = ["init", "asked.yaml", "--driver=sim", "--axis=x", "--encoder=0.5um"]
    main, side = pty.openpty()
    with subprocess.Popen(
        [sys.executable, "-c", code, *words],
        stdin=side, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path, text=True,
    ) as process:  # fmt: skip
        os.write(main, "".join(f"{answer}\n" for answer in answers).encode())
        os.write(main, b"\x04")  # nobody says more
        _, asked = process.communicate(timeout=60)
    os.close(main)
    os.close(side)
    assert process.returncode == 0, asked
    assert "x: mass of all that moves (12kg)" in asked
    assert "--mass 12 stone: should be a mass, as in 12kg" in asked
    assert "x: amperes that the amplifier gives a volt (2A/V)" in asked
    axis = load(tmp_path / "asked.yaml").axes["x"]
    assert axis.estimates[0].initial == pytest.approx(12 / 90, rel=5e-3)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("-0.2..0.3", (-0.2, 0.3)), ("-200..300mm", (-0.2, 0.3)), ("-20cm..0.3m", (-0.2, 0.3))],
)
def test_a_travel_has_two_ends_and_one_unit_may_do_for_both(text, expected):
    assert travel("--travel", text) == pytest.approx(expected)


def test_units_are_read_as_people_spell_them():
    assert quantity("--x", "5 µm", LENGTH)[0] == pytest.approx(5e-6)
    assert quantity("--x", "1e-3", LENGTH)[0] == 1e-3
    assert quantity("--x", "60m/min", VELOCITY)[0] == pytest.approx(1.0)
    assert resolution("--encoder", "2500 counts/rev", 0.01) == pytest.approx(4e-6)


@pytest.mark.slow
def test_a_screw_that_was_begun_here_is_simulated_and_diagnosed_as_it_was_told(tmp_path):
    out, log = tmp_path / "screw.yaml", tmp_path / "screw.parquet"
    run(
        out, "--driver=sim", "--axis=z", "--encoder=10000/turn", "--screw-pitch=5mm",
        "--mass=20kg", "--rotor-inertia=0.4kg*cm^2", "--force-constant=0.1N*m/A",
        "--amplifier=1A/V", "--travel=0..400mm", "--max-velocity=200mm/s",
    )  # fmt: skip
    app = make_app()
    for words in (["check", out], ["simulate", out, "--log", log]):
        assert CliRunner().invoke(app, [str(word) for word in words]).exit_code == 0
    result = CliRunner().invoke(app, ["diagnose", str(log), "--json"])
    (axis,) = json.loads(result.stdout)["axes"].values()
    assert axis["verdict"] == "complete"
    assert axis["parameters"]["inertia"]["value"] == pytest.approx(0.662, rel=1e-3)
