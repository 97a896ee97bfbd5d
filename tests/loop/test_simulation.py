"""`motorctl simulate`: the same tick in virtual time, logged."""

from __future__ import annotations

import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner, Result

from motorctl.cli import make_app
from motorctl.config import load
from motorctl.errors import RunError, UsageError
from motorctl.identify.compare.measures import measure_recording
from motorctl.log import read_recording
from motorctl.log.info import describe
from motorctl.loop.simulation import simulate, with_seed
from motorctl.loop.virtual import VirtualMachine

CONFIG = "small_stage"


def invoke(*arguments: str) -> Result:
    return CliRunner().invoke(make_app(), list(arguments))


@pytest.fixture(scope="module")
def stage_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    log = tmp_path_factory.mktemp("stage") / "a.parquet"
    simulate(with_seed(load(CONFIG), 7), log, duration_s=4.0)
    return log


def test_the_same_config_and_seed_give_the_same_rows_to_the_byte(
    stage_log: Path, tmp_path: Path
) -> None:
    again = tmp_path / "b.parquet"
    simulate(with_seed(load(CONFIG), 7), again, duration_s=4.0)
    first, second = pq.read_table(stage_log), pq.read_table(again)
    assert first.num_rows == 20_000
    for name in first.column_names:
        assert first[name].to_numpy().tobytes() == second[name].to_numpy().tobytes(), name


def test_another_seed_gives_another_run(stage_log: Path, tmp_path: Path) -> None:
    other = tmp_path / "c.parquet"
    simulate(with_seed(load(CONFIG), 8), other, duration_s=4.0)

    column = next(n for n in pq.read_schema(other).names if n.endswith(".position_m"))
    assert not pq.read_table(stage_log)[column].equals(pq.read_table(other)[column])


def test_a_run_that_never_ticks_leaves_the_log_that_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(virtual: VirtualMachine) -> VirtualMachine:
        raise RunError("the driver cannot be opened")

    monkeypatch.setattr(VirtualMachine, "__enter__", broken)
    (tmp_path / "good.parquet").write_text("of an earlier run")
    with pytest.raises(RunError, match="cannot be opened"):
        simulate(load(CONFIG), tmp_path / "good.parquet", duration_s=1.0)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["of an earlier run"]


def test_a_virtual_log_has_every_tick(stage_log: Path) -> None:
    ticks = pq.read_table(stage_log)["tick"].to_numpy()
    assert (ticks == range(len(ticks))).all()


def test_an_axis_that_trips_ends_the_run_with_its_cause_and_a_complete_log(
    tmp_path: Path,
) -> None:
    config = tmp_path / "faulty.yaml"
    text = Path("configs/small_stage.yaml").read_text()
    fault = "faults: [{kind: encoder_lost, channel: 0, at_s: 0.5, duration_s: 1}]"
    assert "preset: small_stage" in text
    config.write_text(text.replace("preset: small_stage", f"preset: small_stage, {fault}"))
    log = tmp_path / "faulty.parquet"
    with pytest.raises(RunError, match=r"tripped \(encoder_lost\): .* at 0\.5\d+ s"):
        simulate(load(config), log, duration_s=4.0)
    assert pq.read_table(log).num_rows >= 2500


def test_simulate_prints_one_json_document_with_the_published_measures(tmp_path: Path) -> None:
    log = tmp_path / "d.parquet"
    result = invoke("simulate", CONFIG, "--log", str(log), "--duration", "5", "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert document["duration_s"] == 5.0
    measured = measure_recording(read_recording(log, gaps="keep"))
    assert document["axes"].keys() == measured.keys() == load(CONFIG).axes.keys()
    for name, axis in document["axes"].items():
        found = measured[name].measures
        assert (axis["eM"], axis["eF"]) == (found.eM_m, found.eF_m)
        assert (axis["L2[e]"], axis["uM"]) == (found.L2_m, found.uM_V)
        assert axis["units"] == {"eM": "m", "eF": "m", "L2[e]": "m", "uM": "V"}
        assert 0.0 < axis["L2[e]"] < axis["eM"]


def test_log_info_shows_the_turnaround_of_virtual_time_as_such(stage_log: Path) -> None:
    metadata = json.loads(pq.read_schema(stage_log).metadata[b"motorctl"])
    measured = metadata["virtual_time"]["turnaround"]
    assert measured["p50_s"] > 0.0
    info = describe(stage_log)
    assert info.metadata["timing"]["turnaround"] == measured
    assert any("virtual time" in note for note in info.notes)
    shown = invoke("log", "info", str(stage_log)).stdout
    assert f"turnaround: median {measured['p50_s'] * 1e6:.1f} µs" in shown
    assert "lateness: " not in shown
    assert "note: virtual time" in shown


def test_a_duration_of_nothing_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    log = tmp_path / "e.parquet"
    with pytest.raises(UsageError, match="duration"):
        simulate(load(CONFIG), log, duration_s=0.0)
    assert not list(tmp_path.iterdir())
