"""The page beside a daemon: it follows, triggers on a fault, and survives the daemon's restart."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from daemon_rig import Daemon, bench_config
from scope_browser import SETTLED, Page, browser

import motorctl

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock, pytest.mark.bears_pauses]

X = "#b5482e"
CONFIG = bench_config("shuttle")
WAIT_S = 60.0


@contextmanager
def scope(socket: Path, folder: Path) -> Iterator[str]:
    """Run the command beside a daemon, in a folder, and return the page's address."""
    words = ("scope", "--socket", str(socket))
    code = "from motorctl.cli import main; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, *words], stdout=subprocess.PIPE, text=True, cwd=folder
    )
    try:
        assert process.stdout is not None
        yield process.stdout.readline().split()[0]
    finally:
        process.terminate()
        process.wait()
        process.stdout.close()


def heard_s(page: Page) -> float:
    """Return how far the page has heard the machine."""
    return float(page.page.inner_text("#heard").split()[0])


def test_it_follows_triggers_on_a_fault_and_survives_the_daemons_restart(
    tmp_path: Path, pictures: Path
) -> None:
    with browser() as chromium, Daemon(tmp_path, CONFIG) as daemon:
        with motorctl.connect(daemon.socket) as machine:
            machine.start("x")
        with scope(daemon.socket, tmp_path) as url:
            page = Page(chromium, url, "panels=position,error")
            sees_it_follow(page)
            forgets_a_silence_that_is_over(page)
            page.page.click("[name=arm]")
            page.page.wait_for_selector("#trigger[data-armed=true]")
            with motorctl.connect(daemon.socket) as machine:
                machine.estop()
            page.page.wait_for_selector("#captured span")
            page.settle()
            sees_the_fault(page, tmp_path)
            opens_the_flight_record(page, daemon)
            page.page.screenshot(path=pictures / "scope_live.png")
            daemon.process.terminate()
            daemon.process.wait()
            page.page.wait_for_selector("#heard[data-gone=true]")
            daemon.process = daemon.launch()
            daemon.wait_until_running()
            page.page.wait_for_selector("#heard[data-gone=false]")
            page.page.click("#follow")
            sees_it_follow(page)
            page.close()


def sees_it_follow(page: Page) -> None:
    """See the page move on by itself, with nothing lost."""
    begin_s = heard_s(page)
    deadline = time.monotonic() + WAIT_S
    while heard_s(page) < begin_s + 1:
        assert time.monotonic() < deadline
        time.sleep(0.1)
    assert page.page.get_attribute("#heard", "data-lost") == "0"
    assert page.pixels("position", X)["count"] > 100


def forgets_a_silence_that_is_over(page: Page) -> None:
    """See that the server is said not to answer for as long as it does not."""
    page.page.route("**/api/live*", lambda route: route.abort())
    page.page.wait_for_selector("#notes li:has-text('does not answer')")
    page.page.unroute("**/api/live*")
    page.page.wait_for_selector("#notes li", state="detached")
    page.errors.clear()


def opens_the_flight_record(page: Page, daemon: Daemon) -> None:
    """See the daemon's own record of the fault on a page beside, while this one goes on."""
    records = daemon.ask("status")["recording"]["flight_records"]
    while not records["newest"]:
        time.sleep(0.1)
        records = daemon.ask("status")["recording"]["flight_records"]
    with page.page.expect_popup() as beside:
        page.page.click("text=newest flight record")
    beside.value.wait_for_selector(SETTLED)
    assert beside.value.url.partition("#")[0].endswith("/flight_record/1/")
    assert beside.value.title().startswith(f"{records['newest']}.parquet")
    assert "fault: estop" in beside.value.locator(".track[data-axis=x]").inner_text()
    assert beside.value.locator("#live").is_hidden()
    beside.value.close()


def sees_the_fault(page: Page, folder: Path) -> None:
    """See the capture on the page, in the folder, and as a log."""
    assert "fault: estop" in page.page.locator(".track[data-axis=x]").inner_text()
    low, high = page.view()
    (written,) = (folder / "captures").glob("*.parquet")
    assert str(written.relative_to(folder)) in page.page.inner_text("#captured")
    log: Any = motorctl.open_log(written)
    assert (log.time_s[0], log.time_s[-1]) == pytest.approx((low, high), abs=0.01)
    assert {fault.cause for fault in log.info().faults} == {"ESTOP"}
    tripped = log.info().faults[0].time_s
    assert float(page.layout()["a"]) == pytest.approx(tripped)
    assert tripped - low == pytest.approx(1.0, abs=0.02)
    assert motorctl.compare(log).measures("x")
