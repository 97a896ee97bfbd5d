"""A log that cannot be used is told with its file and the reason."""

from __future__ import annotations

import errno
import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import fsspec
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from fleet_bench import head_of, looked_at
from fsspec.implementations.memory import MemoryFileSystem

from motorctl.config import load
from motorctl.fleet.conflicts import conflicts_of
from motorctl.fleet.findings import Refusal
from motorctl.fleet.head import Declared, LogHead, damaged_id
from motorctl.fleet.look import look_at_head, look_at_window, scan
from motorctl.log.columns import METADATA_KEY
from motorctl.long_logs.windows import whole_log

BEGAN = datetime(2026, 3, 1, 6, tzinfo=UTC)


def reason_of(log: Path, declared: Declared | None = None) -> str:
    found = looked_at(log, declared)
    assert isinstance(found, Refusal), found
    assert log.name in found.reason
    return found.reason


def test_a_truncated_log_is_told(good_log: Path, tmp_path: Path) -> None:
    log = tmp_path / "truncated.parquet"
    log.write_bytes(good_log.read_bytes()[:-5000])
    assert "its end is missing; copy it anew" in reason_of(log)


def test_a_log_damaged_in_its_middle_is_told(good_log: Path, tmp_path: Path) -> None:
    log, data = tmp_path / "damaged.parquet", bytearray(good_log.read_bytes())
    data[len(data) // 3 : len(data) // 3 + 20000] = bytes(20000)
    log.write_bytes(data)
    assert "damaged Parquet file" in reason_of(log)


@pytest.mark.parametrize("content", [b"", b"time_s;x\n0;1\n", b"PAR1"])
def test_what_is_no_log_is_told(content: bytes, tmp_path: Path) -> None:
    log = tmp_path / "other.parquet"
    log.write_bytes(content)
    reason_of(log)


def test_a_log_that_is_gone_is_told(tmp_path: Path) -> None:
    assert "no such file" in reason_of(tmp_path / "gone.parquet")


def test_a_folder_that_is_named_as_a_log_is_told_and_not_for_ever(tmp_path: Path) -> None:
    found = looked_at(tmp_path)
    assert isinstance(found, Refusal)
    assert found.reason.startswith(f"{tmp_path}: ")
    assert not found.lasting


def test_a_disk_that_fails_while_a_log_is_opened_is_tried_again(
    good_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(pq, "ParquetFile", fail)
    with pytest.raises(OSError, match="Input/output error"):
        look_at_head(str(good_log), Declared("C1"))


def test_a_recording_that_names_no_machine_is_told(tmp_path: Path) -> None:
    log = tmp_path / "foreign.parquet"
    pq.write_table(pa.table({"time_s": [0.0], "x.position_m": [0.0], "x.command_v": [0.0]}), log)
    assert "does not say which machine it is of" in reason_of(log)


@pytest.mark.parametrize("row_group_rows", [30000, 1 << 20])
def test_rows_of_two_recordings_in_one_log_are_told(
    good_log: Path, tmp_path: Path, row_group_rows: int
) -> None:
    table = pq.read_table(good_log)
    log = tmp_path / "mixed.parquet"
    pq.write_table(pa.concat_tables([table, table]), log, row_group_size=row_group_rows)
    told = reason_of(log)
    assert "more than one recording" in told or "tick" in told or "backwards" in told


def test_a_log_with_the_label_of_another_machine_is_told(good_log: Path, tmp_path: Path) -> None:
    table = pq.read_table(good_log)
    metadata = json.loads(table.schema.metadata[METADATA_KEY])
    config = load("small_stage").resolved
    log = tmp_path / "mislabelled.parquet"
    told = {METADATA_KEY: json.dumps(metadata | {"machine": "small-stage", "config": config})}
    pq.write_table(table.replace_schema_metadata(told), log)
    told_reason = reason_of(log)
    assert "is not a recording of the machine" in told_reason
    assert "limits.travel_m" in told_reason


def test_a_log_of_another_machine_than_the_configuration_is_told(good_log: Path) -> None:
    stage = load("small_stage")
    assert "small_stage" in reason_of(good_log, Declared("small_stage", stage.resolved))


@pytest.fixture
def head(good_log: Path) -> LogHead:
    return head_of(good_log)


def heads_like(head: LogHead, *changes: dict[str, Any]) -> list[LogHead]:
    """Return heads of logs of ten minutes each, changed in some things."""
    lasting = timedelta(minutes=10)
    return [
        replace(head, source=f"{k}.parquet", **change, end_utc=change["begin_utc"] + lasting)
        for k, change in enumerate(changes)
    ]


def test_a_clock_that_was_set_back_is_told(head: LogHead) -> None:
    after = [timedelta(), timedelta(hours=1), timedelta(minutes=-30)]
    parts = heads_like(
        head, *({"begin_utc": BEGAN + a, "run": "r", "part": k} for k, a in enumerate(after))
    )
    (told,) = conflicts_of(parts)
    assert told.source == "2.parquet"
    assert "the clock was set back" in told.reason
    assert not told.lasting


def test_a_log_from_the_future_is_told(head: LogHead) -> None:
    (told,) = conflicts_of([head], now=head.begin_utc - timedelta(days=1))
    assert "still to come" in told.reason


def test_a_log_of_a_clock_that_was_never_set_is_told(head: LogHead) -> None:
    (told,) = conflicts_of([replace(head, begin_utc=datetime(1970, 1, 1, 0, 5, tzinfo=UTC))])
    assert "its clock was never set" in told.reason
    assert not told.lasting


def test_two_machines_with_one_name_are_told_by_logs_of_the_same_time(head: LogHead) -> None:
    logs = heads_like(
        head,
        {"machine": "stage-1", "host": "computer-1", "begin_utc": BEGAN},
        {"machine": "stage-1", "host": "computer-2", "begin_utc": BEGAN + timedelta(minutes=5)},
        {"machine": "stage-2", "host": "computer-2", "begin_utc": BEGAN},
    )
    told = conflicts_of(logs)
    assert {refusal.source for refusal in told} == {"0.parquet", "1.parquet"}
    assert all("two machines have one name" in refusal.reason for refusal in told)


def test_two_machines_with_one_name_are_told_by_computers_in_turns(head: LogHead) -> None:
    logs = heads_like(
        head,
        *({"host": f"computer-{k % 2}", "begin_utc": BEGAN + timedelta(hours=k)} for k in range(4)),
    )
    assert len(conflicts_of(logs)) == 4
    weeks_before = heads_like(head, {"host": "computer-0", "begin_utc": BEGAN - timedelta(days=30)})
    weeks_before = [replace(weeks_before[0], source="before.parquet")]
    assert len(conflicts_of(weeks_before + logs)) == 4
    lent = [*logs[:2], replace(logs[2], begin_utc=BEGAN + timedelta(days=2))]
    assert not conflicts_of(lent)  # and given back
    assert not conflicts_of(logs[:2])  # the machine has a new computer


def test_sound_logs_conflict_with_nothing_in_whatever_order(head: LogHead) -> None:
    logs = heads_like(
        head,
        *(
            {"machine": f"stage-{k % 3}", "begin_utc": BEGAN + timedelta(hours=k // 3)}
            for k in range(9)
        ),
    )
    assert not conflicts_of(logs[::2] + logs[1::2])


def test_simulations_are_measured_by_no_clock(head: LogHead) -> None:
    logs = heads_like(head, {"begin_utc": BEGAN}, {"begin_utc": BEGAN})
    assert conflicts_of(logs)
    assert not conflicts_of([replace(log, virtual=True) for log in logs])


def with_metadata(log: Path, out: Path, **told: Any) -> Path:
    """Write a log's rows with more, or other, metadata."""
    table = pq.read_table(log)
    metadata = json.loads(table.schema.metadata[METADATA_KEY]) | told
    pq.write_table(table.replace_schema_metadata({METADATA_KEY: json.dumps(metadata)}), out)
    return out


def test_a_simulation_is_no_day_of_the_machine_whose_name_it_has(
    good_log: Path, tmp_path: Path
) -> None:
    simulated = with_metadata(good_log, tmp_path / "log.parquet", virtual_time={})
    assert head_of(simulated).machine == "stage-1 (simulated)"
    assert head_of(good_log).machine == "stage-1"


@pytest.mark.parametrize("key", ["flight_record", "capture"])
def test_what_copies_rows_of_a_log_is_known_for_a_copy(
    key: str, good_log: Path, tmp_path: Path
) -> None:
    assert head_of(with_metadata(good_log, tmp_path / "log.parquet", **{key: {}})).copied
    assert not head_of(good_log).copied


@pytest.mark.parametrize(
    "told",
    [
        {"host": "a"},
        {"run": "r", "part": [1, 2]},
        {"run": [1], "part": 0},
        {"part": "x", "run": {}},
    ],
    ids=str,
)
def test_metadata_of_another_kind_tell_nothing_and_break_nothing(
    told: dict[str, Any], good_log: Path, tmp_path: Path
) -> None:
    head = head_of(with_metadata(good_log, tmp_path / "log.parquet", **told))
    assert not conflicts_of([head, replace(head, begin_utc=head.end_utc, source="2.parquet")])


class PassingTrouble:
    """A file of which no long part can be read now."""

    def __init__(self, file: Any) -> None:
        self._file = file

    def read(self, count: int = -1) -> bytes:
        if count > 100_000:
            raise OSError(errno.EIO, "503 Slow Down")
        return self._file.read(count)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def __enter__(self) -> PassingTrouble:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()


def test_a_read_that_fails_for_now_is_left_to_be_tried_again(
    good_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = fsspec.filesystem("memory")
    files.pipe("/bucket/log.parquet", good_log.read_bytes())
    source = "memory://bucket/log.parquet"
    head = look_at_head(source, Declared("C1"))
    assert isinstance(head, LogHead)
    window = whole_log("x", head.group_rows)
    opening = MemoryFileSystem._open
    monkeypatch.setattr(
        MemoryFileSystem, "_open", lambda *args, **more: PassingTrouble(opening(*args, **more))
    )
    with pytest.raises(OSError, match="503"):
        look_at_window(head, Declared("C1"), window, diagnose=False)
    with pytest.raises(OSError, match="503"):
        scan(head, Declared("C1"), [0])
    monkeypatch.undo()
    files.rm("/bucket/log.parquet")
    gone = look_at_window(head, Declared("C1"), window, diagnose=False)
    assert isinstance(gone, Refusal)
    assert gone.reason == f"{source}: no such file"
    assert not gone.lasting


def test_a_column_of_a_log_elsewhere_is_told_with_its_address(good_log: Path) -> None:
    table = pq.read_table(good_log)
    text = table.set_column(
        table.schema.get_field_index("x.command_v"), "x.command_v", pa.array(["a"] * len(table))
    )
    files, source = fsspec.filesystem("memory"), "memory://bucket/text.parquet"
    with files.open(source, "wb") as out:
        pq.write_table(text, out)
    head = look_at_head(source, Declared("C1"))
    assert isinstance(head, LogHead)
    told = look_at_window(head, Declared("C1"), whole_log("x", head.group_rows), diagnose=False)
    assert isinstance(told, Refusal)
    assert told.reason.startswith(f"{source}: column 'x.command_v' holds")


def test_a_corrected_configuration_is_another_question_where_it_refuses(good_log: Path) -> None:
    resolved = json.loads(json.dumps(load("published_gantry").resolved))
    wrong = json.loads(json.dumps(resolved))
    wrong["axes"]["x"]["limits"]["max_voltage_v"] /= 2
    heads = [look_at_head(str(good_log), Declared("a.yaml", each)) for each in (resolved, wrong)]
    right, mistaken = heads
    assert isinstance(right, LogHead)
    assert isinstance(mistaken, LogHead)
    assert right.limits_id != mistaken.limits_id
    assert right.model_id == mistaken.model_id  # what is fitted is the same, and stays one series


def test_a_log_that_was_refused_by_its_footer_is_known_again_when_it_is_used(
    good_log: Path,
) -> None:
    assert damaged_id(str(good_log)) == head_of(good_log).log_id
