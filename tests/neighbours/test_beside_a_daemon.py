"""Prometheus and PlotJuggler beside a running daemon: both have what it knows, until it ends."""

from __future__ import annotations

import os
import subprocess
import sys
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from daemon_rig import Daemon, wait_until
from grafana_dashboard import names
from listening_socket import listening
from prometheus_client.parser import text_string_to_metric_families

OF_SOME_MACHINES = {"motorctl_axis_motor_load_ratio"}
"""Only axes of which the motor is known have it."""
COMMAND = "import motorctl.cli as c; c.GROUPS = ('metrics', 'stream'); c.main()"


def beside(*words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", COMMAND, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )


def scraped(url: str) -> dict[str, list[float]]:
    with urllib.request.urlopen(url, timeout=20) as answer:
        text = answer.read().decode()
    found: dict[str, list[float]] = {}
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            found.setdefault(sample.name, []).append(sample.value)
    return found


def nicenesses(process: subprocess.Popen[str]) -> set[int]:
    """Return how much nicer than this one its threads are."""
    own = os.getpriority(os.PRIO_PROCESS, 0)
    tasks = [int(task.name) for task in Path(f"/proc/{process.pid}/task").iterdir()]
    return {os.getpriority(os.PRIO_PROCESS, task) - own for task in tasks}


@pytest.mark.slow
@pytest.mark.wall_clock(lanes=3)
def test_every_panel_has_a_value_and_every_message_its_time_until_the_daemon_ends(
    tmp_path: Path,
) -> None:
    received: list[dict[str, Any]] = []
    with Daemon(tmp_path / "d") as daemon, listening(received) as url:
        exporter = beside("metrics", "--port", "0", *daemon.at)
        streaming = beside("stream", "--plotjuggler", url, *daemon.at)
        try:
            daemon.hold("x")
            assert exporter.stdout is not None
            page = exporter.stdout.readline().split()[0]
            assert scraped(page)["motorctl_up"] == [1.0]
            # The disk is looked at in a thread, when the loop ticks already.
            wait_until(lambda: names() - OF_SOME_MACHINES <= scraped(page).keys())
            told = scraped(page)
            assert sum(told["motorctl_axis_state"]) == 2.0  # of each axis one
            wait_until(lambda: len(received) >= 100)
            assert nicenesses(exporter) == nicenesses(streaming) == {5}
            daemon.end()
            ended, _ = streaming.communicate(timeout=30)
            assert scraped(page)["motorctl_up"] == [0.0]
        finally:
            for process in (exporter, streaming):
                process.kill()
                process.communicate()
    assert streaming.returncode == 0
    assert f"messages sent to {url}" in ended
    assert {"timestamp", "turnaround_s", "x", "y"} <= received[0].keys()
    assert {"position_m", "following_error_m", "state"} <= received[0]["x"].keys()
    times = np.array([message["timestamp"] for message in received])
    assert np.all(np.diff(times) > 0)
    assert np.median(np.diff(times)) == pytest.approx(1 / 200, rel=0.01)
