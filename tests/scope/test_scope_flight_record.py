"""The newest flight record of the machine that is shown, as a page beside the live one."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from recorded_rows import make_rows, write_log
from test_scope_live import staged

pytest.importorskip("aiohttp", reason="the scope needs the extra [scope]")

from aiohttp.test_utils import TestClient, TestServer

from motorctl.flight import free_record_path
from motorctl.scope import server
from motorctl.scope.access import Access
from motorctl.scope.server import Logs, application

Answer = tuple[int, str, bytes]


@pytest.fixture(autouse=True)
def at_its_priority(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motorctl.scope.live_machine.keep_off_the_loop_of", lambda path: None)


def write_record(folder: Path, second: int, rows: int) -> Path:
    """Write a flight record as the daemon's recorder calls and marks it."""
    folder.mkdir(exist_ok=True)
    faults = {"x": {"cause": "estop", "message": "emergency stop"}}
    written = datetime(2026, 11, 24, 10, 0, second, tzinfo=UTC)
    own = {**faults["x"], "faults": faults, "time_s": 1.0, "written_utc": written.isoformat()}
    metadata = {"rate_hz": 1000.0, "machine": "bench", "flight_record": own}
    path: Path = write_log(
        free_record_path(folder, written, "x", "estop"), make_rows(rows), metadata
    )
    return path


def asked(
    tmp_path: Path,
    paths: list[str],
    meanwhile: Callable[[str], None] = lambda path: None,
    folder: str = "faults",
) -> list[Answer]:
    """Ask the server of a machine one after the other; return status, where it leads, and body."""
    records = {"folder": str(tmp_path / folder), "newest": None, "failure": None}

    async def run() -> list[Answer]:
        answers = []
        async with TestClient(TestServer(application(shown, Access("127.0.0.1", None)))) as client:
            for path in paths:
                meanwhile(path)
                answer = await client.get(path, allow_redirects=False)
                told = answer.status, answer.headers.get("Location", ""), await answer.read()
                answers.append(told)
        return answers

    with staged(tmp_path / "s", records) as (filled, socket):
        filled.run(500)
        shown = Logs.of_machine(socket, tmp_path)
        try:
            return asyncio.run(run())
        finally:
            shown.close()


def rows_of(answer: Answer) -> Any:
    (log,) = json.loads(answer[2])["logs"]
    return log["rows"], log["live"]


def test_the_newest_flight_record_opens_beside_the_machine_and_stays_while_others_come(
    tmp_path: Path,
) -> None:
    write_record(tmp_path / "faults", 1, 50)
    write_record(tmp_path / "faults", 2, 60)

    def trips_again(path: str) -> None:
        if path.endswith("#"):
            write_record(tmp_path / "faults", 3, 70)

    newest, of_it = "/flight_record/", "/flight_record/{}/api/logs"
    paths = [newest, newest, of_it.format(1), newest + "#", of_it.format(1), of_it.format(2)]
    paths += ["/flight_record/1/", "/flight_record/1/main.js", "/api/logs"]
    answers = asked(tmp_path, paths, trips_again)
    leads = [answers[k][:2] for k in (0, 1, 3)]
    assert leads == [(302, f"/flight_record/{number}/") for number in (1, 1, 2)]
    assert [rows_of(answers[k]) for k in (2, 4, 5)] == [(60, False), (60, False), (70, False)]
    assert rows_of(answers[-1])[1]
    assert b"<title>motorctl scope</title>" in answers[6][2]
    assert answers[7][0] == 200


def test_a_request_can_name_no_other_file_and_what_is_no_record_is_not_opened(
    tmp_path: Path,
) -> None:
    write_log(tmp_path / "secret.parquet", make_rows(10), {"rate_hz": 1000.0})
    assert asked(tmp_path, ["/flight_record/"])[0][::2] == (
        400,
        b"bench: there is no flight record: no axis has tripped\n",
    )
    (tmp_path / "faults").mkdir()
    (tmp_path / "secret.parquet").rename(tmp_path / "faults/20261124T100000Z-x-estop.parquet")
    secret = str(tmp_path / "faults/20261124T100000Z-x-estop.parquet")
    others = [secret, "..%2f..%2fsecret", "x", "0", "99999999999"]
    paths = ["/flight_record/", *(f"/flight_record/{other}/api/logs" for other in others)]
    paths += ["/flight_record/1/api/live", "/flight_record/1/api/trigger"]
    assert {status for status, _, _ in asked(tmp_path, paths)} <= {400, 404}


def test_a_record_that_was_opened_long_ago_is_closed_in_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "MOST_RECORDS", 1)
    seconds = iter((1, 2))

    def trips(path: str) -> None:
        if path == "/flight_record/":
            write_record(tmp_path / "faults", next(seconds), 50)

    paths = [
        "/flight_record/",
        "/flight_record/",
        *(f"/flight_record/{k}/api/logs" for k in (1, 2)),
    ]
    *_, old, new = asked(tmp_path, paths, trips)
    assert (old[0], b"is closed by now" in old[2]) == (400, True)
    assert rows_of(new) == (50, False)


def test_a_folder_that_cannot_be_looked_into_is_told_with_what_to_do(tmp_path: Path) -> None:
    ((status, _, told),) = asked(tmp_path, ["/flight_record/"], folder="f" * 300)
    assert status == 400
    assert b"flight records cannot be read: File name too long: start the scope as a user" in told
