"""`motorctl check` and `motorctl drivers` as a user meets them."""

import json
import re
import subprocess
import sys

import pytest
import typer
from config_bench import MACHINE, BenchDriver, machine, write
from tiers import few_of
from typer.testing import CliRunner

from motorctl.cli import check, drivers
from motorctl.config import config_schema, shipped_config
from motorctl.errors import ConfigError, UsageError


def run(*arguments):
    app = typer.Typer()
    check.register(app)
    drivers.register(app)
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_a_valid_configuration_is_shown_with_its_guarantees_and_budgets():
    result = run("check", "published_gantry", "--all")
    assert result.exit_code == 0
    text = " ".join(result.stdout.split())
    for shown in ("published-gantry", "theta6", "published_x", "Assumption 2", "substeps", "valid"):
        assert shown in text
    assert "axis y: ks 95 is below the sufficient condition" in text


def test_json_is_one_document_and_nothing_else():
    result = run("check", "small_stage", "--json")
    summary = json.loads(result.stdout)
    assert summary["valid"]
    assert summary["axes"]["x"]["controller"] == "C2"
    assert summary["resolved"]["axes"]["x"]["encoder"]["counter_bits"] == 16
    assert summary["drivers"]["stage"]["max_rate_hz"] >= summary["rate_hz"]


def test_the_controller_can_be_chosen_for_all_axes():
    summary = json.loads(run("check", "published_gantry", "--controller", "C1", "--json").stdout)
    assert [axis["controller"] for axis in summary["axes"].values()] == ["C1", "C1"]
    assert "em_cubic" not in summary["axes"]["x"]["parameters"]


def test_every_problem_is_in_the_error_and_in_the_json(tmp_path):
    path = write(tmp_path, machine(rate_hz=-1, axes__x__program="their"))
    result = run("check", path, "--json")
    assert isinstance(result.exception, ConfigError)
    assert result.exception.exit_status == 2
    document = json.loads(result.stdout)
    assert not document["valid"]
    assert [(p["line"], p["key"]) for p in document["problems"]] == [
        (p.line, p.key) for p in result.exception.problems
    ]
    assert {p["key"] for p in document["problems"]} == {"rate_hz", "axes.x.program"}
    plain = run("check", path)
    assert plain.stdout == ""
    assert str(plain.exception) == str(result.exception)


