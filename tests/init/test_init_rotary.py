"""A rotary axis from `init` on: radians, N m and kg m^2 wherever a person reads of it."""

from __future__ import annotations

import json
import math
import re

import pytest
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.config import load
from motorctl.errors import ConfigError, MotorctlError, UsageError

JOINT = [
    "--driver=sim", "--axis=c", "--kind=rotary", "--encoder=1000000/turn", "--inertia=0.02kg*m^2",
    "--torque-constant=0.8N*m/V", "--travel=-90..90deg", "--max-velocity=40rpm",
]  # fmt: skip
METRES = re.compile(r"(?:\d ?|[Vs2]/)(?:[mµun]?m)(?![A-Za-z0-9_*^])|newton|\bkg\b(?!\*m)")
"""Metres behind a number, in whatever unit, or kilograms."""


def run(*words):
    result = CliRunner().invoke(make_app(), [str(word) for word in words])
    if isinstance(result.exception, MotorctlError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.fixture(scope="module")
def joint(tmp_path_factory):
    out = tmp_path_factory.mktemp("rotary") / "joint.yaml"
    run("init", out, *JOINT)
    return out


def test_a_joint_is_told_by_inertia_torque_constant_and_counts_a_turn(joint):
    axis = load(joint).axes["c"]
    assert (axis.kind, axis.units.position) == ("rotary", "rad")
    assert axis.encoder.resolution_m == pytest.approx(2e-6 * math.pi, rel=1e-9)
    assert axis.limits.travel_m == pytest.approx((-math.pi / 2, math.pi / 2), rel=1e-9)
    assert axis.limits.max_velocity_m_s == pytest.approx(40.0 * 2.0 * math.pi / 60.0)
    assert axis.estimates[0].initial == pytest.approx(0.025)


@pytest.mark.parametrize(
    ("inertia", "torque", "expected"),
    [
        ("3e-5kg*m^2", "0.2N*m/V", 1.5e-4),
        ("0.3kg*cm^2", "3N*m/V", 1e-5),
        ("5e-7kg*m^2", "0.02N*m/V", 2.5e-5),
    ],
    ids=["bare servo", "strong amplifier", "micro motor"],
)  # fmt: skip
@pytest.mark.parametrize("speed", ["40rpm", "3000rpm"])
def test_the_inertia_of_any_usual_motor_can_be_told(tmp_path, inertia, torque, expected, speed):
    out = tmp_path / "motor.yaml"
    others = [word for word in JOINT if not word.startswith(("--inertia", "--torque", "--max-v"))]
    run(
        "init", out, *others, f"--inertia={inertia}", f"--torque-constant={torque}",
        f"--max-velocity={speed}",
    )  # fmt: skip
    estimate = load(out).axes["c"].estimates[0]
    assert estimate.initial == pytest.approx(expected)
    assert estimate.lower < expected < estimate.upper


def test_the_file_tells_a_joint_in_radians(joint):
    text = joint.read_text()
    assert "V*s^2/rad: 0.02 kg*m^2 / 0.8 N*m/V" in text
    assert not METRES.findall(text), METRES.findall(text)


@pytest.mark.parametrize("everything", [(), ("--all",)])
def test_check_tells_a_joint_in_radians(joint, everything, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    told = run("check", joint, *everything)
    assert "4.18879 rad/s" in told
    assert "V*s^2/rad" in told or not everything
    assert not METRES.findall(told), METRES.findall(told)


def test_json_tells_kind_and_unit_of_an_axis_once(joint):
    axis = json.loads(run("check", joint, "--json"))["axes"]["c"]
    assert (axis["kind"], axis["position_unit"]) == ("rotary", "rad")
    assert axis["parameters"]["inertia"]["unit"] == "V*s^2/rad"
    shipped = json.loads(run("check", "published_gantry", "--json"))["axes"]["x"]
    assert (shipped["kind"], shipped["position_unit"]) == ("linear", "m")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("max_velocity_m_s: 4.188790205 ", "max_velocity_m_s: 400 ", r"from 400 rad/s takes"),
        ("target_m: 0.9375", "target_m: 2.5", r"position 2.5 rad at .* s exceeds .* 1.5708 rad"),
        ("start_m: -0.9425", "start_m: -0.9", r"moves end at -0\.9425 rad but start"),
        ("minimum_m: ", "minimum_m: 9", r"travel of 3\.14159 rad it cannot trip .* rad away"),
        ("counter_bits: 32", "counter_bits: 8", r"at 4\.18879 rad/s and 5000 Hz"),
        ("{initial: 0.025, bounds: [", "{initial: 0.9, bounds: [", r"0\.05 V\*s\^2/rad"),
        ("{initial: 0.025, bounds: [0", "{initial: 0.025, bounds: [-0", r"1000 V\*s\^2/rad"),
    ],
)  # fmt: skip
def test_problems_of_a_joint_are_told_in_radians(joint, tmp_path, old, new, message):
    text = joint.read_text()
    assert old in text
    changed = tmp_path / "changed.yaml"
    changed.write_text(text.replace(old, new, 1))
    with pytest.raises(ConfigError) as told:
        load(changed)
    problems = "\n".join(problem.message for problem in told.value.problems)
    assert re.search(message, problems), problems
    assert not METRES.findall(problems), problems


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--mass=3kg",), "axis c is rotary by --kind or .*, and --mass would be"),
        (("--screw-pitch=5mm",), "--screw-pitch would be of the other kind"),
        (("--kind=linear",), "--inertia, --torque-constant would be of the other kind"),
        (("--kind=round",), "--kind round: should be linear or rotary"),
        (("--encoder=0.5um",), "should be counts a turn, or the angle of a count"),
        (("--travel=0..300mm",), "should be an angle, as in 90deg; units: rad, deg"),
        (("--max-velocity=1m/s",), "should be an angular speed, as in 2rad/s or 60rpm"),
        (("--torque-constant=0.8N*m/A",), "--amplifier, amperes that the amplifier gives a volt"),
        (("--torque-constant=0.8N/V",), "should be a torque constant, as in 0.8N.m/V"),
        (("--inertia=0kg*m^2",), "should be above 0, as in"),
        (("--max-velocity=2000rad/s",), r"to stop from it takes .* rad at .* rad/s\^2, .* rad;"),
        (("--max-acceleration=1e5rad/s^2",), "should be at most .*rad/s"),
        (("--friction=9N*m",), r"--friction 9N\*m takes .* should be below 4N\*m"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_of_a_joint_names_option_and_unit(tmp_path, words, message):
    names = {word.partition("=")[0] for word in words}
    given = [word for word in JOINT if word.partition("=")[0] not in names]
    with pytest.raises(UsageError, match=message):
        run("init", tmp_path / "machine.yaml", *given, *words)
    assert list(tmp_path.iterdir()) == []


def test_a_beam_does_not_turn(joint, tmp_path):
    changed = tmp_path / "changed.yaml"
    dual = "    dual_drive: {channel: 1}\n"
    changed.write_text(joint.read_text().replace("    homing:", f"{dual}    homing:", 1))
    with pytest.raises(ConfigError, match="is of a linear axis: the two ends of a beam"):
        load(changed)


@pytest.mark.slow
def test_a_joint_is_simulated_diagnosed_and_refined_in_radians(joint, tmp_path):
    pitch = math.pi / 12.0  # twelve cogs in half a turn
    cogging = f"cogging: {{pitch_m: {pitch:.10g}, harmonics: [{{order: 1, amplitude_v: 0.3}}]}}"
    machine, log, better = (tmp_path / name for name in ("c.yaml", "c.parquet", "d.yaml"))
    machine.write_text(
        joint.read_text().replace("        inertia_v", f"        {cogging}\n        inertia_v", 1)
    )
    assert "µrad" in run("simulate", machine, "--log", log, "--duration", 6)
    report = tmp_path / "report"
    told = run("diagnose", log, "--out", report)
    assert not METRES.findall(told), METRES.findall(told)
    page = re.sub(r"base64,[^\"]+", "", (report / "diagnosis.html").read_text().split("<body")[1])
    assert not METRES.findall(page), METRES.findall(page)
    refined = json.loads(run("refine", log, "--config", machine, "--out", better, "--json"))
    assert refined["axes"]["c"]["effects_added"] == ["cogging"]
    assert re.search(r"pitch_m: 0\.26\d+ +# rad \+- ", better.read_text())
    found = load(better).axes["c"].model
    assert found.effects[-1].options.pitch_m == pytest.approx(pitch, rel=1e-3)
    again = tmp_path / "d.parquet"
    run("simulate", better, "--log", again, "--duration", 6)
    compared = json.loads(run("compare", log, again, "--json"))
    assert compared["axes"]["c"]["ratios_first_over"][0]["eF"] > 3.0
