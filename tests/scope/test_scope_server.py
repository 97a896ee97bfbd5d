"""What the scope's server tells of logs."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asked_scope import asked
from recorded_rows import AXES, back_and_forth, columns, make_rows, write_csv, write_log

pytest.importorskip("aiohttp", reason="the scope needs the extra [scope]")


import motorctl
from motorctl.axis_units import LINEAR, ROTARY, AxisUnits
from motorctl.errors import DataError, UsageError
from motorctl.log import LogAxis, LogWriter
from motorctl.log.sample import AxisState, FaultCause, SampleFlag
from motorctl.scope.opened_log import OpenedLog
from motorctl.scope.server import Logs


def arrays(body: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Decode an answer as the page does."""
    head, _, numbers = body.partition(b"\n")
    told = json.loads(head)
    assert (len(head) + 1) % 8 == 0
    found, place = {}, 0
    for name, length in told["arrays"]:
        found[name] = np.frombuffer(numbers, "<f8", length, 8 * place)
        place += length
    assert len(numbers) == 8 * place
    return told, found


def test_logs_are_told_with_what_the_page_needs(log: Path) -> None:
    status, _, body = asked([log], ("/api/logs", {}))
    told = json.loads(body)
    assert status == 200
    (only,) = told["logs"]
    assert (only["name"], only["rows"], only["rate_hz"]) == ("run.parquet", 4000, 1000.0)
    assert only["axes"] == ["x", "y"]
    assert only["units"]["x.following_error_m"] == "m"
    assert only["program_begins_s"] == 0.5
    assert told["notes"] == []


def test_columns_come_as_numbers_of_every_row_where_there_are_few(log: Path) -> None:
    query = "log=0&columns=x.position_m,y.command_v,z.no&begin_s=1&end_s=1.5&pixels=1000"
    _, _, body = asked([log], (f"/api/signals?{query}", {}))
    told, found = arrays(body)
    assert told["every_row"]
    assert list(found) == ["time_s", "x.position_m", "y.command_v"]
    assert found["time_s"][[0, -1]] == pytest.approx([0.999, 1.5])
    _, samples = make_rows(4000)
    assert found["x.position_m"] == pytest.approx(samples["position_m"][999:1501, 0])


def test_states_and_faults_are_told_in_words_with_their_times(log: Path) -> None:
    _, _, body = asked([log], ("/api/bands?log=0&begin_s=0&end_s=4", {}))
    told = json.loads(body)["axes"]
    assert [(s["state"], s["from_s"], s["to_s"]) for s in told["x"]] == [
        ("idle", 0.0, 0.5),
        ("running", 0.5, 3.0),
        ("fault", 3.0, 3.999),
    ]
    assert told["x"][-1]["fault"] == "following error"
    assert [s["state"] for s in told["y"]] == ["idle", "running"]


def test_what_the_bus_missed_is_told_with_its_times(tmp_path: Path) -> None:
    ticks, samples = make_rows(70_000)
    samples["flags"] &= ~np.uint32(SampleFlag.HELD | SampleFlag.BETWEEN)
    samples["flags"][:, 1] |= np.uint32(
        SampleFlag.BETWEEN | SampleFlag.HELD
    )  # an axis of fewer ticks
    samples["flags"][100:103, 0] |= np.uint32(SampleFlag.HELD)
    samples["flags"][65_530:65_540, 0] |= np.uint32(SampleFlag.HELD)  # over the end of a row group
    path = write_log(tmp_path / "run.parquet", (ticks, samples), {"rate_hz": 1000.0})
    question = "/api/bands?log=0&begin_s={}&end_s={}"
    whole, part = asked([path], (question.format(0, 70), {}), (question.format(65.534, 66), {}))
    told = json.loads(whole[2])["missed"]
    assert told["y"] == {"rows": 0, "stretches": []}
    assert told["x"]["rows"] == 13
    assert told["x"]["stretches"] == [[0.1, 0.102], [65.53, 65.535], [65.536, 65.539]]
    assert json.loads(part[2])["missed"]["x"]["rows"] == 7
    assert motorctl.open_log(path).info().missed == {"x": 13, "y": 0}


