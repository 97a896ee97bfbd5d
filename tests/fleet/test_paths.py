"""Paths and patterns mean logs, and nothing that only looks like one."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorctl.errors import UsageError
from motorctl.fleet.paths import logs_of
from motorctl.fleet.store import open_store


def test_files_of_a_store_and_exports_are_no_logs(tmp_path: Path) -> None:
    store = open_store(tmp_path / "kept", create=True)
    findings = store.folder / "findings" / "2026-03"
    findings.mkdir(parents=True)
    for path in (findings / "0.parquet", tmp_path / "a.parquet", tmp_path / "a.export.parquet"):
        path.write_bytes(b"PAR1")
    assert logs_of([f"{tmp_path}/**/*.parquet"]) == [str(tmp_path / "a.parquet")]
    export = str(tmp_path / "a.export.parquet")
    assert logs_of([export]) == [export]  # who names it means it
    with pytest.raises(UsageError, match="no file is meant"):
        logs_of([f"{store.folder}/**/*.parquet"])


def test_a_file_whose_name_looks_like_a_pattern_is_meant(tmp_path: Path) -> None:
    log = tmp_path / "run[1].parquet"
    log.write_bytes(b"PAR1")
    assert logs_of([str(log)]) == [str(log)]


def test_a_query_of_an_address_is_no_pattern() -> None:
    pytest.importorskip("aiohttp")
    address = "http://127.0.0.1:9/log.parquet?key=1"
    assert logs_of([address]) == [address]
