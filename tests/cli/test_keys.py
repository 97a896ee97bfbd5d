"""Single keys of a terminal: the one that stops is obeyed whatever the command is busy with."""

from __future__ import annotations

import os
import pty
import termios
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from motorctl.cli.keys import Keys, single_keys

LONG_S = 20.0


@contextmanager
def at_a_terminal(
    monkeypatch: pytest.MonkeyPatch, stop: threading.Event | None = None, ends: str = "q"
) -> Iterator[tuple[int, Keys]]:
    """Yield a person's end of a terminal, and the keys that are read from the other one."""
    person, terminal = pty.openpty()
    try:
        with os.fdopen(terminal, "r", closefd=False) as stdin:
            monkeypatch.setattr("sys.stdin", stdin)
            with single_keys((stop or threading.Event()).set, ends) as keys:
                assert keys is not None
                yield person, keys
    finally:
        os.close(terminal)
        os.close(person)


def test_a_space_stops_though_nobody_asks_for_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    stop = threading.Event()
    with at_a_terminal(monkeypatch, stop) as (person, keys):
        os.write(person, b" ")
        assert stop.wait(LONG_S)
        assert keys.next(LONG_S) == " "
        assert keys.stopped


def test_a_space_behind_other_keys_still_stops(monkeypatch: pytest.MonkeyPatch) -> None:
    stop = threading.Event()
    with at_a_terminal(monkeypatch, stop) as (person, _):
        os.write(person, b"\x1b[C\x1b[C\x1b[C xq")
        assert stop.wait(LONG_S)


@pytest.mark.parametrize(
    ("pressed", "key"), [(b"\x1b[C", "right"), (b"\x1b[D", "left"), (b"\x1bOA", "up"), (b"s", "s")]
)
def test_a_key_is_told_by_its_name(
    monkeypatch: pytest.MonkeyPatch, pressed: bytes, key: str
) -> None:
    with at_a_terminal(monkeypatch) as (person, keys):
        os.write(person, pressed)
        assert keys.next(LONG_S) == key


def test_a_key_that_is_held_down_is_one_press_once_somebody_asks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with at_a_terminal(monkeypatch) as (person, keys):
        for _ in range(40):
            os.write(person, b"\x1b[C")
        assert keys.next(LONG_S) == "right"
        while keys.next(0.2) == "right":  # those that came after it was asked for
            pass
        assert keys.next(0.0) is None


@pytest.mark.parametrize(
    "pressed",
    [
        [b"\x1b[C\x1b[Cs"],
        [b"s", b"\x1b[C", b"\x1b[C"],
        [b"\x1b[Cs\x1b[C\x1b[1;5C"],
        [b"\x1b[1;5s\x1b[C", b"s"],
    ],
    ids=["in one piece", "before others", "between others", "after one that means nothing"],
)
def test_a_key_that_ends_something_is_not_lost_among_others(
    monkeypatch: pytest.MonkeyPatch, pressed: list[bytes]
) -> None:
    with at_a_terminal(monkeypatch, ends="qs") as (person, keys):
        for piece in pressed:
            os.write(person, piece)
            time.sleep(0.02)  # a read of its own
        assert keys.next(LONG_S) == "s"


def test_letters_of_other_keys_are_no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    with at_a_terminal(monkeypatch, ends="qs") as (person, keys):
        os.write(person, b"\x1b[1;5q\x1bs\x1bOq\x1b[3~")
        assert keys.next(LONG_S) == " "
        assert keys.next(0.1) is None
        assert not keys.stopped


def test_a_terminal_that_is_gone_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    person, terminal = pty.openpty()
    with os.fdopen(terminal, "r") as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        with single_keys(lambda: None) as keys:
            assert keys is not None
            os.close(person)
            assert keys.next(LONG_S) == "q"


def test_a_stop_that_fails_is_told_and_not_swallowed(monkeypatch: pytest.MonkeyPatch) -> None:
    person, terminal = pty.openpty()

    def broken() -> None:
        raise OSError("no daemon there")

    try:
        with os.fdopen(terminal, "r", closefd=False) as stdin:
            monkeypatch.setattr("sys.stdin", stdin)
            with single_keys(broken) as keys:
                assert keys is not None
                os.write(person, b" ")
                with pytest.raises(OSError, match="no daemon there"):
                    keys.next(LONG_S)
    finally:
        os.close(terminal)
        os.close(person)


def test_the_terminal_is_left_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    person, terminal = pty.openpty()
    try:
        before = termios.tcgetattr(terminal)
        with os.fdopen(terminal, "r", closefd=False) as stdin:
            monkeypatch.setattr("sys.stdin", stdin)
            with single_keys(lambda: None):
                assert termios.tcgetattr(terminal) != before
        assert termios.tcgetattr(terminal) == before
    finally:
        os.close(terminal)
        os.close(person)


def test_without_a_terminal_there_are_no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    read, write = os.pipe()
    try:
        with os.fdopen(read, "r") as stdin:
            monkeypatch.setattr("sys.stdin", stdin)
            with single_keys(lambda: None) as keys:
                assert keys is None
    finally:
        os.close(write)
