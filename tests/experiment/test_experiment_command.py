"""`motorctl experiment`: nothing moves; what to run next is told and written down."""

import json

import pytest
import yaml
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.close_loop.motion import Motions, machine_on
from motorctl.config import load
from motorctl.config.shipped import locate
from motorctl.errors import ConfigError, UsageError
from motorctl.loop.simulation import simulate
from motorctl.motion import load_program_file


def asked(*words):
    result = CliRunner().invoke(make_app(), ["experiment", *map(str, words)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result


def test_without_a_recording_the_motion_to_begin_with_is_written_as_programs(tmp_path):
    result = asked("published_gantry", "--out", tmp_path)
    assert "next: moves at random" in result.stdout
    for axis in "xy":
        program = load_program_file(tmp_path / f"experiment_{axis}.yaml", ("x", "y"))
        assert program.axes == (axis,)
        assert program.trajectories()[axis].duration_s > 1.0


def test_an_envelope_beyond_the_limits_is_one_message_with_key_and_limits(tmp_path):
    document = yaml.safe_load(locate("published_gantry").read_text())
    document["axes"]["x"]["experiments"] = {"travel_m": [-5.0, 5.0]}
    config = tmp_path / "beyond.yaml"
    config.write_text(yaml.safe_dump(document))
    with pytest.raises(ConfigError) as refused:
        asked(config)
    told = str(refused.value)
    assert told.count("experiments.travel_m") == 1
    assert "should be within limits.travel_m" in told


def test_an_axis_that_is_not_there_is_refused_with_those_that_are():
    with pytest.raises(UsageError, match="no axis 'z'; it has: x, y"):
        asked("published_gantry", "--axis", "z")


@pytest.mark.slow
def test_after_a_recording_candidates_are_weighed_and_the_best_is_drawn(tmp_path):
    machine = machine_on(load("small_stage"), "rich", Motions(rich_s=3.0))
    log = tmp_path / "rich.parquet"
    simulate(machine, log)
    document = json.loads(
        asked("small_stage", "--recording", log, "--out", tmp_path / "next", "--json").stdout
    )
    told = document["axes"]["x"]
    rates = [candidate["settled_per_s"] for candidate in told["candidates"]]
    assert len(rates) > 20
    assert rates == sorted(rates, reverse=True)
    assert not document["settled"]
    assert told["questions"]
    assert document["chosen"]["settles"][0].startswith("x: ")
    assert {path.rpartition(".")[2] for path in document["files"]} == {"yaml", "png"}