def test_one_row_is_told_as_it_was_recorded(log: Path) -> None:
    _, _, body = asked([log], ("/api/values?log=0&at_s=2.0004", {}))
    ticks, samples = make_rows(4000)
    told = json.loads(body)
    assert told["tick"] == 2000
    assert told["x.command_v"] == samples["command_v"][2000, 0]
    assert told["turnaround_s"] == ticks["turnaround_s"][2000]


def test_the_spectrum_of_a_sine_has_its_line_at_its_frequency_and_rms(log: Path) -> None:
    query = "log=0&column=x.following_error_m&begin_s=0&end_s=4"
    _, _, body = asked([log], (f"/api/spectrum?{query}", {}))
    _, found = arrays(body)
    line = found["amplitude"][1:].argmax() + 1
    assert found["frequency_hz"][line] == pytest.approx(7.0, abs=0.5)
    assert found["amplitude"][line] == pytest.approx(1e-5 / np.sqrt(2), rel=0.1)


def asked_arrays(path: Path, query: str) -> tuple[dict[str, Any], dict[str, Any]]:
    status, _, body = asked([path], (f"/api/{query}", {}))
    assert status == 200, body
    return arrays(body)


@pytest.mark.parametrize(
    ("units", "unit", "scale"), [(LINEAR, "cycles/m", 1.0), (ROTARY, "cycles/turn", 2.0 * np.pi)]
)
def test_a_wave_over_position_has_its_line_at_its_wave_number_whatever_the_speed(
    tmp_path: Path, units: AxisUnits, unit: str, scale: float
) -> None:
    ticks, samples = make_rows(20_000)
    time_s = ticks["time_s"]
    reference = back_and_forth(time_s, period_s=2.0)  # at every speed up to the highest
    wave = 1e-5 * np.sin(2 * np.pi * reference / 0.025)
    samples["position_m"][:, 0] = reference
    samples["following_error_m"][:, 0] = wave + 1e-5 * np.sin(2 * np.pi * 31.37 * time_s)
    path = tmp_path / "run.parquet"
    axes = (LogAxis("x", ("inertia", "offset"), units=units), AXES[1])
    write_log(path, (ticks, samples), {"rate_hz": 1000.0}, axes)
    told, found = asked_arrays(
        path,
        "place_spectrum?log=0&column=x.following_error_m&position=x.position_m&begin_s=0&end_s=20",
    )
    line = found["amplitude"][1:].argmax() + 1
    assert told["unit"] == unit
    assert found["cycles"][line] == pytest.approx(40.0 * scale, abs=1.5 * told["resolution"])
    assert found["amplitude"][line] == pytest.approx(1e-5 / np.sqrt(2), rel=0.2)


def test_where_nothing_moves_no_wave_over_position_is_told(tmp_path: Path) -> None:
    ticks, samples = make_rows(3000)
    samples["position_m"][:, 0] = 0.1
    path = tmp_path / "run.parquet"
    write_log(path, (ticks, samples), {"rate_hz": 1000.0})
    query = "log=0&column=x.command_v&position=x.position_m&begin_s=0&end_s=3"
    told, found = asked_arrays(path, f"place_spectrum?{query}")
    assert told["note"] == "too little way is passed in this view: zoom out"
    assert len(found["cycles"]) == 0
    told, found = asked_arrays(path, "laps?log=0&axis=x&column=x.command_v&begin_s=0&end_s=0.4")
    assert told["note"] == "no cycle is repeated in this view: zoom out"


def test_laps_are_told_one_by_one_with_every_peak(tmp_path: Path) -> None:
    ticks, samples = make_rows(10_500)
    reference = back_and_forth(ticks["time_s"] - 0.5, period_s=2.0)
    samples["reference_m"][:, 0] = np.where(ticks["time_s"] < 0.5, 0.0, reference)
    samples["state"][:500] = AxisState.IDLE
    samples["following_error_m"][:, 0] = 0.0
    samples["following_error_m"][4_700, 0] = 1e-3  # in lap 3, 0.2 s after it began
    path = tmp_path / "run.parquet"
    write_log(path, (ticks, samples), {"rate_hz": 1000.0})
    told, found = asked_arrays(
        path, "laps?log=0&axis=x&column=x.following_error_m&begin_s=0&end_s=11"
    )
    assert told["period_s"] == pytest.approx(2.0, abs=0.01)
    assert len(found["rows"]) == 5
    peak = found["y"].argmax()
    assert found["y"][peak] == 1e-3
    assert found["x"][peak] == pytest.approx(0.2, abs=0.02)
    assert np.searchsorted(np.cumsum(found["rows"]), peak, "right") == 2


