"""A long log is diagnosed by the stretches that tell most, in bounded memory, and says which."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from fit_plant import C1, X_THETA
from fleet_bench import looked_at
from fleet_logs import plant_log
from rich.console import Console

import motorctl
from motorctl.api.recordings import open_for_diagnosis
from motorctl.errors import DataError
from motorctl.fleet import job
from motorctl.fleet.findings import Refusal
from motorctl.identify.diagnose.read_stretches import CLEAREST, MOST_LEFT, NOTHING_CLEAR
from motorctl.identify.diagnose.report.terminal import print_diagnosis
from motorctl.identify.diagnose.result import RecordingDiagnosis
from motorctl.log.columns import METADATA_KEY
from motorctl.long_logs import diagnosis, long_log
from motorctl.long_logs.clearest import Clearest, clearest_of
from motorctl.long_logs.diagnosis import read_to_evaluate
from motorctl.long_logs.long_log import LONG_ROWS

GROUP = 5_000
MOST = 20_000
RATE_HZ = 5000.0
PLAY_S = 6.0


@pytest.fixture(scope="module")
def moving(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("moving") / "log.parquet"
    return plant_log(out, theta=X_THETA[:4], duration_s=PLAY_S)


def long_of(
    moving: Path, out: Path, awake: str, axes: str = "x", first: int = 0, **told: object
) -> Path:
    """Write a log of many row groups.

    Each letter of `awake` is one play of some seconds: the axis that moves then; `-` of none, `*`
    of all. Its ticks begin at that of play number `first`.
    """
    table = pq.read_table(moving)
    n = len(table)
    ticks = np.arange(n * len(awake)) + n * first
    columns = {"tick": ticks, "time_s": ticks / RATE_HZ}
    for axis in axes:
        rows = np.concatenate(
            [np.arange(n) if letter in (axis, "*") else np.zeros(n, np.int64) for letter in awake]
        )
        for name in table.schema.names:
            if name.startswith("x."):
                columns[axis + name[1:]] = table.column(name).to_numpy()[rows]
    document = json.loads(table.schema.metadata[METADATA_KEY]) | told
    written = pa.table(columns).replace_schema_metadata({METADATA_KEY: json.dumps(document)})
    pq.write_table(written, out, row_group_size=GROUP)
    return out


@pytest.fixture(scope="module")
def few_rows() -> Iterator[None]:
    """Take ten seconds for a long log, of which four are read."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(long_log, "LONG_ROWS", 50_000)
        patch.setattr(diagnosis, "MOST_ROWS", MOST)
        yield


def chosen(*paths: Path, axes: str = "x") -> dict[str, Clearest | None]:
    _, log = open_for_diagnosis(paths)
    assert log is not None
    return clearest_of(log, dict.fromkeys(axes, C1), MOST)


def stretches(found: Clearest | None) -> list[tuple[float, float]]:
    assert found is not None
    return [(each.begin_s, each.end_s) for each in found.read.stretches]


@pytest.mark.usefixtures("few_rows")
def test_of_each_axis_those_rows_are_chosen_in_which_it_moves(moving: Path, tmp_path: Path) -> None:
    log = long_of(moving, tmp_path / "log.parquet", "-x--y-", "xy")
    found = chosen(log, axes="xy")
    for axis, begin_s in (("x", PLAY_S), ("y", 4 * PLAY_S)):
        told = found[axis]
        assert told is not None
        assert 0 < told.read.rows <= MOST
        assert told.read.rows_of_log == 6 * PLAY_S * RATE_HZ
        for begin, end in stretches(told):
            assert begin_s <= begin < end <= begin_s + PLAY_S


@pytest.mark.usefixtures("few_rows")
def test_those_whose_motion_tells_most_are_chosen(moving: Path, tmp_path: Path) -> None:
    weak = pq.read_table(moving)
    for name in weak.schema.names:
        if name.startswith("x."):
            place = weak.schema.get_field_index(name)
            weak = weak.set_column(place, name, pa.array(0.03 * weak.column(name).to_numpy()))
    both = pa.concat_tables([weak, pq.read_table(moving), weak])
    ticks = np.arange(len(both))
    for name, values in (("tick", ticks), ("time_s", ticks / RATE_HZ)):
        both = both.set_column(both.schema.get_field_index(name), name, pa.array(values))
    log = tmp_path / "log.parquet"
    pq.write_table(both, log, row_group_size=GROUP)
    told = chosen(log)["x"]
    assert told is not None
    clear = [each for each in told.read.stretches if each.why == CLEAREST]
    assert clear
    for each in clear:
        assert each.begin_s < 2 * PLAY_S
        assert each.end_s > PLAY_S


