"""A store of findings is written whole or not at all, by one run at a time."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from pathlib import Path

import pytest
from fleet_bench import store_of
from fleet_findings import BEGAN, head, parameter
from hypothesis import example, given
from hypothesis import strategies as st

from motorctl.errors import DataError, UsageError
from motorctl.fleet.findings import FIELDS, Refusal, table_of_log, table_of_refusal
from motorctl.fleet.series import series_of
from motorctl.fleet.store import Store, open_store


@pytest.fixture
def store(good_log: Path, tmp_path: Path) -> Store:
    return store_of(tmp_path / "store", [good_log])


def test_a_store_that_is_opened_again_has_what_was_kept(store: Store) -> None:
    (file,) = store.folder.glob("findings/2026-03/*.parquet")
    again = open_store(store.folder)
    assert file.stem in again
    assert "0" * 32 not in again
    kept = again.read()
    assert tuple(kept.column_names) == tuple(FIELDS)
    assert set(kept.column("machine").to_pylist()) == {"stage-1"}


@given(st.text(st.characters(codec=None), max_size=8))
@example("\udc80 \xa0 ü")
def test_whatever_machines_and_files_are_called_is_kept(name: str) -> None:
    told = replace(head(name, "a" * 64, BEGAN), host=name, programs={"x": name})
    why = Refusal(told.source, f"{told.source}: no rows")
    tables = [
        table_of_log(told, "a" * 32, [parameter(0.1, program=name, text=name)]),
        table_of_refusal(why, "b" * 32, "b" * 64, None),
        table_of_refusal(why, "c" * 32, "c" * 64, told),
    ]
    for table in tables:
        (kept,) = table.column("source").to_pylist()
        assert kept.encode("utf-8") == told.source.encode("utf-8", "backslashreplace")


def test_an_empty_store_has_no_series(tmp_path: Path) -> None:
    assert series_of(open_store(tmp_path / "new", create=True)) == []


def test_what_is_no_store_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(UsageError, match="is no store of findings"):
        open_store(tmp_path, create=True)
    with pytest.raises(UsageError, match="is no store of findings"):
        open_store(tmp_path / "nothing")
    assert [path.name for path in tmp_path.iterdir()] == ["letter.txt"]


def test_a_store_of_another_schema_is_refused(store: Store) -> None:
    (store.folder / "store.json").write_text(json.dumps({"schema": 999}))
    with pytest.raises(UsageError, match="its schema is 999"):
        open_store(store.folder)
    (store.folder / "store.json").write_text("[1]")
    with pytest.raises(UsageError, match="its schema is None"):
        open_store(store.folder)


def test_only_one_run_writes_at_a_time(store: Store) -> None:
    other = open_store(store.folder)
    with store.locked(), pytest.raises(UsageError, match="another run writes"), other.locked():
        pass
    with store.locked():
        pass


def test_what_a_run_left_unfinished_is_cleared_away_and_never_read(store: Store) -> None:
    rows = store.read().num_rows
    draft = store.folder / "findings" / "2026-03" / ".draft-0123"
    draft.write_bytes(b"PAR1 and then the power failed")
    assert open_store(store.folder).read().num_rows == rows
    with store.locked():
        assert not draft.exists()


def test_a_bit_of_the_store_that_changed_is_told_and_never_taken_for_a_finding(
    store: Store,
) -> None:
    (file,) = store.folder.glob("findings/*/*.parquet")
    whole = file.read_bytes()
    number = struct.pack("<d", store.read(["value"]).column("value")[0].as_py())
    at = whole.index(number)  # as it is: no compression makes measured numbers shorter
    file.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
    with pytest.raises(DataError, match=r"a damaged file of the store: .*CRC checksum"):
        store.read(["value"])


def test_a_damaged_file_of_the_store_is_told(store: Store) -> None:
    (file,) = store.folder.glob("findings/*/*.parquet")
    file.write_bytes(file.read_bytes()[:200])
    with pytest.raises(DataError, match="remove it, and its log is looked at again"):
        store.read()