def test_the_times_in_force_of_a_machine_that_waits_for_its_computer_are_shown(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("COLUMNS", "220")
    shown = run("check", "published_gantry", "--all").stdout
    assert "computer frozen: never, its time waits, supervisor silent for 5 s" in shown
    shown = run("check", write(tmp_path, machine()), "--all").stdout
    assert "computer frozen for 0.1 s, supervisor silent for 0.5 s" in shown


def test_the_schema_needs_no_configuration():
    assert json.loads(run("check", "--schema").stdout) == config_schema()


def test_a_missing_configuration_is_a_usage_error():
    assert isinstance(run("check").exception, UsageError)


@pytest.mark.parametrize("command", ["check", "drivers"])
def test_help_has_an_example(command):
    result = run(command, "--help")
    assert result.exit_code == 0
    assert f"Example: motorctl {command}" in result.stdout


def test_installed_drivers_are_listed_with_their_versions():
    listed = json.loads(run("drivers", "--json").stdout)["drivers"]
    (sim,) = [driver for driver in listed if driver["name"] == "sim"]
    assert sim["loaded"]
    assert sim["supports_virtual_time"]
    assert sim["error"] is None
    assert sim["version"]
    assert "sim" in run("drivers").stdout


def test_a_driver_that_fails_to_load_is_listed_with_its_reason(tmp_path, monkeypatch):
    info = tmp_path / "brokenbus-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: brokenbus\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text("[motorctl.drivers]\nbroken = brokenbus:Driver\n")
    (tmp_path / "brokenbus.py").write_text("raise OSError('no bus here')\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    listed = {d["name"]: d for d in json.loads(run("drivers", "--json").stdout)["drivers"]}
    assert listed["sim"]["loaded"]
    assert not listed["broken"]["loaded"]
    assert "no bus here" in listed["broken"]["error"]


WITHOUT = "import sys; sys.modules['{0}'] = None; from motorctl.cli import main; main()"
"""The command line where a library is not installed."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bus", "module"),
    few_of([("can", "can"), ("canopen", "can"), ("serial", "serial"), ("modbus", "pymodbus")], 2),
)
def test_a_bus_without_its_library_is_one_line_that_says_how_to_install_it(bus, module):
    command = [sys.executable, "-c", WITHOUT.format(module), "check", f"{bus}_gantry"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert f"module '{module}" in done.stderr
    assert f"pip install 'motorctl[{bus}]'" in done.stderr


@pytest.mark.slow
def test_the_library_of_one_bus_is_not_missed_by_another():
    command = [sys.executable, "-c", WITHOUT.format("can"), "check", "serial_gantry"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("late", "shown"),
    [
        ({}, "hold 3 ticks"),
        ({"hold_ticks": 1, "predict": True}, "none predict 1 tick "),
        ({"hold_ticks": 0}, "none trip "),
    ],
)
def test_what_follows_where_no_sample_comes_is_shown_with_each_driver(
    tmp_path, monkeypatch, late, shown
):
    monkeypatch.setenv("COLUMNS", "110")
    result = run("check", write(tmp_path, machine(drivers__line__late=late)), "--all")
    assert shown in " ".join(result.stdout.split())


def test_how_late_a_command_acts_is_shown_with_each_driver(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "110")
    path = write(tmp_path, MACHINE)
    assert " none  " in run("check", path, "--all").stdout
    monkeypatch.setattr(BenchDriver, "exchange_delay_periods", 1.0)
    assert " 0.5 ms  " in run("check", path, "--all").stdout


def with_rates(loop_hz, own_hz):
    return machine(rate_hz=loop_hz, drivers__line__rate_hz=own_hz)


@pytest.mark.parametrize("own_hz", [333.333, 333.3333333, 1000 / 3])
def test_a_part_that_no_decimal_can_be_is_taken_as_the_whole_part_that_it_means(tmp_path, own_hz):
    summary = json.loads(run("check", write(tmp_path, with_rates(1000, own_hz)), "--json").stdout)
    assert summary["drivers"]["line"]["rate_hz"] == pytest.approx(1000 / 3, rel=1e-15)


def test_a_rate_that_is_no_part_is_refused_with_two_that_are_accepted(tmp_path):
    refused = run("check", write(tmp_path, with_rates(1000, 300)))
    assert isinstance(refused.exception, ConfigError)
    (problem,) = [p for p in refused.exception.problems if p.key == "drivers.line.rate_hz"]
    near = re.search("near: (.+) or (.+)$", problem.message).groups()
    assert near == ("250", "333.333")
    for own_hz in near:
        assert run("check", write(tmp_path, with_rates(1000, float(own_hz)))).exit_code == 0


def test_the_tables_of_a_machine_fit_a_terminal_of_110_columns(monkeypatch):
    monkeypatch.setenv("COLUMNS", "110")
    lines = run("check", "serial_gantry", "--all").stdout.splitlines()
    assert max(map(len, lines)) <= 110
    assert any(line.startswith(" gantry  serial ") and "predict 50 ticks" in line for line in lines)


def test_a_configuration_is_found_next_to_where_one_works(tmp_path):
    """In a process of its own: nothing may hang on this test's imports."""
    write(tmp_path, shipped_config("small_stage").read_text())
    program = "from motorctl.config import load; print(load('machine.yaml').name)"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "small-stage"
    assert done.stderr == ""


def test_the_bench_machine_shows_its_budget(tmp_path):
    summary = json.loads(run("check", write(tmp_path, MACHINE), "--json").stdout)
    line = summary["drivers"]["line"]
    assert line["max_rate_hz"] == pytest.approx(1e6 / 120)
    assert line["used"] == pytest.approx(0.24)
    assert line["arithmetic"] == "120 bits at 1000000 baud"
