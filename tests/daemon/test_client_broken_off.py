"""A client whose request was broken off: no answer is taken for another's, nothing more is sent."""

from __future__ import annotations

import contextlib
import json
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import motorctl
from motorctl.daemon import client as client_module


class Peer:
    """The daemon's end of one connection, in a thread of its own; notes what it is asked."""

    def __init__(self, end: socket.socket) -> None:
        self.asked: list[str] = []
        self.before: Callable[[dict[str, Any]], None] = lambda _: None
        """Done before an answer is sent."""
        self.change: dict[str, Any] = {}
        """Instead of what an answer has under these keys."""
        self._end = end
        self.thread = threading.Thread(target=self._answer)
        self.thread.start()

    def _answer(self) -> None:
        with contextlib.suppress(OSError), self._end, self._end.makefile("rb") as lines:
            for line in lines:  # until the client hangs up
                request = json.loads(line)
                self.asked.append(request["do"])
                self.before(request)
                answer = {"id": request["id"], "ok": True, "stopped": [], "axes": {}}
                self._end.sendall(json.dumps(answer | self.change).encode() + b"\n")


@pytest.fixture
def talk(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[motorctl.Connection, Peer]]:
    mine, others = socket.socketpair()
    monkeypatch.setattr(client_module, "connected", lambda _: (mine, Path("s.sock")))
    peer = Peer(others)
    with motorctl.connect() as machine:
        yield machine, peer
    peer.thread.join(5.0)
    assert not peer.thread.is_alive()


def test_after_ctrl_c_no_answer_is_taken_for_that_to_another_request(
    talk: tuple[motorctl.Connection, Peer],
) -> None:
    machine, peer = talk

    def interrupt(_: dict[str, Any]) -> None:
        peer.before = lambda _: None
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        answer_now.wait(5.0)

    peer.before, answer_now = interrupt, threading.Event()
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            machine.ask("start", axis="x")
    finally:
        signal.signal(signal.SIGINT, before)
        answer_now.set()
    for ask in (machine.estop, machine.status):
        with pytest.raises(motorctl.RunError, match=r"broken off.*nothing was sent; connect anew"):
            ask()
    peer.thread.join(5.0)
    assert peer.asked == ["start"]


def test_after_an_answer_that_did_not_come_in_time_nothing_more_is_sent(
    talk: tuple[motorctl.Connection, Peer], monkeypatch: pytest.MonkeyPatch
) -> None:
    machine, peer = talk
    answer_now = threading.Event()

    def late(_: dict[str, Any]) -> None:
        answer_now.wait(5.0)

    peer.before = late
    monkeypatch.setattr(client_module, "ANSWER_TIMEOUT_S", 0.05)
    with pytest.raises(motorctl.RunError, match=r"did not answer within 0\.05 s$"):
        machine.ask("status")
    answer_now.set()
    for _ in range(2):
        with pytest.raises(motorctl.RunError, match=r"within 0\.05 s: nothing was sent; connect"):
            machine.ask("move", axis="x", position_m=0.1)
    peer.thread.join(5.0)
    assert peer.asked == ["status"]


def test_a_reply_to_another_request_is_refused_and_ends_the_connection(
    talk: tuple[motorctl.Connection, Peer],
) -> None:
    machine, peer = talk
    assert machine.ask("status") == {"stopped": [], "axes": {}}
    peer.change = {"id": 1}
    with pytest.raises(motorctl.RunError, match="answered another request"):
        machine.estop()
    with pytest.raises(motorctl.RunError, match="connect anew"):
        machine.estop()
    assert peer.asked == ["status", "estop"]


def test_a_refusal_leaves_the_connection_as_it_is_unless_nobody_is_heard_on_it(
    talk: tuple[motorctl.Connection, Peer],
) -> None:
    machine, peer = talk
    peer.change = {"ok": False, "error": {"code": "wrong_state", "message": "not now"}}
    for _ in range(2):
        with pytest.raises(motorctl.DaemonRefusedError, match="not now"):
            machine.ask("start", axis="x")
    peer.change |= {"id": None}
    with pytest.raises(motorctl.DaemonRefusedError, match="not now"):
        machine.ask("start", axis="x")
    with pytest.raises(motorctl.RunError, match="not now: nothing was sent; connect anew"):
        machine.ask("start", axis="x")


def test_what_is_closed_says_so(talk: tuple[motorctl.Connection, Peer]) -> None:
    machine, _ = talk
    machine.close()
    with pytest.raises(motorctl.RunError, match=r"s\.sock was closed here: nothing was sent"):
        machine.status()
