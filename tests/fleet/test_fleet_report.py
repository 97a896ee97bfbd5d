"""The page of a fleet has what to look at first, every machine, and shows text of logs as text."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import parse_qs, urlparse

import numpy as np
import pyarrow as pa
import pytest
from fleet_findings import BEGAN, FRICTION, fleet_store, head, keep, kept, parameter
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.errors import DataError, UsageError
from motorctl.fleet.conflicts import conflicts_of
from motorctl.fleet.findings import Refusal, table_of_log, table_of_refusal
from motorctl.fleet.report import write_fleet_page
from motorctl.fleet.siblings import latest_level
from motorctl.fleet.store import open_store

EVIL = "<script>alert(1)</script>"
VOID = {"meta", "path", "img", "br"}


class Balanced(HTMLParser):
    """Keeps what stands on a page, and sees to it that what is opened is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict[str, str | None]]] = []
        self.words = ""
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += data


def report(folder: Path, page: Path, *options: str) -> Balanced:
    words = ["fleet", "report", str(folder), "--out", str(page), *options]
    done = CliRunner().invoke(make_app(), words)
    assert done.exit_code == 0, done.output
    return Balanced(page.read_text())


@pytest.fixture
def store(tmp_path: Path) -> Path:
    machines = [*(f"m{k}" for k in range(10)), EVIL]
    fleet = fleet_store(
        tmp_path / "fleet findings",
        machines=machines,
        days=20,
        moved=lambda machine, axis, name, day: 12.0 * (machine == EVIL and day >= 15),
    )
    strange = head("m3", "f" * 64, BEGAN)
    effect = {
        "axis": "x", "program": EVIL, "window": 0, "kind": "effect", "name": EVIL, "value": 0.9,
        "confidence": 0.97, "text": f"evidence {EVIL}", "begin_s": 3.0, "end_s": 5.5,
    }  # fmt: skip
    verdict = {"axis": "x", "program": EVIL, "window": 0, "kind": "verdict", "name": "effect"}
    refused = Refusal(EVIL, f"{EVIL}: no rows")
    keep(
        fleet,
        "strange",
        [
            table_of_log(strange, "f" * 32, [effect, verdict]),
            table_of_refusal(refused, "e" * 32, "e" * 64, None),
        ],
    )
    return fleet.folder


def test_the_page_shows_changes_with_pictures_and_every_machine(
    store: Path, tmp_path: Path
) -> None:
    page = report(store, tmp_path / "fleet.html", "--scope-port", "9000")
    words = re.sub(r"\s+", " ", page.words)
    assert "11 machines" in words
    assert f"1. {EVIL} · axis x (p): {FRICTION}" in words
    assert "between 2026-03-15 16:00 and 2026-03-16 00:00" in words
    assert re.search(r"\(\+2\d(\.\d)? %\)", words)
    assert "beside its 10 siblings now +" in words
    assert "at most 1 looks a year" in words
    assert "1 that cannot be used" in words
    assert f"motorctl scope --store '{store}' --port 9000" in words
    (article,) = (attrs for tag, attrs in page.seen if tag == "article")
    assert article["id"] == "a1"
    drawn = {attrs["class"] for tag, attrs in page.seen if tag == "path" and "class" in attrs}
    assert drawn == {"band", "at", "siblings", "dots", "level"}
    assert sum(tag == "details" for tag, _ in page.seen) == 12  # machines, and logs of none


def test_links_lead_to_the_window_of_the_log(store: Path, tmp_path: Path) -> None:
    page = report(store, tmp_path / "fleet.html")
    links = [str(attrs["href"]) for tag, attrs in page.seen if tag == "a"]
    inside = {link[1:] for link in links if link.startswith("#")}
    assert inside <= {attrs.get("id") for _, attrs in page.seen}
    led = [urlparse(link) for link in links if not link.startswith("#")]
    assert {link.netloc for link in led} == {"127.0.0.1:8765"}
    (strange,) = {link for link in led if "f" * 64 in link.path}
    assert strange.path == f"/log/{'f' * 64}/"
    layout = {key: values[0] for key, values in parse_qs(strange.fragment).items()}
    assert layout == {"axes": "x", "align": "time", "from": "3", "to": "5.5"}


def test_what_logs_say_is_text_and_the_page_loads_nothing(store: Path, tmp_path: Path) -> None:
    page = report(store, tmp_path / "fleet.html")
    tags = {tag for tag, _ in page.seen}
    assert not tags & {"script", "link", "img", "iframe"}
    text = (tmp_path / "fleet.html").read_text()
    assert EVIL not in text
    assert not re.search(r"(?:src|url\()", text)
    assert page.words.count(EVIL) >= 6


