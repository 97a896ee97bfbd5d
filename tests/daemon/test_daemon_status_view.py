"""The status picture: everything a document can hold is drawn, within 80 columns."""

from __future__ import annotations

import copy
import io
from typing import Any

import pytest
from rich.console import Console

from motorctl.cli.status_view import status_view

AXIS: dict[str, Any] = {
    "state": "running",
    "fault": None,
    "device": None,
    "samples": {"missed": 0, "longest_missed": 0, "allowed": 50},
    "homed": True,
    "controller": "C2",
    "position_m": 0.1234567,
    "velocity_m_s": 0.5,
    "reference_m": 0.1234444,
    "following_error_m": 12.3e-6,
    "command_v": -9.87,
    "travel_m": [-0.05, 0.45],
    "max_voltage_v": 10,
    "motion": {"name": "published_x", "elapsed_s": 12.3, "approach_s": 0.4, "duration_s": 42.4},
    "d0_hat_v": 0.01,
    "theta_hat": {"inertia": 0.19, "position_dependent_friction_spline_12": 1e-9},
}
TIMING = {"p50_s": 11e-6, "p99_s": 23e-6, "p999_s": 1e-4, "max_s": 1.2e-3, "max_at_s": 3.21}
DOCUMENT: dict[str, Any] = {
    "machine": "published-gantry",
    "daemon": {
        "socket": "/run/motorctl/motorctl.sock",
        "uptime_s": 3723.4,
        "stopping": False,
        "config": "left.yaml",
    },
    "loop": {
        "phase": "running",
        "rate_hz": 5000.0,
        "ticks": 18_617_000,
        "overruns": 0,
        "skipped_periods": 0,
        "waits": False,
        "degraded": [],
        "turnaround": TIMING,
        "lateness": TIMING,
    },
    "recording": {
        "file": "/var/log/motorctl/published-gantry-20260101T120000Z.parquet",
        "rows": 18_616_000,
        "rows_lost": 0,
        "failure": None,
    },
    "axes": {"x": AXIS, "y": {**AXIS, "state": "idle", "motion": None}},
}

ROOM = {"free_mb": 230_000.0, "closed_mb_h": 1480.2, "hours_left": 155.0, "warning": None}
LOST = {
    **DOCUMENT["recording"],
    "rows": 1_200_000,
    "rows_lost": 7,
    "lost_because": "memory holds the rows of 8.0 s, and the disk took 15.8 s over those before",
}
REMOVED = {"removed": 3, "removed_mb": 1234.0, "because": "free space", "failure": None}


DUAL = {
    "skew_m": -312.4e-6,
    "skew_reference_m": 0.0,
    "skew_command_v": 1.234,
    "skew_limit_m": 1e-3,
    "second_device": None,
}


def drawn(document: dict[str, Any], *, detailed: bool = False, width: int = 80) -> str:
    console = Console(file=io.StringIO(), width=width, force_terminal=False)
    console.print(status_view(document, detailed=detailed))
    file = console.file
    assert isinstance(file, io.StringIO)
    text = file.getvalue()
    assert max(map(len, text.splitlines())) <= width
    assert "…" not in text
    return text


def changed(path: str, value: Any) -> dict[str, Any]:
    document = copy.deepcopy(DOCUMENT)
    *parents, last = path.split(".")
    place = document
    for key in parents:
        place = place[key]
    place[last] = value
    return document


def test_in_a_narrow_terminal_the_drawing_of_the_travel_goes_and_no_number_is_cut() -> None:
    text = drawn(DOCUMENT, width=50)
    for part in ("running", "123.4567 mm", "+12.3 µm", "-9.87 V"):
        assert part in text
    assert "├" not in text
    assert "├" in drawn(DOCUMENT)


def test_a_path_that_one_line_does_not_hold_is_broken_before_the_files_name() -> None:
    name = "published-gantry-20260101T120000Z.parquet"
    text = drawn(changed("recording.file", f"/home/somebody/projects/stage/logs/{name}"))
    assert f" {name} " in text
    assert " /home/somebody/projects/stage/logs/ " in text


def test_an_estimate_is_told_with_its_unit() -> None:
    units = {"inertia": "V*s^2/m", "position_dependent_friction_spline_12": ""}
    lines = drawn(changed("axes.x.theta_units", units), detailed=True).splitlines()
    assert any(line.split()[1:4] == ["inertia", "0.19", "V*s^2/m"] for line in lines)
    assert any(line.split()[1:4] == ["d0", "0.01", "V"] for line in lines)


def test_an_axis_that_is_excited_is_told_with_the_time_that_is_left() -> None:
    assert "y: excited for 17 s more" in drawn(changed("axes.y.excitation", {"left_s": 17.2}))
    assert "excited" not in drawn(changed("axes.y.excitation", None))


