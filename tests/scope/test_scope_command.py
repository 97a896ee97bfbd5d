"""`motorctl scope` on the command line: what it needs, and what it says when it cannot."""

from __future__ import annotations

import socket
import sys
from pathlib import Path

import pytest
from recorded_rows import make_rows, write_log

from motorctl.cli import main


def run(monkeypatch: pytest.MonkeyPatch, *words: str) -> int | str | None:
    monkeypatch.setattr(sys, "argv", ["motorctl", "scope", *words])
    with pytest.raises(SystemExit) as end:
        main()
    return end.value.code


def test_without_its_extra_it_says_how_to_install_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    assert run(monkeypatch, "run.parquet") == 2
    assert capsys.readouterr().err == (
        "motorctl: motorctl scope needs aiohttp, which is not installed: "
        "pip install 'motorctl[scope]'\n"
    )


def test_logs_that_cannot_be_opened_are_all_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    pytest.importorskip("aiohttp")
    (tmp_path / "text.parquet").write_text("no log")
    assert run(monkeypatch, str(tmp_path / "text.parquet"), str(tmp_path / "none.parquet")) == 2
    told = capsys.readouterr().err
    assert "text.parquet: not a Parquet file" in told
    assert "none.parquet: no such file" in told
    assert "Traceback" not in told


def test_a_port_that_is_taken_is_told_with_what_to_do(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    pytest.importorskip("aiohttp")
    write_log(tmp_path / "run.parquet", make_rows(100), {"rate_hz": 1000.0})
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert run(monkeypatch, str(tmp_path / "run.parquet"), "--port", port) == 1
    told = capsys.readouterr().err
    assert f"cannot be served on 127.0.0.1, port {port}" in told
    assert "--port 0 takes any that is free" in told


@pytest.mark.parametrize(
    ("words", "status", "told"),
    [
        (("--port", "99999"), 2, "less than or equal to 65535"),
        (("--address", "bad..host"), 1, "cannot be served on bad..host, port 0"),
        (("--address", ""), 2, "--address: is empty"),
    ],
)
def test_where_nobody_can_listen_is_told_in_words(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    words: tuple[str, str],
    status: int,
    told: str,
) -> None:
    pytest.importorskip("aiohttp")
    write_log(tmp_path / "run.parquet", make_rows(100), {"rate_hz": 1000.0})
    assert run(monkeypatch, str(tmp_path / "run.parquet"), *words) == status
    assert told in capsys.readouterr().err
