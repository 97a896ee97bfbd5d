"""The scope's page in a real browser: it draws, zooms, measures, and a link shows what was seen."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded_rows import AXES, make_rows, write_log
from scope_browser import Page, browser, served

import motorctl
from motorctl.axis_units import LINEAR, ROTARY
from motorctl.config.shipped import shipped_config
from motorctl.log import LogAxis, LogWriter
from motorctl.log.sample import AxisState, FaultCause, SampleFlag

pytestmark = pytest.mark.slow

X, Y, RED = "#b5482e", "#1f5f8b", "#c0392b"
"""Of the axes, in which y is drawn over x, and of the deadline."""
RATE_HZ = 1000.0
ROWS = 60_000
PEAK_ROW = 41_234


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser() as started:
        yield started


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, str]]:
    """Serve a log of a minute with a peak of one row, late ticks and a fault; path and address."""
    ticks, samples = make_rows(ROWS)
    samples["following_error_m"][PEAK_ROW, 0] = 1e-3
    samples["flags"][20_000:20_007, 0] |= np.uint32(SampleFlag.HELD)
    samples["state"][:6000] = AxisState.IDLE
    samples["state"][48_000:, 1] = AxisState.FAULT
    samples["fault"][48_000:, 1] = FaultCause.ENCODER_LOST
    ticks["turnaround_s"][30_000] = 1.4e-3
    path = tmp_path_factory.mktemp("bench") / "bench.parquet"
    write_log(path, (ticks, samples), {"rate_hz": RATE_HZ, "machine": "bench"})
    with served([path]) as url:
        yield path, url


@pytest.fixture
def open_page(chromium: Any) -> Iterator[Any]:
    pages = []

    def opened(url: str, layout: str = "") -> Page:
        pages.append(Page(chromium, url, layout))
        return pages[-1]

    yield opened
    for page in pages:
        page.close()


def test_it_draws_a_log_with_its_peak_of_one_row(open_page: Any, bench: tuple[Path, str]) -> None:
    page = open_page(bench[1])
    for panel in ("position", "error", "command"):
        assert page.pixels(panel, X)["count"] + page.pixels(panel, Y)["count"] > 2000
    error = page.pixels("error", X)
    # 10 µm of noise fill the lowest hundredth of a panel that reaches to the peak of 1 mm.
    assert float(page.panel("error").get_attribute("data-high")) > 1000
    assert error["rows"][1] - error["rows"][0] > 0.8 * 120
    assert page.panel("error").get_attribute("data-every-row") == "false"


def test_dragging_zooms_until_every_row_is_there(open_page: Any, bench: tuple[Path, str]) -> None:
    page = open_page(bench[1])
    page.drag("error", 0.5, 0.75)
    assert page.view() == pytest.approx((30, 45), abs=0.2)
    for _ in range(3):
        page.drag("error", 0.4, 0.6)
    low, high = page.view()
    assert high - low == pytest.approx(15 * 0.2**3, rel=0.1)
    assert page.panel("error").get_attribute("data-every-row") == "true"
    points = int(page.panel("error").get_attribute("data-points"))
    assert points == pytest.approx((high - low) * RATE_HZ, abs=3)
    page.press("0")
    assert "from" not in page.layout()


def test_keys_wheel_and_shift_move_the_view(open_page: Any, bench: tuple[Path, str]) -> None:
    page = open_page(bench[1], "from=20&to=30")
    page.press("ArrowRight")
    assert page.view() == pytest.approx((21, 31))
    page.press("Shift+ArrowLeft")
    assert page.view() == pytest.approx((20.8, 30.8))
    page.press("-")
    assert page.view() == pytest.approx((18.3, 33.3))
    page.drag("position", 0.2, 0.6, "Shift")
    assert page.view() == pytest.approx((18.3 - 0.4 * 15, 33.3 - 0.4 * 15), abs=0.1)
    page.page.mouse.wheel(0, -100)
    page.settle()
    low, high = page.view()
    assert high - low == pytest.approx(15 * 0.8)
    page.press("Home")
    page.press("ArrowLeft")
    assert "from" not in page.layout()


def test_two_cursors_tell_the_recorded_values_and_their_difference(
    open_page: Any, bench: tuple[Path, str]
) -> None:
    path, url = bench
    page = open_page(url, "panels=error,command&from=41.2&to=41.3")
    page.click("error", 0.2)
    page.click("error", 0.7, "Shift")
    layout = page.layout()
    a_s, b_s = float(layout["a"]), float(layout["b"])
    assert (a_s, b_s) == pytest.approx((41.22, 41.27), abs=2e-3)
    log = motorctl.open_log(path)
    rows = {}
    for line in page.page.locator("#readout tr").all():
        name, *cells = line.locator("th, td").all_inner_texts()
        rows[name] = cells
    for name, column, factor in (
        ("x error", "x.following_error_m", 1e6),
        ("y command", "y.command_v", 1),
    ):
        values = factor * np.array([log[column][round(t * RATE_HZ)] for t in (a_s, b_s)])
        told = [float(cell) for cell in rows[name][:3]]
        assert told == pytest.approx([*values, values[1] - values[0]], rel=1e-5, abs=1e-6)
    hertz = re.search(r"= ([\d.]+) Hz", page.page.locator("#readout").inner_text())
    assert hertz is not None
    assert float(hertz[1]) == pytest.approx(1 / (b_s - a_s), rel=1e-3)
    page.press("x")
    assert page.page.locator("#readout").is_hidden()


def test_a_link_shows_what_its_sender_saw(open_page: Any, bench: tuple[Path, str]) -> None:
    sender = open_page(bench[1])
    sender.page.click("#panels button[data-name=velocity]")
    sender.page.click("#panels button[data-name=position]")
    sender.page.click("#axes button[data-name=y]")
    sender.settle()
    sender.drag("error", 0.3, 0.4)
    sender.click("error", 0.5)
    receiver = open_page(sender.page.url)
    assert receiver.layout() == sender.layout()
    panels = receiver.page.locator(".time-panel").evaluate_all(
        "all => all.map(p => p.dataset.panel)"
    )
    assert panels == ["error", "command", "velocity"]
    for name in panels:
        assert receiver.pixels(name, Y)["count"] == 0, "axis y was switched off"
        for key in ("data-low", "data-high", "data-points"):
            assert receiver.panel(name).get_attribute(key) == sender.panel(name).get_attribute(key)


def test_faults_stand_in_words_below_the_time_axis(open_page: Any, bench: tuple[Path, str]) -> None:
    page = open_page(bench[1])
    track = page.page.locator(".track[data-axis=y]")
    assert track.locator(".stretch").all_inner_texts() == ["idle", "running", "fault: encoder lost"]
    place, fault = track.bounding_box(), track.locator(".fault").bounding_box()
    assert (fault["x"] - place["x"]) / place["width"] == pytest.approx(48 / 60, abs=0.01)


def test_what_the_bus_missed_is_marked_and_counted(open_page: Any, bench: tuple[Path, str]) -> None:
    page = open_page(bench[1])
    assert page.page.locator(".missed-words").all_inner_texts() == ["7 rows without a new sample"]
    place = page.page.locator(".track[data-axis=x]").bounding_box()
    mark = page.page.locator(".track[data-axis=x] .missed").bounding_box()
    assert (mark["x"] - place["x"]) / place["width"] == pytest.approx(20 / 60, abs=0.005)


def test_late_turnarounds_stand_beside_the_deadline(
    open_page: Any, bench: tuple[Path, str]
) -> None:
    page = open_page(bench[1], "panels=turnaround")
    low, high = (
        float(page.panel("turnaround").get_attribute(f"data-{w}")) for w in ("low", "high")
    )
    assert low < 0 < 1000 < 1400 < high
    deadline = page.pixels("turnaround", RED)
    across = deadline["columns"][1] - deadline["columns"][0]
    assert across > 0.85 * deadline["width"]


def test_paths_spectra_and_planes_are_drawn(open_page: Any, bench: tuple[Path, str]) -> None:
    names = ("error_position", "phase", "path", "error_spectrum", "command_spectrum")
    page = open_page(bench[1], f"panels={','.join(names)}&from=10&to=15")
    for name in names:
        assert page.pixels(name, X if name == "path" else Y)["count"] > 300, name


def test_the_path_is_that_of_the_axes_that_are_shown_each_in_its_own_unit(
    open_page: Any, tmp_path: Path
) -> None:
    ticks, samples = make_rows(4000, 3)
    samples["following_error_m"] = (2e-6, -3e-5, 1e-6)
    kinds = {"x": LINEAR, "y": LINEAR, "c": ROTARY}
    axes = [LogAxis(name, ("inertia", "offset"), units=kind) for name, kind in kinds.items()]
    path = write_log(tmp_path / "run.parquet", (ticks, samples), {"rate_hz": RATE_HZ}, axes)
    with served([path]) as url:
        mixed = open_page(url, "panels=path&axes=x,c")
        words = mixed.panel("path").locator(".panel-head").inner_text()
        assert "worst: x 2 µm, c 1 µrad; m and rad have no distance in common" in words
        assert mixed.pixels("path", X)["count"] > 300
        alike = open_page(url, "panels=path&axes=x,y")
        assert "across the path: worst" in alike.panel("path").locator(".panel-head").inner_text()


def test_waves_over_position_and_laps_are_drawn(open_page: Any, bench: tuple[Path, str]) -> None:
    names = ("laps", "error_place", "command_place")
    page = open_page(bench[1], f"panels={','.join(names)}&from=10&to=15")
    assert page.layout()["panels"] == ",".join(names)
    for name in names:
        assert page.pixels(name, Y)["count"] > 300, name
    assert int(page.panel("laps").get_attribute("data-lines")) == 2 * 10
    assert "laps 1 to 10 of 0.5 s" in page.panel("laps").locator(".panel-head").inner_text()


def test_estimates_stand_between_their_bounds(open_page: Any, tmp_path: Path) -> None:
    ticks, samples = make_rows(4000)
    samples["theta_hat"][:, 0, 0] = 0.4 + 0.05 * np.exp(-ticks["time_s"])
    parameter = {"initial": 0.4, "bounds": [0.2, 0.8]}
    config = {"axes": {"x": {"model": {"inertia": parameter}, "gains": {"d_hat_max_v": 2.0}}}}
    path = tmp_path / "run.parquet"
    write_log(path, (ticks, samples), {"rate_hz": RATE_HZ, "machine": "m", "config": config})
    with served([path]) as url:
        page = open_page(url, "panels=estimates&axes=x")
        found = page.page.locator(".panel[data-panel=estimates]")
        words = found.evaluate_all("all => all.map((p) => p.dataset.parameter)")
        assert words == ["inertia", "offset", "d0"]
        limits = [float(found.nth(0).get_attribute(f"data-{w}")) for w in ("low", "high")]
        assert limits == pytest.approx([0.2 - 0.03, 0.8 + 0.03])
        drawn = page.pixels("estimates", X)
        assert drawn["rows"][1] - drawn["rows"][0] > 0.8 * 60, "both bounds are drawn"


def test_two_logs_stand_side_by_side_from_where_their_programs_begin(
    open_page: Any, tmp_path: Path
) -> None:
    paths = []
    for name, idle, error_m in (("before", 1000, 4e-5), ("after", 3500, 1e-5)):
        ticks, samples = make_rows(8000, error_m=error_m)
        samples["state"][:idle] = AxisState.IDLE
        path = tmp_path / f"{name}.parquet"
        paths.append(write_log(path, (ticks, samples), {"rate_hz": RATE_HZ, "machine": "bench"}))
    with served(paths) as url:
        page = open_page(url)
        assert page.page.locator(".log-head b").all_inner_texts() == [
            "before.parquet ",
            "after.parquet ",
        ]
        boxes = [page.panel("error", nth).bounding_box() for nth in (0, 1)]
        assert boxes[0]["y"] == boxes[1]["y"]
        assert boxes[0]["x"] < boxes[1]["x"]
        limits = [
            [page.panel("error", nth).get_attribute(f"data-{w}") for w in ("low", "high")]
            for nth in (0, 1)
        ]
        assert limits[0] == limits[1]
        page.drag("error", 0.2, 0.6)
        begins = [
            page.page.locator(f".band >> nth={nth} >> .running").first.bounding_box()["x"]
            - page.page.locator(f".track >> nth={2 * nth}").bounding_box()["x"]
            for nth in (0, 1)
        ]
        assert begins[0] == pytest.approx(begins[1], abs=1)
        page.page.select_option("#align", "time")
        page.settle()
        assert page.layout()["align"] == "time"


def test_a_log_that_is_recorded_shows_its_new_rows(open_page: Any, tmp_path: Path) -> None:
    ticks, samples = make_rows(5000)
    writer = LogWriter(tmp_path / "run.parquet", {"rate_hz": RATE_HZ}, AXES)
    writer.append(ticks[:2000], samples[:2000])
    writer.flush()
    with served([tmp_path / "run.parquet"]) as url:
        page = open_page(url)
        assert "2000 rows" in page.page.locator(".log-head").inner_text()
        assert "not finished" in page.page.locator(".log-head").inner_text()
        writer.append(ticks[2000:], samples[2000:])
        writer.close({})
        page.page.keyboard.press("r")
        page.page.wait_for_selector(".log-head:has-text('5000 rows')")
        page.settle()
        drawn = page.pixels("position", Y)
        assert drawn["columns"][1] > 0.95 * drawn["width"]


def test_a_person_looks_from_the_whole_log_to_the_spike_at_a_reversal(
    open_page: Any, tmp_path: Path, pictures: Path
) -> None:
    """The pictures of docs/scope.md."""
    shipped = shipped_config("published_gantry").read_text()
    circle = re.sub("program: published_.", "program: ring", shipped)
    for name, text, seconds in (("shuttle", shipped, 12.0), ("ring", circle, 6.0)):
        (tmp_path / f"{name}.yaml").write_text(text)
        for law in ("C1", "C2"):
            log = tmp_path / f"{name}_{law}.parquet"
            motorctl.simulate(
                tmp_path / f"{name}.yaml",
                log,
                controller=law,  # type: ignore[arg-type]
                duration_s=seconds,
            )
    with served([tmp_path / "shuttle_C2.parquet"]) as url:
        page = open_page(url)
        page.page.screenshot(path=pictures / "scope_log.png")
        layout = "panels=error,error_spectrum,error_position&axes=y"
        page = open_page(url, f"{layout}&from=3.95&to=4.65&a=4.159&b=4.4395")
        page.page.screenshot(path=pictures / "scope_reversal.png")
        assert page.pixels("error", Y)["count"] > 500
    with served([tmp_path / "ring_C1.parquet", tmp_path / "ring_C2.parquet"]) as url:
        page = open_page(url, "panels=error,path&magnified=1000&from=1&to=4")
        page.page.screenshot(path=pictures / "scope_side_by_side.png")
        for nth in (0, 1):
            circle_drawn = page.pixels("path", X, nth)
            wide, high = (
                circle_drawn[key][1] - circle_drawn[key][0] for key in ("columns", "rows")
            )
            assert 0.5 < wide / high < 2
    for name in ("scope_log", "scope_reversal", "scope_side_by_side"):
        assert (pictures / f"{name}.png").stat().st_size > 20_000
