"""An emergency stop over the control socket waits for nobody, and is never without a connection."""

from __future__ import annotations

import asyncio
import json
import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from served_socket import served

from motorctl.daemon import places as places_module
from motorctl.daemon import server as server_module
from motorctl.daemon.access import Role
from motorctl.daemon.client import Client, DaemonRefusedError
from motorctl.daemon.places import MAX_CLIENTS_A_USER, Place, Places
from motorctl.daemon.protocol import Request

STATUS_S = 0.003
"""What a status takes here: as much as on a busy computer."""
FLOOD = b'{"id":1,"do":"status"}\n' * 190
ESTOP = b'{"id":2,"do":"estop"}\n'

did: list[str] = []
"""What was carried out, in order."""
gate = threading.Event()
"""What is `home` waits for it."""


async def _handle(request: Request) -> dict[str, Any]:
    if request.do == "status":
        time.sleep(STATUS_S)
    while request.do == "home" and not gate.is_set():
        await asyncio.sleep(0.002)
    did.append(request.do)
    return {"did": request.do}


@pytest.fixture
def path(tmp_path: Path) -> Iterator[Path]:
    did.clear()
    gate.clear()
    with served(tmp_path / "s.sock", _handle) as place:
        yield place


def connected(path: Path, end: ExitStack) -> socket.socket:
    connection = end.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
    connection.settimeout(20)
    connection.connect(str(path))
    return connection


def flooded(path: Path, end: ExitStack) -> int:
    """Let nearly all clients that a user may have flood; return how many requests were done."""
    for _ in range(MAX_CLIENTS_A_USER - 2):
        connected(path, end).sendall(FLOOD)
    while len(did) < 100:
        time.sleep(0.001)
    return len(did)


def answer(connection: socket.socket) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(connection.makefile("rb").readline())
    return found


def waiting_answers(connection: socket.socket) -> int:
    """Return how many answers are here already."""
    try:
        return connection.recv(1 << 20, socket.MSG_DONTWAIT).count(b"\n")
    except BlockingIOError:
        return 0


def test_an_emergency_stop_waits_for_a_few_of_a_crowds_requests_at_most(path: Path) -> None:
    with ExitStack() as end:
        began = flooded(path, end)
        caller = connected(path, end)
        caller.sendall(ESTOP)
        assert answer(caller)["ok"]
        before_it = did.index("estop") - began
    # Accepting, reading and carrying it out let at most a slice each pass, besides the one that
    # goes on when it comes.
    slices = 5
    assert before_it <= slices * (server_module.SLICE_S / STATUS_S + 1)


def test_a_stop_comes_before_what_others_ask(path: Path) -> None:
    with ExitStack() as end:
        began = flooded(path, end)
        caller = connected(path, end)
        caller.sendall(b'{"id":2,"do":"stop","axis":"x"}\n')
        assert answer(caller)["ok"]
        assert did.index("stop") - began <= 5 * (server_module.SLICE_S / STATUS_S + 1)


@pytest.mark.parametrize(
    ("role", "line"),
    [
        (Role.OBSERVE, b'{"id":1,"do":"stop","axis":"x"}\n'),
        (Role.OPERATE, b'{"id":"stop","do":"status"}\n'),
        (Role.OPERATE, b'{"id":1,"do":"stop"}\n'),
    ],
    ids=["observer", "id", "no axis"],
)
def test_what_only_looks_like_a_stop_goes_before_nobody(
    tmp_path: Path, role: Role, line: bytes
) -> None:
    roles = [Role.OPERATE]
    with served(tmp_path / "s.sock", _handle, lambda: roles[0]) as path, ExitStack() as end:
        caller = end.enter_context(Client(path))
        caller.ask("status")
        roles[0] = role
        crowd = [connected(path, end) for _ in range(MAX_CLIENTS_A_USER - 2)]
        for one in crowd:
            one.sendall(line * 190)
        assert caller.ask("start", axis="x") == {"did": "start"}
        answered = sum(waiting_answers(one) for one in crowd)
    assert answered < 190 * len(crowd) / 2


def test_who_has_all_connections_is_still_heard_for_an_emergency_stop(path: Path) -> None:
    with ExitStack() as end:
        for _ in range(MAX_CLIENTS_A_USER):
            end.enter_context(Client(path)).ask("status")
        with Client(path) as beyond, pytest.raises(DaemonRefusedError, match="close some"):
            beyond.ask("start", axis="x")
        with Client(path) as beyond:
            assert beyond.ask("estop") == {"did": "estop"}
        assert "start" not in did


def test_who_is_beyond_the_limit_and_says_nothing_is_sent_away(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server_module, "STOP_CALLER_S", 0.02)
    with ExitStack() as end:
        for _ in range(MAX_CLIENTS_A_USER):
            end.enter_context(Client(path)).ask("status")
        for _ in range(3 * places_module.MAX_STOP_CALLERS_A_USER):
            silent = connected(path, end)
            assert "already has" in answer(silent)["error"]["message"]


def test_what_came_before_an_emergency_stop_does_not_begin_after_it(path: Path) -> None:
    with ExitStack() as end:
        one = connected(path, end)
        one.sendall(
            b'{"id":1,"do":"reset","axis":"x"}\n{"id":2,"do":"start","axis":"x"}\n'
            b'{"id":3,"do":"status"}\n{"id":4,"do":"estop"}\n{"id":5,"do":"stop","axis":"x"}\n'
        )
        lines = one.makefile("rb")
        answers = {a["id"]: a for a in (json.loads(lines.readline()) for _ in range(5))}
    assert did == ["estop", "status", "stop"]
    assert {answers[k]["error"]["code"] for k in (1, 2)} == {"overtaken"}
    assert "emergency stop" in answers[1]["error"]["message"]
    assert all(answers[k]["ok"] for k in (3, 4, 5))


