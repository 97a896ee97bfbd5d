"""Samples to PlotJuggler: every peak, its own time, JSON over UDP."""

from __future__ import annotations

import json
import socket
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from listening_socket import PLACE, listening
from recorded_ring import AXES, ring
from recorded_rows import make_rows, write_log

import motorctl
from motorctl.api.samples import Samples
from motorctl.cli import main
from motorctl.errors import RunError, UsageError
from motorctl.log.columns import log_columns
from motorctl.neighbours.plotjuggler import Destination, datagrams
from motorctl.neighbours.streaming import replay, send_samples
from motorctl.neighbours.thinning import stretch_rows, thinned


@given(arrays(np.float64, st.integers(0, 60), elements=st.floats(-1e3, 1e3)), st.integers(2, 9))
def test_thinned_rows_keep_the_extremes_of_each_stretch_in_their_order(
    values: np.ndarray, rows: int
) -> None:
    kept = thinned({"time_s": np.arange(len(values)) / 10, "a": values}, rows)
    whole = len(values) // rows
    assert len(kept["a"]) == len(kept["time_s"]) == 2 * whole
    assert np.all(np.diff(kept["time_s"]) > 0)
    for k in range(whole):
        stretch = values[k * rows : (k + 1) * rows].tolist()
        pair = kept["a"][2 * k : 2 * k + 2].tolist()
        assert sorted(pair) == [min(stretch), max(stretch)]
        assert stretch.index(pair[0]) <= stretch.index(pair[1])


def test_of_bits_none_is_lost_and_what_is_no_number_hides_no_peak() -> None:
    flags = np.zeros(8, np.uint32)
    flags[[1, 2, 6]] = 1, 4, 16
    values = np.array([np.nan, 1.0, 5.0, np.nan, 2.0, 1.0, 0.5, 3.0])
    kept = thinned({"time_s": np.arange(8.0), "flags": flags, "a": values}, 8)
    assert kept["flags"].tolist() == [5, 16]
    assert kept["a"].tolist() == [5.0, 0.5]
    assert kept["time_s"].tolist() == [2.0, 6.0]


@pytest.mark.parametrize(
    ("row_hz", "message_hz", "rows"), [(5000, 200, 50), (1000, 999, 3), (400, 400, 1), (10, 200, 1)]
)
def test_no_more_messages_are_sent_than_asked_for(row_hz: int, message_hz: int, rows: int) -> None:
    assert stretch_rows(row_hz, message_hz) == rows
    assert rows == 1 or 2 * row_hz / rows <= message_hz


def test_a_message_has_the_time_under_timestamp_and_an_object_an_axis() -> None:
    columns = {
        "time_s": np.array([0.25]),
        "x.position_m": np.array([0.1]),
        "x.state": np.array([3], np.int32),
        "y.d0_hat_v": np.array([np.nan]),
        "lateness_s": np.array([1e-6]),
    }
    ((t, datagram),) = datagrams(columns)
    assert t == 0.25
    # A single object: PlotJuggler takes arrays of them only since 2026. JSON knows no NaN.
    assert json.loads(datagram) == {
        "timestamp": 0.25,
        "x": {"position_m": 0.1, "state": 3},
        "lateness_s": 1e-6,
    }


@pytest.mark.wall_clock(lanes=3)
def test_a_log_is_sent_in_its_own_time_with_every_peak(tmp_path: Path) -> None:
    rows = make_rows(1000)
    rows[1]["following_error_m"][437, 0] = 0.02  # one row at 1 kHz, of messages at 100 Hz
    path = write_log(tmp_path / "run.parquet", rows, {"rate_hz": 1000.0})
    received: list[dict[str, Any]] = []
    with listening(received) as url, Destination(url) as destination:
        began = time.monotonic()
        replay(motorctl.open_log(path), destination, 100.0, 4.0, ["x.*", "turnaround_s"])
        took_s = time.monotonic() - began
    assert took_s >= 0.24  # a second of it, four times as fast
    assert len(received) == destination.sent == 100
    times = [message["timestamp"] for message in received]
    assert times == pytest.approx(np.arange(100) * 0.01 + 0.005)
    assert max(message["x"]["following_error_m"] for message in received) == 0.02
    assert all(message.keys() == {"timestamp", "turnaround_s", "x"} for message in received)


@pytest.mark.wall_clock(lanes=3)
def test_rows_of_a_machine_are_joined_over_looks_and_none_is_left(tmp_path: Path) -> None:
    received: list[dict[str, Any]] = []
    with ring() as filled, listening(received) as url, Destination(url) as destination:

        def heard() -> Iterator[Samples]:
            names = {column.name: column for column in log_columns(AXES)}
            for count in (7, 40, 3, 53):
                filled.run(count)
                yield Samples(*filled.take(), names, 0, 0, AXES)

        send_samples(heard(), destination, 1000.0, 200.0, ["tick"])
    ticks = [message["tick"] for message in received]
    assert ticks == [t for first in range(0, 100, 10) for t in (first, first + 9)] + [100, 102]


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("127.0.0.1:9870", r"should be udp://HOST or udp://HOST:PORT \(usual: 9870\)"),
        ("tcp://127.0.0.1", "should be udp://HOST"),
        ("udp://", "should be udp://HOST"),
        ("udp://127.0.0.1:99999", "Port out of range"),
        ("udp://127.0.0.1/topic", "should be udp://HOST"),
        ("udp://127.0.0.1:0", "port 0 is none"),
    ],
)
def test_an_address_that_is_none_is_refused(url: str, why: str) -> None:
    with pytest.raises(UsageError, match=why):
        Destination(url)


def test_a_row_that_no_datagram_holds_is_refused_and_a_host_that_is_none_told() -> None:
    with (
        Destination(f"udp://{PLACE}:9") as destination,
        pytest.raises(UsageError, match="--column"),
    ):
        destination.send(b" " * 65508)
    with pytest.raises(RunError, match="no such host"):
        Destination("udp://no-such-host.invalid")


@pytest.mark.wall_clock(lanes=3)
def test_where_nobody_listens_that_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = write_log(tmp_path / "run.parquet", make_rows(200), {"rate_hz": 1000.0})
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind((PLACE, 0))
        port = taken.getsockname()[1]
    words = ["stream", str(path), "--plotjuggler", f"udp://{PLACE}:{port}", "--speed", "10"]
    monkeypatch.setattr(sys, "argv", ["motorctl", *words])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 0
    told = capsys.readouterr().out
    assert "40 messages sent" in told
    assert "were refused there: start PlotJuggler's UDP Server" in told


def test_a_column_that_is_not_there_is_told_with_those_that_are(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = write_log(tmp_path / "run.parquet", make_rows(10), {"rate_hz": 1000.0})
    url = f"udp://{PLACE}:9"
    words = ["stream", str(path), "--plotjuggler", url, "--column", "z.*"]
    monkeypatch.setattr(sys, "argv", ["motorctl", *words])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    assert "--column z.*: no such column; there are: tick, time_s" in capsys.readouterr().err
