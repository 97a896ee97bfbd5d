"""`motorctl response` through a running daemon: on the wall clock, on the bench."""

from __future__ import annotations

import json
import math
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from daemon_rig import Daemon, wait_until
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.daemon.client import Client
from motorctl.errors import MotorctlError, RunError, UsageError
from motorctl.response import rigs

pytestmark = [pytest.mark.wall_clock(lanes=3), pytest.mark.slow]
WAVE = [0.1 * math.sin(2.0 * math.pi * k / 200.0) for k in range(200)]
QUICK = ("--band", "4,60", "--amplitude", "1.5", "--yes")


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    with Daemon(tmp_path_factory.mktemp("response")) as one:
        yield one


@pytest.fixture
def daemon(running: Daemon) -> Daemon:
    """Both axes without drive, whatever the test before left behind."""
    running.switch_off("x", "y")
    return running


def respond(daemon: Daemon, *words: object) -> Any:
    arguments = ["response", *daemon.at, *QUICK, *map(str, words)]
    result = CliRunner().invoke(make_app(), arguments)
    if isinstance(result.exception, MotorctlError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result


def test_an_axis_that_is_off_is_not_moved_and_what_comes_first_is_told(daemon: Daemon) -> None:
    with pytest.raises(UsageError, match=r"x is off: .* `motorctl start x --hold` first"):
        respond(daemon, "x")
    assert daemon.state("x") == "off"


def test_an_axis_that_is_excited_already_is_left_to_it(daemon: Daemon) -> None:
    daemon.ask_when_it_stands("start", "x", hold=True)
    with Client(daemon.socket) as other:
        other.ask("excite", axis="x", volts=WAVE, periods=200, fade_periods=1)
        with pytest.raises(UsageError, match="axis x is being excited already, for another"):
            respond(daemon, "x", "--standing")
        assert daemon.ask("status")["axes"]["x"]["excitation"]


def test_an_axis_whose_client_is_gone_is_excited_no_longer_and_stopped(daemon: Daemon) -> None:
    daemon.ask_when_it_stands("start", "x", hold=True)
    # A killed process leaves no more behind than a connection that is closed.
    with Client(daemon.socket) as gone:
        gone.ask("excite", axis="x", volts=WAVE, periods=2000, fade_periods=1)
        assert daemon.ask("status")["axes"]["x"]["excitation"]["left_s"] > 900.0
    wait_until(lambda: daemon.state("x") == "off", 10.0)
    assert daemon.ask("status")["axes"]["x"]["excitation"] is None
    assert "axis x: who excited it is gone: it is stopped" in daemon.said


def test_ctrl_c_stops_the_axis_and_takes_the_excitation_with_it(
    daemon: Daemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    daemon.ask_when_it_stands("start", "x", hold=True)
    waited = rigs._wait

    def interrupted(client: Any, name: str, seconds: float, what: str, progress: Any) -> None:
        if what != "exciting the axis":
            waited(client, name, seconds, what, progress)
            return
        assert daemon.ask("status")["axes"]["x"]["excitation"]
        raise KeyboardInterrupt

    monkeypatch.setattr(rigs, "_wait", interrupted)
    arguments = ["response", "x", *daemon.at, *QUICK, "--periods", "100"]
    assert CliRunner().invoke(make_app(), arguments).exit_code != 0
    wait_until(lambda: daemon.state("x") == "off", 10.0)
    assert daemon.ask("status")["axes"]["x"]["excitation"] is None


def test_a_running_axis_is_measured_and_holds_again(daemon: Daemon, tmp_path: Path) -> None:
    daemon.ask_when_it_stands("start", "x")
    # Short periods, and more than are needed: a computer that skips a tick spoils one of them.
    words = ("--band", "12,150", "--periods", "20", "--out", tmp_path, "--json")
    told = json.loads(respond(daemon, "x", *words).stdout)
    assert daemon.state("x") == "idle"
    assert daemon.ask("status")["axes"]["x"]["excitation"] is None
    coherent = [f for f, c in zip(told["frequency_hz"], told["coherent"], strict=True) if c]
    assert len(coherent) >= 8
    assert told["fitted"]["parameters"]["theta1_v_s2_m"]["value"] == pytest.approx(0.2, rel=0.1)
    assert {Path(file).suffix for file in told["files"]} == {".png", ".json", ".parquet"}
    daemon.ask("stop", axis="x")
    wait_until(lambda: daemon.state("x") == "off")


def test_a_fault_meanwhile_ends_it_with_its_words_and_the_daemon_keeps_the_log(
    daemon: Daemon, tmp_path: Path
) -> None:
    daemon.ask_when_it_stands("start", "x")

    def press() -> None:
        deadline = time.monotonic() + 60.0
        while time.monotonic() < deadline:
            if daemon.ask("status")["axes"]["x"]["excitation"]:
                daemon.ask("estop")
                return
            time.sleep(0.02)

    pressing = threading.Thread(target=press)
    pressing.start()
    try:
        with pytest.raises(RunError, match=r"fault.* what was recorded is in the daemon's log"):
            respond(daemon, "x", "--periods", "200")
    finally:
        pressing.join()
    assert daemon.state("x") == "fault"
    assert daemon.ask("status")["axes"]["x"]["excitation"] is None
    with pytest.raises(UsageError, match=r"x is in fault: .* `motorctl reset x`, then"):
        respond(daemon, "x")