def test_estimates_are_told_with_the_bounds_of_the_configuration(tmp_path: Path) -> None:
    config = {
        "axes": {
            "x": {
                "model": {
                    "inertia": {"initial": 0.4, "bounds": [0.2, 0.8]},
                    "offset": {"bounds": "none"},
                    "gone": {"parameters": {"sin_1": {"bounds": [-1, 1]}}},
                },
                "gains": {"d_hat_max_v": 2.0},
            }
        }
    }
    path = tmp_path / "run.parquet"
    write_log(path, make_rows(100), {"rate_hz": 1000.0, "config": config})
    _, _, body = asked([path], ("/api/logs", {}))
    bounds = json.loads(body)["logs"][0]["bounds"]
    assert bounds == {"x.theta_hat_inertia": [0.2, 0.8], "x.d0_hat_v": [-2.0, 2.0]}


def test_the_error_over_position_lights_every_pixel_that_a_row_falls_onto(tmp_path: Path) -> None:
    rows = make_rows(50_000)
    rows[1]["following_error_m"][777, 0] = 1e-3
    write_log(tmp_path / "run.parquet", rows, {"rate_hz": 1000.0})
    query = "log=0&x=x.position_m&y=x.following_error_m&begin_s=0&end_s=50"
    _, _, body = asked([tmp_path / "run.parquet"], (f"/api/plane?{query}", {}))
    told, found = arrays(body)
    assert not told["line"]
    assert len(found["x"]) < 50_000
    lone = found["y"].argmax()
    assert found["y"][lone] == pytest.approx(1e-3, rel=2e-3)
    assert found["x"][lone] == pytest.approx(rows[1]["position_m"][777, 0], abs=1e-3)


@pytest.mark.parametrize(
    ("kinds", "drawn"),
    [
        ({"x": LINEAR, "y": LINEAR}, [["x", "y"]]),
        ({"x": LINEAR, "y": ROTARY}, [["x", "y"]]),
        ({"c": ROTARY, "x": LINEAR, "y": LINEAR}, [["c", "x"], ["x", "y"], ["c", "y"]]),
        ({"y": LINEAR, "x": LINEAR, "c": ROTARY}, [["y", "x"], ["y", "c"], ["x", "c"]]),
    ],
    ids=["plane", "carriage and joint", "led together", "of one unit"],
)
def test_paths_that_a_program_leads_come_first_then_those_of_one_unit(
    tmp_path: Path, kinds: dict[str, AxisUnits], drawn: list[list[str]]
) -> None:
    path = tmp_path / "run.parquet"
    axes = tuple(LogAxis(name, ("inertia", "offset"), units=kinds[name]) for name in kinds)
    led = {"programs": {"ring": {"axes": list(kinds)[:2]}}}
    write_log(path, make_rows(100, len(axes)), {"rate_hz": 1000.0, "config": led}, axes)
    _, _, body = asked([path], ("/api/logs", {}))
    assert json.loads(body)["logs"][0]["paths"] == drawn


def test_on_the_path_of_a_carriage_and_a_joint_each_has_its_own_error(tmp_path: Path) -> None:
    ticks, samples = make_rows(2000)
    samples["reference_m"] = np.column_stack((0.1 * ticks["time_s"], np.sin(ticks["time_s"])))
    samples["following_error_m"] = (2e-6, -3e-5)
    axes = (AXES[0], LogAxis("c", ("inertia", "offset"), units=ROTARY))
    write_log(tmp_path / "run.parquet", (ticks, samples), {"rate_hz": 1000.0}, axes)
    query = "log=0&x=x&y=c&begin_s=0&end_s=2&magnified=1000"
    _, _, body = asked([tmp_path / "run.parquet"], (f"/api/path?{query}", {}))
    told, found = arrays(body)
    assert (told["worst_x"], told["worst_y"]) == pytest.approx((2e-6, 3e-5))
    assert not {"worst", "rms"} & told.keys()  # metres and radians have no distance in common
    assert found["x"] - found["reference_x"] == pytest.approx(2e-3)
    assert found["y"] - found["reference_y"] == pytest.approx(-3e-2)


