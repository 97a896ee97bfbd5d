"""A log that cannot be used is told with its file and the reason."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from fleet_bench import head_of, looked_at

from motorctl.config import load
from motorctl.fleet.conflicts import conflicts_of
from motorctl.fleet.findings import Refusal
from motorctl.fleet.head import Declared, LogHead
from motorctl.log.columns import METADATA_KEY

BEGAN = datetime(2026, 3, 1, 6, tzinfo=UTC)


def reason_of(log: Path, declared: Declared | None = None) -> str:
    found = looked_at(log, declared)
    assert isinstance(found, Refusal), found
    assert log.name in found.reason
    return found.reason


def test_a_truncated_log_is_told(good_log: Path, tmp_path: Path) -> None:
    log = tmp_path / "truncated.parquet"
    log.write_bytes(good_log.read_bytes()[:-5000])
    assert "its end is missing; copied incompletely?" in reason_of(log)


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
