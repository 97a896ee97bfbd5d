"""A person at a terminal: the space bar stops every axis, arrows move one by a step."""

from __future__ import annotations

import os
import pty
import select
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from daemon_rig import Daemon, command, wait_until

pytestmark = pytest.mark.wall_clock(lanes=3)

PATIENCE_S = 30.0


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    with Daemon(tmp_path_factory.mktemp("daemon")) as running:
        yield running


@pytest.fixture
def idle(daemon: Daemon) -> Daemon:
    daemon.hold("x", "y")
    return daemon


class Person:
    """Who presses keys and reads what is shown."""

    def __init__(self, terminal: int) -> None:
        self._terminal = terminal
        self.seen = b""

    def press(self, keys: bytes) -> None:
        os.write(self._terminal, keys)

    def sees(self, words: str) -> None:
        """Wait until something is shown."""
        end = time.monotonic() + PATIENCE_S
        while words.encode() not in self.seen:
            assert time.monotonic() < end, self.seen[-2000:]
            if select.select([self._terminal], [], [], 0.1)[0]:
                self.seen += os.read(self._terminal, 1 << 16)


@contextmanager
def person_at(daemon: Daemon, *words: str) -> Iterator[tuple[Person, subprocess.Popen[bytes]]]:
    person, terminal = pty.openpty()
    process = subprocess.Popen(
        command(*words, *daemon.at), stdin=terminal, stdout=terminal, stderr=terminal
    )
    os.close(terminal)
    try:
        yield Person(person), process
    finally:
        process.kill()
        process.wait()
        os.close(person)


def test_a_space_in_the_live_status_stops_every_axis(idle: Daemon) -> None:
    with person_at(idle, "status", "--watch") as (person, process):
        person.sees("space: emergency stop")
        person.press(b" ")
        wait_until(lambda: (idle.state("x"), idle.state("y")) == ("fault", "fault"))
        assert idle.ask("status", axis="x")["axes"]["x"]["fault"]["cause"] == "estop"
        person.press(b"q")
        assert process.wait(PATIENCE_S) == 0


def test_arrows_move_by_a_step_and_s_ramps_down(idle: Daemon) -> None:
    held_m = idle.ask("status", axis="x")["axes"]["x"]["reference_m"]
    with person_at(idle, "jog", "x", "--step", "2mm") as (person, process):
        person.sees("step 2 mm")
        person.press(b"\x1b[C")

        def reference_m() -> float:
            return float(idle.ask("status", axis="x")["axes"]["x"]["reference_m"])

        wait_until(lambda: abs(reference_m() - held_m - 0.002) < 1e-9)
        wait_until(lambda: idle.state("x") == "idle")
        person.press(b"s")
        assert process.wait(PATIENCE_S) == 0
        person.sees("axis x: off")
    assert idle.state("x") == "off"
    assert idle.state("y") == "idle"


def test_a_step_beyond_the_travel_is_told_and_nothing_moves(idle: Daemon) -> None:
    idle.ask("move", axis="x", position_m=0.449)
    wait_until(lambda: idle.state("x") == "idle")
    with person_at(idle, "jog", "x", "--step", "10mm") as (person, process):
        person.sees("step 10 mm")
        person.press(b"\x1b[C")
        person.sees("must lie within")
        person.press(b"q")
        assert process.wait(PATIENCE_S) == 0
        person.sees("axis x: holds")
    assert idle.state("x") == "idle"


def test_jogging_needs_an_axis_that_holds_and_a_terminal(idle: Daemon, tmp_path: Path) -> None:
    piped = idle.cli("jog", "x")
    assert piped.returncode == 2
    assert "jog needs a terminal; elsewhere: motorctl move" in piped.stderr
    idle.ask("stop", axis="y")
    wait_until(lambda: idle.state("y") == "off")
    with person_at(idle, "jog", "y") as (person, process):
        person.sees("`motorctl start y --hold` first")
        assert process.wait(PATIENCE_S) == 2
