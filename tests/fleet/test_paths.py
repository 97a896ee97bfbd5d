"""Paths and patterns mean logs, and nothing that only looks like one."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

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


def test_a_folder_that_cannot_be_read_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("open", "shut"):
        (tmp_path / name / "deep").mkdir(parents=True)
        (tmp_path / name / "deep" / "a.parquet").write_bytes(b"PAR1")
    shut, scan = tmp_path / "shut" / "deep", os.scandir

    def scandir(path: Any = ".") -> Any:
        if Path(os.fsdecode(path)) == shut:
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return scan(path)

    monkeypatch.setattr(os, "scandir", scandir)
    told: dict[str, str] = {}
    found = logs_of([f"{tmp_path}/**/*.parquet"], told)
    assert found == [str(tmp_path / "open" / "deep" / "a.parquet")]
    assert told == {str(shut): f"{shut}: this folder cannot be read: Permission denied"}
    with pytest.raises(UsageError, match="cannot be read: Permission denied"):
        logs_of([f"{shut}/*.parquet"])


def test_a_file_whose_name_looks_like_a_pattern_is_meant(tmp_path: Path) -> None:
    log = tmp_path / "run[1].parquet"
    log.write_bytes(b"PAR1")
    assert logs_of([str(log)]) == [str(log)]


def test_a_query_of_an_address_is_no_pattern() -> None:
    pytest.importorskip("aiohttp")
    address = "http://127.0.0.1:9/log.parquet?key=1"
    assert logs_of([address]) == [address]