def test_a_store_without_findings_and_findings_of_older_files_make_a_page(tmp_path: Path) -> None:
    open_store(tmp_path / "empty", create=True)
    assert "0 machines" in report(tmp_path / "empty", tmp_path / "empty.html").words
    older = open_store(tmp_path / "older", create=True)
    table = table_of_log(head("m1", "a" * 64, BEGAN), "a" * 32, [parameter(0.14)])
    keep(older, "a" * 32, [pa.table(table).drop_columns(["begin_s", "end_s"])])
    page = report(tmp_path / "older", tmp_path / "older.html")
    (link,) = (a["href"] for tag, a in page.seen if tag == "a" and "log/" in str(a["href"]))
    assert str(link).endswith(f"/log/{'a' * 64}/#axes=x&align=time")


@settings(max_examples=40)
@given(st.integers(1, 12), st.sampled_from([0.0, 1.0, 0.3]), st.sampled_from([0.0, 1e-13, 1.0]))
def test_a_series_has_a_level_however_short_and_however_constant(
    points: int, value: float, scatter: float
) -> None:
    noise = np.random.default_rng(points).standard_normal(points)
    level = latest_level(value + scatter * noise)
    assert level.points == min(points, 9)
    assert level.value == pytest.approx(value, abs=4.0 * scatter)
    assert level.std_error <= 3.0 * scatter + 1e-12 or points < 3


def test_machines_that_are_young_and_values_that_never_differ_are_on_the_page(
    tmp_path: Path,
) -> None:
    store = open_store(tmp_path / "young", create=True)
    logs = [
        kept(head(f"m{points}", f"{points}-{k}", BEGAN + k * timedelta(hours=8)), value(k))
        for points, value in (
            *((n, lambda k: 0.1 + 0.01 * (-1) ** k) for n in (3, 4, 5)),
            (30, lambda _: 0.0),
        )
        for k in range(points)
    ]
    keep(store, "all", logs)
    words = report(store.folder, tmp_path / "young.html").words
    for machine in ("m3", "m4", "m5", "m30"):
        assert machine in words


def test_a_copy_that_was_torn_is_told_until_it_is_whole(tmp_path: Path) -> None:
    store, whole = open_store(tmp_path / "torn", create=True), head("m1", "a" * 64, BEGAN)
    for k, size in enumerate("bc"):  # two nights, as the copy grew
        why = Refusal(whole.source, f"{whole.source}: its end is missing ({size})")
        store.write(size * 32, None, table_of_refusal(why, size * 32, size * 64, None))
        words = report(store.folder, tmp_path / f"{k}.html").words
        assert words.count("its end is missing") == 1
        assert f"its end is missing ({size})" in words
    store.write("a" * 32, BEGAN, table_of_log(whole, "a" * 32, [parameter(0.14)]))
    words = report(store.folder, tmp_path / "whole.html").words
    assert "its end is missing" not in words
    assert "cannot be used" not in words


def test_bad_logs_that_depend_on_others_are_on_the_page_until_a_run_finds_them_good(
    tmp_path: Path,
) -> None:
    store = fleet_store(tmp_path / "store", machines=["m1"], days=3)
    told = head("m1", "a" * 64, datetime(1970, 1, 1, tzinfo=UTC))
    failed = Refusal("s3://b/\udc80.parquet", "s3://b/\udc80.parquet: a worker failed", False)
    store.keep_passing([*conflicts_of([told]), failed, Refusal("torn", "torn: no rows")])
    words = report(store.folder, tmp_path / "bad.html").words
    assert "1 unusable" in words
    assert "its clock was never set" in words
    assert "a worker failed" in words
    assert "torn: no rows" not in words  # that lies in the log, and stands among the findings
    store.keep_passing([])
    assert "unusable" not in report(store.folder, tmp_path / "good.html").words
    (store.folder / "last_run.json").write_text("[1")
    with pytest.raises(DataError, match=r"last_run\.json: damaged"):
        store.passing()


def test_a_fleet_that_is_silent_altogether_is_told_so(tmp_path: Path) -> None:
    store = fleet_store(tmp_path / "store", machines=["m1", "m2"], days=3)
    for days, silent in ((3, 0), (5, 2)):
        now = BEGAN + timedelta(days=days)
        write_fleet_page(store, tmp_path / "page.html", now=now)
        assert Balanced((tmp_path / "page.html").read_text()).words.count(" silent") == silent


def test_a_page_that_cannot_be_written_is_told(store: Path, tmp_path: Path) -> None:
    words = ["fleet", "report", str(store), "--out", str(tmp_path / "no" / "fleet.html")]
    done = CliRunner().invoke(make_app(), words)
    assert isinstance(done.exception, UsageError)
    assert "the page cannot be written" in str(done.exception)