def with_command(log: Path, command_v: Callable[[np.ndarray], np.ndarray]) -> Path:
    table = pq.read_table(log)
    command = command_v(table.column("x.command_v").to_numpy())
    at = table.schema.get_field_index("x.command_v")
    pq.write_table(
        table.set_column(at, "x.command_v", pa.array(command)), log, row_group_size=GROUP
    )
    return log


def broken_from(log: Path, begin_s: float, end_s: float = np.inf, force_v: float = 1.0) -> Path:
    """Let a force that no model of the log has act on x in a part of it; its loop withstands it."""
    table = pq.read_table(log)
    time_s = table.column("time_s").to_numpy()
    wave = force_v * np.sin(2.0 * np.pi * table.column("x.position_m").to_numpy() / 0.04)
    acts = (time_s >= begin_s) & (time_s < end_s)
    return with_command(log, lambda command: command + np.where(acts, wave, 0.0))


@pytest.mark.usefixtures("few_rows")
def test_where_the_declared_model_leaves_most_is_read_and_says_so(
    moving: Path, tmp_path: Path
) -> None:
    log = broken_from(long_of(moving, tmp_path / "log.parquet", "xxxxx"), 18.0, 19.0)
    told = chosen(log)["x"]
    assert told is not None
    (worst,) = (each for each in told.read.stretches if each.why == MOST_LEFT)
    assert (worst.begin_s, worst.rows) == (18.0, GROUP)
    others = [each for each in told.read.stretches if each.why == CLEAREST]
    assert others
    assert worst.left_rms is not None
    assert all(each.left_rms is not None and each.left_rms < worst.left_rms for each in others)
    assert "1 in which the declared model leaves most" in told.read.sentence
    assert told.read.unread is None


@pytest.mark.usefixtures("few_rows")
def test_what_tells_alike_is_read_from_all_of_its_time(moving: Path, tmp_path: Path) -> None:
    log = long_of(moving, tmp_path / "log.parquet", "xxxxxxxxxx")
    _, long = open_for_diagnosis(log)
    assert long is not None
    told = clearest_of(long, {"x": C1}, MOST, by_motion_alone=True)["x"]
    begins = [begin for begin, _ in stretches(told)]
    assert len(begins) == MOST // GROUP
    assert np.histogram(begins, 3, (0.0, 10 * PLAY_S))[0].min() >= 1


@pytest.mark.usefixtures("few_rows")
def test_errors_are_measured_on_what_motion_alone_tells_of(moving: Path, tmp_path: Path) -> None:
    sound = long_of(moving, tmp_path / "sound.parquet", "xxxxx")
    broken = broken_from(long_of(moving, tmp_path / "broken.parquet", "xxxxx"), 18.0, 19.0)
    read = []
    for log in (sound, broken):
        _, long = open_for_diagnosis(log)
        assert long is not None
        read.append(read_to_evaluate(long, {"x": C1})[0].time_s)
    assert 18.0 not in read[0]
    assert 18.0 not in read[1]


@pytest.mark.usefixtures("few_rows")
def test_much_that_is_left_where_nothing_was_read_is_told(moving: Path, tmp_path: Path) -> None:
    log = broken_from(long_of(moving, tmp_path / "log.parquet", "xxxxx"), 18.0, 19.0)
    _, long = open_for_diagnosis(log)
    assert long is not None
    told = clearest_of(long, {"x": C1}, MOST, by_motion_alone=True)["x"]
    assert told is not None
    assert told.read.unread is not None
    assert "5000 rows" in told.read.unread
    assert "from 18.0 s to 19.0 s" in told.read.unread
    assert told.notes == (told.read.unread,)


@pytest.mark.usefixtures("few_rows")
def test_a_log_that_begins_at_rest_is_scanned_in_the_band_of_its_motion(
    moving: Path, tmp_path: Path
) -> None:
    told = []
    for awake in ("xx", "-xx"):
        path = long_of(moving, tmp_path / f"{awake}.parquet", awake)
        table = pq.read_table(path)
        place, time_s = table.column("x.position_m").to_numpy(), table.column("time_s").to_numpy()
        shaken = 20e-6 * np.sin(2.0 * np.pi * 30.0 * time_s)  # by what runs beside it
        stands = np.repeat([letter == "-" for letter in awake], round(PLAY_S * RATE_HZ))
        at = table.schema.get_field_index("x.position_m")
        shaken_place = pa.array(np.where(stands, place + shaken, place))
        pq.write_table(
            table.set_column(at, "x.position_m", shaken_place), path, row_group_size=GROUP
        )
        _, log = open_for_diagnosis(path)
        assert log is not None
        of_groups = [found["x"] for _, _, found in log.scanned(["x"], lambda _: {"x": C1})]
        told.append([each.products.rows for each in of_groups[-12:] if each is not None])
    assert told[0] == told[1]