def test_the_error_of_a_circle_is_drawn_across_its_path(tmp_path: Path) -> None:
    ticks, samples = make_rows(2000)
    angle = 2 * np.pi * ticks["time_s"]
    radius_m, error_m = 0.05, 2e-6
    ahead = np.column_stack((-np.sin(angle), np.cos(angle)))
    out = np.column_stack((np.cos(angle), np.sin(angle)))
    samples["reference_m"] = radius_m * out
    samples["reference_velocity_m_s"] = 2 * np.pi * radius_m * ahead
    samples["following_error_m"] = error_m * out + 1e-4 * ahead  # lagging costs no shape
    write_log(tmp_path / "run.parquet", (ticks, samples), {"rate_hz": 1000.0})
    query = "log=0&x=x&y=y&begin_s=0&end_s=2&magnified=1000"
    _, _, body = asked([tmp_path / "run.parquet"], (f"/api/path?{query}", {}))
    told, found = arrays(body)
    assert told["worst"] == pytest.approx(error_m)
    assert np.hypot(found["x"], found["y"]) == pytest.approx(radius_m + 1000 * error_m)
    assert np.hypot(found["reference_x"], found["reference_y"]) == pytest.approx(radius_m)


def test_what_cannot_be_answered_is_refused_in_words(log: Path) -> None:
    questions = {
        "/api/signals?log=7&columns=a&begin_s=0&end_s=1&pixels=100": "log: 7: there are 1, from 0",
        "/api/signals?log=0&columns=a&begin_s=0&end_s=1&pixels=1e9": "pixels: 1000000000",
        "/api/signals?log=0&columns=a&begin_s=nan&end_s=1&pixels=9": "begin_s: 'nan' is no number",
        "/api/signals?log=0&columns=a&begin_s=2&end_s=1&pixels=9": "begin_s: 2 is after end_s, 1",
        "/api/plane?log=0&x=x.position_m&y=z&begin_s=0&end_s=1": "no column 'z' in run.parquet",
        "/api/path?log=0&x=x&y=y&begin_s=0&end_s=1&magnified=0": "magnified: 0",
        "/api/spectrum?log=0&begin_s=0&end_s=1": "column: is missing",
    }
    answers = asked([log], *((question, {}) for question in questions))
    for (status, _, body), words in zip(answers, questions.values(), strict=True):
        assert (status, words in body.decode()) == (400, True), body


def test_rows_without_an_error_do_not_hide_that_of_the_others(tmp_path: Path) -> None:
    ticks, samples = make_rows(1000)
    samples["reference_velocity_m_s"] = [1.0, 0.0]
    samples["following_error_m"] = 1e-6
    samples["following_error_m"][100, 1] = np.nan
    write_log(tmp_path / "run.parquet", (ticks, samples), {"rate_hz": 1000.0})
    query = "log=0&x=x&y=y&begin_s=0&end_s=2&magnified=10"
    status, _, body = asked([tmp_path / "run.parquet"], (f"/api/path?{query}", {}))
    assert status == 200
    assert arrays(body)[0]["worst"] == pytest.approx(1e-6)


