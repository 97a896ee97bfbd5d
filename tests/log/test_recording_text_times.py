"""Dates and times of day in a text file are times: loggers write them more often than seconds."""

from datetime import datetime, timedelta

import numpy as np
import pytest

from motorctl.errors import DataError
from motorctl.log import read_recording

RATE_HZ = 20.0
START = datetime(2025, 11, 9, 23, 59, 58)


def described(tmp_path, stamps, time="time: {column: stamp}", position="x", separator=","):
    rows = [f"stamp{separator}x{separator}u"]
    rows += [
        separator.join([stamp, f"{np.sin(0.1 * k):.6f}", f"{np.cos(0.1 * k):.6f}"])
        for k, stamp in enumerate(stamps)
    ]
    (tmp_path / "a.csv").write_text("\n".join(rows) + "\n")
    path = tmp_path / "a.yaml"
    path.write_text(
        f"file: a.csv\n{time}\naxes:\n  x:\n    position: {{column: {position}, unit: rad}}\n"
        "    command: {column: u, unit: A}\n"
    )
    return path


def stamps(form, count=100):
    return [form(START + timedelta(seconds=k / RATE_HZ)) for k in range(count)]


@pytest.mark.parametrize(
    "form",
    [
        lambda t: t.isoformat(timespec="milliseconds") + "Z",
        lambda t: t.isoformat(timespec="microseconds") + "+01:00",
        str,
        lambda t: t.isoformat(sep=" ", timespec="milliseconds"),
        lambda t: t.strftime("%H:%M:%S.%f"),
        lambda t: t.strftime("%H:%M:%S.%f")[:-3],
    ],
    ids=["utc", "offset", "str", "milliseconds", "time of day", "time of day, milliseconds"],
)
def test_times_that_run_over_midnight_become_seconds_and_are_told(tmp_path, form):
    recording = read_recording(described(tmp_path, stamps(form)))
    assert recording.sample_rate_hz == pytest.approx(RATE_HZ)
    np.testing.assert_allclose(recording.time_s, np.arange(100) / RATE_HZ, atol=1e-6)
    np.testing.assert_allclose(
        recording.axes["x"].position, np.sin(0.1 * np.arange(100)), atol=1e-6
    )
    assert any("column 'stamp' has times, the first" in note for note in recording.notes)


def test_a_semicolon_and_a_unit_that_is_not_theirs_do_not_change_times(tmp_path):
    own = stamps(lambda t: t.isoformat(timespec="milliseconds"))
    path = described(tmp_path, own, "time: {column: stamp, unit: ms}", separator=";")
    assert read_recording(path).sample_rate_hz == pytest.approx(RATE_HZ)


def test_a_line_that_is_no_time_is_told_by_its_number(tmp_path):
    own = stamps(lambda t: t.isoformat(timespec="milliseconds"))
    own[50] = "pause"
    with pytest.raises(DataError, match=r"line 52\): column 'stamp' is not a time .*'pause'"):
        read_recording(described(tmp_path, own))


def test_times_are_no_positions(tmp_path):
    own = stamps(lambda t: t.isoformat(timespec="milliseconds"))
    with pytest.raises(DataError, match=r"axes\.x\.position\.column: column 'stamp' .* has times"):
        read_recording(described(tmp_path, own, "sample_rate_hz: 20", position="stamp"))
