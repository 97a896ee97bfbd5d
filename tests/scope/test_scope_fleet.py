"""A scope that serves the logs of a fleet shows the one that a link names, and nothing else."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlparse

import pytest
from fleet_findings import BEGAN, head, parameter
from recorded_rows import make_rows, write_log
from scope_browser import SETTLED, browser, served
from typer.testing import CliRunner

pytest.importorskip("aiohttp", reason="the scope needs the extra [scope]")

from aiohttp.test_utils import TestClient, TestServer

from motorctl.cli import make_app
from motorctl.errors import UsageError
from motorctl.fleet.findings import table_of_log
from motorctl.fleet.head import LogHead, identity_of
from motorctl.fleet.log_index import LogIndex
from motorctl.fleet.report import write_fleet_page
from motorctl.fleet.store import Store, open_store
from motorctl.scope.access import Access
from motorctl.scope.server import application


def kept(store: Store, log_id: str, source: Path | str) -> None:
    told = head("bench", log_id, BEGAN)
    row = parameter(0.1, begin_s=0.1, end_s=0.25)
    told = LogHead(**{**vars(told), "source": str(source)})
    store.write(log_id[:32], BEGAN, table_of_log(told, log_id[:32], [row]))


@pytest.fixture
def store(tmp_path: Path) -> Store:
    store = open_store(tmp_path / "store", create=True)
    for k, name in enumerate("ab"):
        described = {"rate_hz": 1000.0, "machine": f"bench {name}"}
        log = write_log(tmp_path / f"{name}.parquet", make_rows(400 + k), described)
        kept(store, identity_of(str(log)), log)
    return store


def id_of(store: Store, name: str) -> str:
    return identity_of(str(store.folder.parent / f"{name}.parquet"))


def asked(
    store: Store, *paths: str, headers: dict[str, str] | None = None
) -> list[tuple[int, bytes]]:
    async def run() -> list[tuple[int, bytes]]:
        app = application(LogIndex(store.folder).find, Access("127.0.0.1", None))
        async with TestClient(TestServer(app)) as client:
            answers = []
            for path in paths:
                answer = await client.get(path, allow_redirects=False, headers=headers)
                answers.append((answer.status, await answer.read()))
            return answers

    return asyncio.run(run())


def test_each_link_opens_its_own_log(store: Store) -> None:
    pages = [f"/log/{id_of(store, name)}/api/logs" for name in "abab"]
    answers = [json.loads(body)["logs"] for status, body in asked(store, *pages) if status == 200]
    assert [[log["machine"] for log in logs] for logs in answers] == [
        ["bench a"], ["bench b"], ["bench a"], ["bench b"]
    ]  # fmt: skip
    log = f"/log/{id_of(store, 'a')}/"
    (page, script, first) = asked(store, log, log + "main.js", "/")
    assert b"<html" in page[1]
    assert b"layoutOf" in script[1]
    assert b"fleet report" in first[1]


@pytest.mark.slow
def test_a_click_on_the_fleet_page_shows_the_window_in_the_browser(
    store: Store, tmp_path: Path
) -> None:
    report = tmp_path / "fleet.html"
    with browser() as chromium, served(LogIndex(store.folder).find) as url:
        write_fleet_page(store, report, scope_port=int(url.rsplit(":", 1)[1].strip("/")))
        tab = chromium.new_page()
        tab.goto(report.as_uri())
        tab.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
        with tab.expect_popup() as opened:
            tab.click("a[href*='/log/']")
        scope = opened.value
        scope.wait_for_selector(SETTLED)
        led = urlparse(scope.url)
        (name,) = (each for each in "ab" if id_of(store, each) in led.path)
        assert scope.title().startswith(f"{name}.parquet")
        layout = parse_qs(led.fragment)
        assert (layout["from"], layout["to"], layout["axes"]) == (["0.1"], ["0.25"], ["x"])


def test_what_the_store_does_not_know_is_not_opened(store: Store, tmp_path: Path) -> None:
    kept(store, "c" * 64, "s3://bucket/log.parquet")
    kept(store, "d" * 64, tmp_path / "gone.parquet")
    unknown, remote, gone, outside, live = asked(
        store,
        f"/log/{'e' * 64}/api/logs",
        f"/log/{'c' * 64}/api/logs",
        f"/log/{'d' * 64}/api/logs",
        f"/log/{id_of(store, 'a')}/..%2f..%2fstore.json",
        "/api/live",
    )
    assert (unknown[0], remote[0], gone[0]) == (400, 400, 400)
    assert b"knows no such log" in unknown[1]
    assert b"is on no disk here" in remote[1]
    assert b"gone.parquet" in gone[1]
    assert (outside[0], live[0]) == (404, 404)


def test_other_pages_may_link_to_a_log_and_ask_for_nothing_of_it(store: Store) -> None:
    page, other = f"/log/{id_of(store, 'a')}/", {"Sec-Fetch-Site": "cross-site"}
    followed = {**other, "Sec-Fetch-Mode": "navigate"}
    assert asked(store, page, headers=followed)[0][0] == 200
    refused = [(page, other), (page + "api/logs", other), (page + "api/logs", followed)]
    for path, headers in refused:
        assert asked(store, path, headers=headers)[0][0] == 403


def test_findings_that_came_later_are_known(store: Store, tmp_path: Path) -> None:
    index = LogIndex(store.folder)
    later = write_log(tmp_path / "c.parquet", make_rows(410), {"rate_hz": 1000.0})
    with pytest.raises(UsageError, match="knows no such log"):
        index.find(id_of(store, "c"))
    kept(store, id_of(store, "c"), later)
    assert index.find(id_of(store, "c")) == later


def test_a_link_opens_no_other_log_that_took_the_name_of_its_own(
    store: Store, tmp_path: Path
) -> None:
    index, first = LogIndex(store.folder), id_of(store, "a")
    (tmp_path / "moved").mkdir()
    moved = (tmp_path / "a.parquet").rename(tmp_path / "moved" / "a.parquet")
    with pytest.raises(UsageError, match=r"a\.parquet: no such file"):
        index.find(first)
    (tmp_path / "b.parquet").rename(tmp_path / "a.parquet")
    with pytest.raises(UsageError, match=r"a\.parquet: another file is there now"):
        index.find(first)
    store.moved(first[:32], str(moved))  # as the next look at the fleet does
    assert index.find(first) == moved
    assert store.sources()[first[:32]] == str(moved)


@pytest.mark.parametrize("words", [["a.parquet"], ["--socket", "m.sock"]])
def test_a_store_is_shown_alone(store: Store, words: list[Any]) -> None:
    done = CliRunner().invoke(make_app(), ["scope", *words, "--store", str(store.folder)])
    assert isinstance(done.exception, UsageError)
    assert "nothing beside them" in str(done.exception)