def test_models_on_trial_are_told_with_the_motions_that_are_left() -> None:
    shown = drawn(changed("axes.x.trial_motions_left", 2))
    assert "x: other models on trial, 2 motions left" in shown
    assert "trial" not in drawn(changed("axes.x.trial_motions_left", None))


def test_what_matters_is_on_it() -> None:
    text = drawn(DOCUMENT)
    for part in (
        "published-gantry",
        "● running  5000 Hz  up 1:02:03",
        "123.4567 mm",
        "+12.3 µm",
        "-9.87 V",
        "x follows published_x",
        "12.3 of 42.4 s",
        "median 11.0 µs   p99 23.0 µs   worst 1.20 ms at 3.2 s",
        "18,616,000 ticks, 0 lost",
    ):
        assert part in text


@pytest.mark.parametrize(
    ("path", "value", "shown"),
    [
        ("axes.x.fault", {"cause": "estop", "message": "emergency stop, at 3 s"}, "x: emergency"),
        ("axes.x.homed", False, "not homed"),
        ("axes.x.position_m", None, "–"),
        ("loop.turnaround", None, "turnaround  –"),
        ("loop.degraded", ["the kernel is not PREEMPT_RT"], "! the kernel is not"),
        ("loop.overruns", 1234, "1,234, 0 periods skipped"),
        ("recording.failure", "run.partial: No space left", "No space left"),
        ("recording", LOST, "1,200,000 ticks, 7 lost"),
        ("recording", LOST, "lost: memory holds the rows of 8.0 s, and the disk took"),
        ("recording.file", None, "overruns"),
        ("recording.paused", True, "paused: every axis is off"),
        ("recording.trouble", "the next log cannot be begun", "the next log cannot"),
        ("recording.conversion", {"failure": "a.partial: No space left"}, "a.partial: No space"),
        ("recording.disk", ROOM, "1,480 MB an hour are kept; 230.0 GB free, enough for 6 days"),
        ("recording.disk", {**ROOM, "hours_left": None}, "230.0 GB free  "),
        ("recording.disk", {**ROOM, "warning": "recording can go on for 3 h"}, "go on for 3 h"),
        ("recording.retention", REMOVED, "3 old logs removed, 1.2 GB: free space"),
        ("daemon.stopping", True, "● stopping"),
        ("daemon.config_difference", "was changed", "! left.yaml was changed since it was read"),
    ],
)
def test_what_is_wrong_is_on_it(path: str, value: Any, shown: str) -> None:
    assert shown in drawn(changed(path, value))


@pytest.mark.parametrize(("position_m", "cell"), [(-9.0, 0), (-0.05, 0), (0.2, 6), (9.0, 12)])
def test_the_dot_stands_where_the_axis_stands(position_m: float, cell: int) -> None:
    text = drawn(changed("axes.x.position_m", position_m))
    row = next(line for line in text.splitlines() if "running" in line and "├" in line)
    bar = row[row.index("├") + 1 : row.index("┤")]
    assert bar.index("●") == cell


def test_one_axis_shows_its_parameters() -> None:
    assert "position_dependent_friction_spline_12" in drawn(DOCUMENT, detailed=True)
    assert "spline_12" not in drawn(DOCUMENT)


def test_samples_that_are_missing_and_a_device_in_trouble_are_told_whatever_the_state():
    document = copy.deepcopy(DOCUMENT)
    document["axes"]["x"]["samples"] = {"missed": 932, "longest_missed": 4, "allowed": 50}
    document["axes"]["y"] |= {"state": "off", "device": "no new sample comes"}
    text = " ".join(drawn(document).split())
    assert "x: 932 ticks without a new sample, at most 4 in a row; 50 are allowed" in text
    assert "y: its device now: no new sample comes" in text
    document["axes"]["x"]["samples"]["lost"] = True
    text = " ".join(drawn(document).split())
    assert "x: device lost; before that 932 ticks without a sample, at most 4 in a row" in text
    assert "are allowed" not in text


def test_an_axis_with_two_motors_shows_its_skew_and_how_far_it_may_go():
    document = copy.deepcopy(DOCUMENT)
    document["axes"]["x"]["dual_drive"] = DUAL
    lines = [line for line in drawn(document).splitlines() if "skew" in line]
    assert len(lines) == 1
    assert "x skew -312.4 µm of 1000 µm, held by +1.23 V" in lines[0]
    document["axes"]["x"]["dual_drive"] = {**DUAL, "skew_m": None}
    assert "x skew – of 1000 µm" in drawn(document)