def test_a_log_that_is_broken_is_told_beside_those_that_are_not(log: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.parquet"
    broken.write_bytes(log.read_bytes()[:5000])
    _, _, body = asked([log, broken, tmp_path / "missing.parquet"], ("/api/logs", {}))
    told = json.loads(body)
    assert len(told["logs"]) == 1
    assert any("broken.parquet: a damaged Parquet file" in note for note in told["notes"])
    assert any("missing.parquet: no such file" in note for note in told["notes"])
    with pytest.raises(UsageError, match=r"no log could be opened:\n.*broken\.parquet"):
        Logs.of([broken])


def test_logs_of_different_machines_are_shown_and_said_to_be_so(log: Path, tmp_path: Path) -> None:
    write_log(tmp_path / "other.parquet", make_rows(100), {"rate_hz": 1000.0, "machine": "mill"})
    _, _, body = asked([log, tmp_path / "other.parquet"], ("/api/logs", {}))
    assert json.loads(body)["notes"] == ["the logs are of different machines: bench, mill"]


def test_a_foreign_recording_is_shown_as_far_as_it_goes(tmp_path: Path) -> None:
    write_csv(tmp_path / "slide.csv", columns())
    logs, states, signals = asked(
        [tmp_path / "slide.csv"],
        ("/api/logs", {}),
        ("/api/bands?log=0&begin_s=0&end_s=1", {}),
        ("/api/signals?log=0&columns=slide.position_m&begin_s=0&end_s=1&pixels=20", {}),
    )
    assert json.loads(logs[2])["logs"][0]["axes"] == ["slide"]
    assert json.loads(states[2])["axes"] == {}
    assert len(arrays(signals[2])[1]["slide.position_m"]) == 40


@contextmanager
def recorded(path: Path, rows: Any) -> Iterator[LogWriter]:
    writer = LogWriter(path, {"rate_hz": 1000.0}, AXES)
    writer.append(*rows)
    writer.flush()
    yield writer


def test_a_log_that_is_recorded_grows_and_is_followed_until_it_is_finished(tmp_path: Path) -> None:
    ticks, samples = make_rows(3000)
    with recorded(tmp_path / "run.parquet", (ticks[:1000], samples[:1000])) as writer:
        opened = OpenedLog(tmp_path / "run.parquet")
        assert (opened.unfinished, opened.log.rows, opened.end_s()) == (True, 1000, 0.999)
        writer.append(ticks[1000:], samples[1000:])
        writer.flush()
        assert opened.log.rows == 1000
        opened.refresh()
        assert (opened.unfinished, opened.log.rows) == (True, 3000)
        writer.close({})
        opened.refresh()
        assert (opened.unfinished, opened.log.rows) == (False, 3000)


def test_a_file_of_one_row_opens_and_an_empty_log_says_that_it_has_none(tmp_path: Path) -> None:
    write_log(tmp_path / "one.parquet", make_rows(1), {"rate_hz": 1000.0})
    write_log(tmp_path / "none.parquet", make_rows(0), {"rate_hz": 1000.0})
    question = "/api/signals?log=0&columns=x.position_m&begin_s=-1&end_s=1&pixels=100"
    told, found = arrays(asked([tmp_path / "one.parquet"], (question, {}))[2])
    assert (told["every_row"], len(found["time_s"])) == (True, 1)
    with pytest.raises(DataError, match="no row"):
        OpenedLog(tmp_path / "none.parquet")


def test_a_fault_among_many_changes_is_still_told(tmp_path: Path) -> None:
    ticks, samples = make_rows(20_000)
    samples["state"][:, 0] = np.where(np.arange(20_000) // 10 % 2, AxisState.IDLE, AxisState.OFF)
    samples["state"][12_345:12_350, 0] = AxisState.FAULT
    samples["fault"][12_345:12_350, 0] = FaultCause.ESTOP
    write_log(tmp_path / "run.parquet", (ticks, samples), {"rate_hz": 1000.0})
    _, _, body = asked([tmp_path / "run.parquet"], ("/api/bands?log=0&begin_s=0&end_s=20", {}))
    stretches = json.loads(body)["axes"]["x"]
    assert len(stretches) <= 401
    (fault,) = (stretch for stretch in stretches if stretch["state"] == "fault")
    assert fault["fault"] == "estop"
    assert fault["from_s"] <= 12.345 <= fault["to_s"]
    _, _, body = asked([tmp_path / "run.parquet"], ("/api/bands?log=0&begin_s=12.3&end_s=12.4", {}))
    words = [(s["state"], s["from_s"]) for s in json.loads(body)["axes"]["x"]]
    assert ("fault", 12.345) in words
    assert words[0] == ("off" if 12_299 // 10 % 2 == 0 else "idle", 12.299)