@pytest.mark.usefixtures("few_rows")
def test_a_footer_that_does_not_tell_times_is_no_reason_to_refuse_a_log(
    moving: Path, tmp_path: Path
) -> None:
    log = long_of(moving, tmp_path / "log.parquet", "xxx")
    table = pq.read_table(log)
    pq.write_table(table, log, row_group_size=GROUP, write_statistics=False)
    read, long = open_for_diagnosis(log)
    assert long is None
    assert len(read.time_s) == len(table)


@pytest.mark.usefixtures("few_rows")
def test_a_log_of_one_row_group_is_read_as_a_whole_whatever_its_footer(
    moving: Path, tmp_path: Path
) -> None:
    log = long_of(moving, tmp_path / "log.parquet", "xxx")
    pq.write_table(pq.read_table(log), log, row_group_size=1 << 20, write_statistics=False)
    assert open_for_diagnosis(log)[1] is None


@pytest.mark.usefixtures("few_rows")
@pytest.mark.parametrize(("size_v", "why"), [(8.0, "limits.max_voltage_v"), (0.5, "explains")])
def test_motion_that_tells_nothing_is_refused_for_the_usual_reason(
    moving: Path, tmp_path: Path, size_v: float, why: str
) -> None:
    log = long_of(moving, tmp_path / "log.parquet", "xxx")
    rng = np.random.default_rng(2)
    log = with_command(log, lambda command: size_v * rng.standard_normal(len(command)))
    with pytest.raises(DataError, match=why) as refused:
        motorctl.diagnose(log, model="C1")
    assert "no motion" not in str(refused.value)


@pytest.mark.usefixtures("few_rows")
def test_rows_that_tell_nothing_are_not_said_to_tell_most(moving: Path, tmp_path: Path) -> None:
    log = long_of(moving, tmp_path / "log.parquet", "-xx")
    rng = np.random.default_rng(2)
    told = chosen(with_command(log, lambda command: rng.standard_normal(len(command))))["x"]
    assert told is not None
    assert 0 < told.read.rows <= MOST
    assert told.read.candidates == 0
    assert all(begin >= PLAY_S for begin, _ in stretches(told))
    assert {each.why for each in told.read.stretches} == {NOTHING_CLEAR}
    assert "no stretch of it is one with enough motion" in told.read.sentence
    _, long = open_for_diagnosis(log)
    assert long is not None
    with pytest.raises(DataError, match="no motion in its 90000 rows tells a parameter"):
        read_to_evaluate(long, {"x": C1})


@pytest.mark.usefixtures("few_rows")
def test_a_run_in_parts_gives_the_stretches_and_rows_of_the_log_that_was_never_cut(
    moving: Path, tmp_path: Path
) -> None:
    whole = long_of(moving, tmp_path / "whole.parquet", "-x--x-")
    parts = [
        long_of(moving, tmp_path / f"part{k}.parquet", "-x-", first=3 * k, run="r", part=k)
        for k in range(2)
    ]
    (_, one), (_, run) = open_for_diagnosis(whole), open_for_diagnosis(parts)
    assert one is not None
    assert run is not None
    of_one, of_run = chosen(whole)["x"], chosen(*parts)["x"]
    assert stretches(of_one) == stretches(of_run)
    assert of_one is not None
    assert of_run is not None
    read, read_of_run = one.read(of_one.groups), run.read(of_run.groups)
    assert np.array_equal(read.time_s, read_of_run.time_s)
    assert np.array_equal(read.axes["x"].position, read_of_run.axes["x"].position)
    assert not [note for note in (*read.notes, *read_of_run.notes) if "missing" in note]


def test_what_is_shorter_or_foreign_is_read_as_a_whole(moving: Path, tmp_path: Path) -> None:
    read, log = open_for_diagnosis(moving)
    assert log is None
    assert len(read.time_s) == PLAY_S * RATE_HZ < LONG_ROWS
    bare = tmp_path / "bare.parquet"
    pq.write_table(pq.read_table(moving).replace_schema_metadata(None), bare, row_group_size=GROUP)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(long_log, "LONG_ROWS", 1000)
        assert open_for_diagnosis(bare)[1] is None
        assert open_for_diagnosis(long_of(moving, tmp_path / "log.parquet", "x"))[1] is not None


@pytest.mark.usefixtures("few_rows")
def test_a_long_log_without_motion_says_so(moving: Path, tmp_path: Path) -> None:
    log = long_of(moving, tmp_path / "log.parquet", "----")
    with pytest.raises(DataError, match=r"log\.parquet: axis x: no motion in its 120000 rows"):
        motorctl.diagnose(log)


