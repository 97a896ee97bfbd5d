"""`motorctl learn --socket`: on the machine that a daemon runs, and dropped with its model."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from daemon_rig import Daemon, bench_config, wait_until
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.config import load
from motorctl.errors import UsageError

pytestmark = [pytest.mark.wall_clock(lanes=3), pytest.mark.slow]


def config() -> dict[str, Any]:
    document: dict[str, Any] = yaml.safe_load(bench_config("shuttle", without_realtime="wait"))
    document["programs"]["shuttle"]["cycles"] = 3
    document["axes"]["x"]["model"]["inertia"]["bounds"] = [0.12, 0.3]
    document["axes"]["x"]["learning"] = {"file": "learned.json"}
    return document


def test_it_learns_on_the_machine_and_another_model_drops_it_until_the_first_is_back(
    tmp_path: Path,
) -> None:
    with Daemon(tmp_path, yaml.safe_dump(config())) as daemon:
        copy = tmp_path / "copy" / daemon.config.name
        copy.parent.mkdir()
        copy.write_text(daemon.config.read_text())
        refused = CliRunner().invoke(
            make_app(), ["learn", "x", "--config", str(copy), *daemon.at, "--yes"]
        )
        assert isinstance(refused.exception, UsageError)
        assert f"the daemon reads {tmp_path}/learned.json" in str(refused.exception)
        assert daemon.state("x") == "off"
        assert [path.name for path in copy.parent.iterdir()] == [copy.name]

        words = ("learn", "x", "--config", daemon.config, *daemon.at, "--yes", "--json")
        arguments = [*map(str, words), "--repetitions", "2"]
        told = CliRunner().invoke(make_app(), arguments)
        assert told.exit_code == 0, told.output
        document = json.loads(told.stdout)
        errors = [trial["rms_m"] for trial in document["trials"]]
        assert document["trials"][0]["learned_rms_v"] == 0.0
        assert errors[1] < 0.7 * errors[0]
        assert (tmp_path / "learned.json").is_file()
        assert daemon.state("x") == "idle"

        other = config()
        other["axes"]["x"]["gains"]["ks_v_s_m"] = 11
        path = tmp_path / "other.yaml"
        path.write_text(yaml.safe_dump(other))
        daemon.ask("apply", config=dict(load(path).resolved), source=str(path))
        answer = daemon.ask("program", axis="x", name="shuttle")
        assert "learned" not in answer
        assert "with another model" in answer["notes"][0]
        daemon.ask("stop", axis="x")
        wait_until(lambda: daemon.state("x") == "off")
        daemon.ask("revert")
        daemon.ask_when_it_stands("start", "x", hold=True)
        answer = daemon.ask("program", axis="x", name="shuttle")
        assert answer["learned"] == ["x"]
        assert "notes" not in answer