def test_an_emergency_stop_does_not_wait_for_what_its_own_client_asked_before(path: Path) -> None:
    with ExitStack() as end:
        one = connected(path, end)
        one.sendall(b'{"id":1,"do":"home","axis":"x"}\n{"id":2,"do":"move","axis":"x","posit')
        time.sleep(0.05)
        one.sendall(b'ion_m":0}\n{"id":3,"do":"est')
        time.sleep(0.05)
        one.sendall(b'op"}\n')
        lines = one.makefile("rb")
        assert json.loads(lines.readline()) == {"id": 3, "ok": True, "did": "estop"}
        gate.set()
        assert json.loads(lines.readline()) == {"id": 1, "ok": True, "did": "home"}
        assert json.loads(lines.readline())["error"]["code"] == "overtaken"


def test_emergency_stops_without_end_leave_turns_to_others(path: Path) -> None:
    with ExitStack() as end:
        flood = connected(path, end)
        flood.sendall(ESTOP * 2000)
        with Client(path) as client:
            assert client.ask("status") == {"did": "status"}
        assert did.count("estop") < 1000


def test_a_client_that_has_said_all_gets_its_answers(path: Path) -> None:
    with ExitStack() as end:
        one = connected(path, end)
        one.sendall(b'{"id":1,"do":"status"}\n{"id":2,"do":"status"}\n' + ESTOP)
        one.shutdown(socket.SHUT_WR)
        found = one.makefile("rb").readlines()
    assert sorted(json.loads(line)["id"] for line in found) == [1, 2, 2]


def test_a_mistake_with_one_request_silences_nobody_else(
    path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def broken(_line: bytes) -> Request:
        raise ZeroDivisionError("a mistake of ours")

    with ExitStack() as end:
        with monkeypatch.context() as patch:
            patch.setattr(server_module, "parse_request", broken)
            one = connected(path, end)
            one.sendall(b'{"id":1,"do":"status"}\n')
            assert one.recv(100) == b""
        with Client(path) as client:
            assert client.ask("status") == {"did": "status"}
    assert "a mistake of ours" in caplog.text


def test_a_daemon_without_descriptors_accepts_again_later(
    path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    resource = pytest.importorskip("resource")
    monkeypatch.setattr(server_module, "ACCEPT_AGAIN_S", 0.05)
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with ExitStack() as end:
        waiting = end.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
        waiting.settimeout(20)
        resource.setrlimit(resource.RLIMIT_NOFILE, (waiting.fileno() + 1, hard))
        try:
            taken = []
            with suppress(OSError):
                while True:
                    taken.append(os.dup(waiting.fileno()))
            waiting.connect(str(path))
            waiting.sendall(b'{"id":1,"do":"status"}\n')
            time.sleep(0.2)
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
            for number in taken:
                os.close(number)
        assert answer(waiting)["ok"]
    assert 1 <= caplog.text.count("nobody can be accepted") < 20


def test_a_client_waits_while_too_many_others_are_not_accepted_yet(tmp_path: Path) -> None:
    with ExitStack() as end:
        busy = end.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
        busy.bind(str(tmp_path / "s.sock"))
        busy.listen(0)
        before = 0
        with suppress(BlockingIOError):
            while True:
                other = end.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
                other.setblocking(False)
                other.connect(str(tmp_path / "s.sock"))
                before += 1

        def accept() -> None:
            time.sleep(0.1)
            for _ in range(before + 1):
                last, _address = busy.accept()
                end.enter_context(last)
            last.recv(1000)
            last.sendall(b'{"id":1,"ok":true,"did":"estop"}\n')

        accepting = threading.Thread(target=accept)
        accepting.start()
        with Client(tmp_path / "s.sock") as client:
            assert client.ask("estop") == {"did": "estop"}
        accepting.join()


@given(st.lists(st.tuples(st.integers(0, 20), st.booleans()), max_size=800))
def test_whoever_has_no_connection_gets_one(steps: list[tuple[int, bool]]) -> None:
    places = Places()
    held: list[tuple[int, Place]] = []
    for uid, takes in steps:
        if not takes and held:
            places.give_back(*held.pop(uid % len(held)))
        for _ in range(30 if takes else 0):
            held.append((uid, places.take(uid)[0]))
    full = [uid for uid, place in held if place is Place.FULL]
    assert len(full) <= places_module.MAX_CLIENTS
    assert all(full.count(uid) <= MAX_CLIENTS_A_USER for uid in set(full))
    callers = [uid for uid, place in held if place is Place.STOP_ONLY]
    assert len(callers) <= places_module.MAX_STOP_CALLERS
    assert places.take(99)[0] is Place.FULL


def test_the_last_places_are_for_users_who_have_none() -> None:
    places = Places()
    while places.take(1)[0] is Place.FULL:
        pass
    for uid in range(2, 40):
        for _ in range(MAX_CLIENTS_A_USER):
            place, why = places.take(uid)
    assert place is not Place.FULL
    assert "for users who have none" in why
    assert places.take(99)[0] is Place.FULL