@pytest.mark.usefixtures("few_rows")
def test_a_damaged_row_group_of_a_long_log_is_told(moving: Path, tmp_path: Path) -> None:
    log = long_of(moving, tmp_path / "log.parquet", "xxxx")
    metadata = pq.ParquetFile(log).metadata
    group = metadata.row_group(9)
    place = next(
        group.column(k).data_page_offset
        for k in range(group.num_columns)
        if group.column(k).path_in_schema == "x.position_m"
    )
    content = bytearray(log.read_bytes())
    content[place : place + 64] = b"\xff" * 64
    log.write_bytes(content)
    with pytest.raises(DataError, match=r"x\.position_m.*row group 10 of 24"):
        motorctl.diagnose(log)


def test_a_last_row_group_of_a_few_rows_spoils_no_log(
    moving: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = long_of(moving, tmp_path / "log.parquet", "xx")
    table = pq.read_table(log).slice(0, 10 * GROUP + 3)
    pq.write_table(table, log, row_group_size=GROUP)
    monkeypatch.setattr(job, "MOST_ROWS", 1 << 15)
    rows = looked_at(log)
    assert not isinstance(rows, Refusal), rows
    assert [row for row in rows if row.get("name") == "inertia"]


@pytest.fixture(scope="module")
def shares() -> list[float]:
    return []


@pytest.fixture(scope="module")
def diagnosed(
    moving: Path, few_rows: None, shares: list[float], tmp_path_factory: pytest.TempPathFactory
) -> RecordingDiagnosis:
    log = long_of(moving, tmp_path_factory.mktemp("long") / "log.parquet", "-x--y-", "xy")
    return motorctl.diagnose(
        log, model="C1", progress=lambda _, share: shares.append(share), evaluate=log
    )


@pytest.mark.slow
def test_each_axis_is_diagnosed_on_its_own_stretches(diagnosed: RecordingDiagnosis) -> None:
    assert not diagnosed.refused
    for found in diagnosed.axes.values():
        assert found.read is not None
        assert len(found.data.time_s) == found.read.rows <= MOST
        parameters = dict(zip(found.declared.parameter_names, found.declared_theta, strict=True))
        assert parameters["inertia"] == pytest.approx(X_THETA[0], rel=0.02)
    assert any("errors were measured on" in note for note in diagnosed.notes)


@pytest.mark.slow
@pytest.mark.usefixtures("few_rows")
def test_a_log_in_which_something_breaks_is_not_called_complete(
    moving: Path, tmp_path: Path
) -> None:
    log = broken_from(long_of(moving, tmp_path / "log.parquet", "x" * 10), 6 * PLAY_S, force_v=0.3)
    found = motorctl.diagnose(log, model="C1").axes["x"]
    assert found.read is not None
    assert any(each.begin_s >= 6 * PLAY_S for each in found.read.stretches)
    assert found.verdict in ("effect", "unknown_structure")


@pytest.mark.slow
def test_its_progress_moves_one_way(diagnosed: RecordingDiagnosis, shares: list[float]) -> None:
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len({round(share, 3) for share in shares}) > 10


@pytest.mark.slow
def test_what_was_read_stands_in_json_text_notebook_and_page(
    diagnosed: RecordingDiagnosis, tmp_path: Path
) -> None:
    document = json.loads(json.dumps(diagnosed.to_dict()))
    console = Console(width=120, record=True, file=io.StringIO())
    print_diagnosis(console, diagnosed, {})
    text = console.export_text()
    page = diagnosed.write_report(tmp_path)[0].read_text()
    for name, axis in diagnosed.axes.items():
        assert axis.read is not None
        told = document["axes"][name]["read"]
        assert told["rows"] == axis.read.rows
        assert len(told["stretches"]) == len(axis.read.stretches)
        for stretch in told["stretches"]:
            assert 0.0 < stretch["vagueness"] < 0.02
            assert stretch["vaguest"] in C1.parameter_names
            begin = f"{stretch['begin_s']:.1f} s"
            assert all(begin in words for words in (text, page, diagnosed._repr_html_()))
        assert axis.read.sentence in page


@pytest.mark.slow
@pytest.mark.usefixtures("few_rows")
def test_a_long_log_refines_a_configuration(moving: Path, tmp_path: Path) -> None:
    log = long_of(moving, tmp_path / "log.parquet", "-xx-")
    refined = motorctl.refine(log, "published_gantry", tmp_path / "refined.yaml")
    read = refined.diagnosis.axes["x"].read
    assert read is not None
    assert read.rows <= MOST
    assert (tmp_path / "refined.yaml").is_file()
