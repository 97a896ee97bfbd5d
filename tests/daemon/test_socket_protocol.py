"""The control socket: whatever a client sends, it harms nobody but itself."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from served_socket import served

from motorctl.daemon import connection as connection_module
from motorctl.daemon import conversation, request_pace
from motorctl.daemon.access import Role
from motorctl.daemon.client import Client, DaemonRefusedError
from motorctl.daemon.places import MAX_CLIENTS_A_USER
from motorctl.daemon.protocol import (
    MAX_LINE_BYTES,
    SHORT_LINE_BYTES,
    Code,
    MoveCommand,
    RefusedError,
    Request,
    parse_request,
    refusal,
    request_id,
)
from motorctl.errors import RunError

LINES = settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=12,
)
COMMANDS = st.sampled_from(["start", "stop", "move", "program", "estop", "status", "dance"])
ALMOST_REQUESTS = st.fixed_dictionaries(
    {"do": COMMANDS | JSON_VALUES},
    optional={"id": JSON_VALUES, "axis": st.just("x") | JSON_VALUES, "position_m": JSON_VALUES},
)


before_start: list[RefusedError] = []
"""What `start` is refused with, one after another, before it is carried out."""


async def _handle(request: Request) -> dict[str, Any]:
    """Stand in for the daemon: one axis x, and one command that is broken."""
    if request.do == "home":
        raise ZeroDivisionError("a mistake of ours")
    if request.do == "start" and before_start:
        raise before_start.pop()
    if request.do == "estop":
        raise RefusedError(Code.WRONG_STATE, "not now")
    return {"did": request.do}


@pytest.fixture
def path(tmp_path: Path) -> Iterator[Path]:
    with served(tmp_path / "s.sock", _handle) as place:
        yield place


def exchange(path: Path, data: bytes, answers: int) -> list[dict[str, Any]]:
    """Send bytes and read that many lines, or up to the end."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        connection.settimeout(20)
        connection.connect(str(path))
        connection.sendall(data)
        lines = connection.makefile("rb")
        found = [line for _ in range(answers) if (line := lines.readline())]
        lines.close()
    return [json.loads(line) for line in found]


def answers_still(path: Path) -> bool:
    with Client(path) as client:
        return client.ask("status") == {"did": "status"}


def test_a_request_is_answered_under_its_id(path: Path) -> None:
    requests = b'{"do": "estop", "id": "a"}\n{"id": 7, "do": "start", "axis": "x"}\n'
    assert exchange(path, requests, 2) == [
        {"id": "a", "ok": False, "error": {"code": "wrong_state", "message": "not now"}},
        {"id": 7, "ok": True, "did": "start"},
    ]


@LINES
@given(st.binary(max_size=200).filter(lambda b: b.replace(b"\n", b"").strip()))
def test_random_bytes_are_refused_and_the_server_lives(path: Path, data: bytes) -> None:
    (first, *_) = exchange(path, data + b"\n", 1)
    assert first["ok"] is False
    assert first["error"]["code"] == "bad_request"
    assert answers_still(path)


@LINES
@given(ALMOST_REQUESTS)
def test_every_json_object_gets_one_answer(path: Path, request_like: dict[str, Any]) -> None:
    (found,) = exchange(path, json.dumps(request_like).encode() + b"\n", 1)
    assert found["ok"] or found["error"]["message"]
    assert answers_still(path)


@given(st.binary(max_size=300) | ALMOST_REQUESTS.map(lambda r: json.dumps(r).encode()))
def test_a_line_is_a_request_or_refused_with_a_reason(line: bytes) -> None:
    refused = None
    try:
        request = parse_request(line)
    except RefusedError as no:
        refused = no
    if refused is None:
        assert request.do in line.decode()
        return
    assert refused.code is Code.BAD_REQUEST
    assert refused.message
    assert json.loads(refusal(request_id(line), refused.code, refused.message))["ok"] is False


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e999", '"0.1"', "true", "null"])
def test_a_position_is_a_finite_number(number: str) -> None:
    line = f'{{"do": "move", "axis": "x", "position_m": {number}}}'.encode()
    with pytest.raises(RefusedError, match=r"position_m|JSON"):
        parse_request(line)


def test_what_is_wrong_with_a_request_is_named() -> None:
    with pytest.raises(RefusedError, match=r"unknown command 'dance'; known: .*'start'"):
        parse_request(b'{"do": "dance"}')
    with pytest.raises(RefusedError, match='no "do"'):
        parse_request(b'{"axis": "x"}')
    with pytest.raises(RefusedError, match="speed: Extra inputs are not permitted"):
        parse_request(b'{"do": "move", "axis": "x", "position_m": 0.1, "speed": 2}')
    assert parse_request(b'{"do": "move", "axis": "x", "position_m": 1}') == MoveCommand(
        do="move", axis="x", position_m=1.0
    )


MANY = b"".join(b',"%06x":1' % number for number in range(380_000))


def texts(mark: bytes) -> bytes:
    return (
        b'{"do":"program","axis":"x","name":"n","files":{"p":"'
        + mark * (4_000_000 // len(mark))
        + b'"}}'
    )


@pytest.mark.parametrize(
    ("line", "why"),
    [
        (b'{"do":"status"' + MANY + b"}", "quotation marks"),
        (
            b'{"do":"program","axis":"x","name":"n","files":{"p":""' + MANY + b"}}",
            "quotation marks",
        ),
        (
            b'{"do":"program","axis":"x","name":"n","files":{"p":""' + MANY[:440_000] + b"}}",
            "the request has 40001 files; limit 16",
        ),
        (
            b'{"do":"program","axis":"x","name":"n","document":{"a":[[]'
            + b",[]" * 1_300_000
            + b"]}}",
            "values",
        ),
        (
            b'{"do":"status","axis":"' + b"a" * 4_000_000 + b'"}',
            "16384 are allowed but for program, excite, apply",
        ),
        (
            b'{"do":"status","axis":"' + rb"\"" * 2_000_000 + b'"}',
            "16384 are allowed but for program, excite, apply",
        ),
        (b'{"do":"status"' + MANY[:11_000] + b"}", "the request has 1001 keys; limit 16"),
    ],
    ids=["keys", "files", "fewer files", "values", "text", "marks", "fewer keys"],
)
def test_no_line_takes_so_long_to_read_that_a_sign_of_life_is_missed(line: bytes, why: str) -> None:
    began_s = time.process_time()
    with pytest.raises(RefusedError, match=why):
        parse_request(line)
    request_id(line)
    assert time.process_time() - began_s < 0.25  # half of what the loop waits


@pytest.mark.parametrize("mark", [b"0.12345,0.12345\\n", b"\\\\", rb"\u00e4"])
def test_a_program_of_megabytes_of_points_is_read_in_time(mark: bytes) -> None:
    began_s = time.process_time()
    assert parse_request(texts(mark)).do == "program"
    assert time.process_time() - began_s < 0.25


def test_who_may_only_look_has_no_long_request(tmp_path: Path) -> None:
    with served(tmp_path / "s.sock", _handle, lambda: Role.OBSERVE) as path:
        (refused,) = exchange(path, b" " * (SHORT_LINE_BYTES + 1), 2)
        assert refused["error"]["code"] == "too_large"
        assert f"limit of {SHORT_LINE_BYTES} bytes" in refused["error"]["message"]
        assert answers_still(path)


def test_as_many_moves_as_the_loop_can_follow_are_read() -> None:
    move = dict.fromkeys(
        ["target_m", "max_velocity_m_s", "max_acceleration_m_s2", "max_jerk_m_s3", "dwell_s"], 0.25
    )
    document = {"kind": "moves", "axis": "x", "start_m": 0.25, "moves": [move] * 8125}
    asked = {"id": 1, "do": "program", "axis": "x", "name": "n", "document": document}
    assert parse_request(json.dumps(asked).encode()).do == "program"


def test_a_mistake_of_ours_is_told_and_survived(path: Path) -> None:
    (found,) = exchange(path, b'{"id": 1, "do": "home", "axis": "x"}\n', 1)
    assert found["error"]["code"] == "internal"
    assert answers_still(path)


def test_an_oversized_request_is_refused_and_hung_up_on(path: Path) -> None:
    with Client(path) as client, pytest.raises(DaemonRefusedError, match="bytes") as refused:
        client.ask("start", axis="x" * (MAX_LINE_BYTES + 10))
    assert refused.value.code == "too_large"
    assert answers_still(path)


def test_an_endless_line_does_not_keep_others_waiting(path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as endless:
        endless.connect(str(path))
        endless.settimeout(20)
        with pytest.raises(OSError, match=r"Broken pipe|reset"):
            endless.sendall(b"x" * (10 * MAX_LINE_BYTES))
        assert answers_still(path)


def test_silent_and_half_spoken_clients_do_not_keep_others_waiting(path: Path) -> None:
    with (
        socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as silent,
        socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as half,
    ):
        silent.connect(str(path))
        half.connect(str(path))
        half.sendall(b'{"do": "sta')
        assert answers_still(path)
        half.sendall(b'tus"}\n')
        assert json.loads(half.recv(4096))["ok"]


def test_a_line_that_never_ends_is_hung_up_on(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection_module, "LINE_TIMEOUT_S", 0.05)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as half:
        half.connect(str(path))
        half.settimeout(20)
        half.sendall(b'{"do": "sta')
        assert half.recv(4096) == b""
    assert answers_still(path)


def test_a_client_that_takes_no_answers_is_dropped(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection_module, "WRITE_TIMEOUT_S", 0.05)
    monkeypatch.setattr(request_pace, "REQUESTS_PER_S", 1e9)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as deaf:
        deaf.connect(str(path))
        deaf.settimeout(20)
        with pytest.raises(OSError, match=r"Broken pipe|reset"):
            deaf.sendall(b'{"do":"status"}\n' * 1_000_000)
    assert answers_still(path)


def test_a_flood_of_requests_leaves_turns_to_others(path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as flood:
        flood.connect(str(path))
        flood.settimeout(20)
        flood.sendall(b"\n" * 100_000 + b'{"do":"status"}\n' * 1000)
        assert answers_still(path)


def test_who_asks_too_fast_waits_and_only_there(path: Path) -> None:
    at_once = round(request_pace.BURST)
    more = round(0.5 * request_pace.REQUESTS_PER_S)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as hasty:
        hasty.connect(str(path))
        hasty.settimeout(20)
        begin = time.monotonic()
        hasty.sendall(b'{"do":"status"}\n' * (at_once + more))
        assert answers_still(path)
        got = b""
        while got.count(b"\n") < at_once + more:
            got += hasty.recv(1 << 16)
    assert time.monotonic() - begin > 0.4  # half a second's worth beyond what may come at once


@given(gaps=st.lists(st.floats(0, 5), min_size=1, max_size=60))
def test_no_connection_is_answered_faster_than_it_may_be(gaps: list[float]) -> None:
    now_s, answered_s = 0.0, []
    pace = request_pace.RequestPace(now_s)
    for gap in gaps:
        now_s += gap
        now_s += pace.wait_s(now_s)
        answered_s.append(now_s)
    for first, begin_s in enumerate(answered_s):
        for last in range(first, len(answered_s)):
            allowed = request_pace.BURST + request_pace.REQUESTS_PER_S * (
                answered_s[last] - begin_s
            )
            assert last - first <= allowed + 1


def test_too_many_connections_of_one_user_are_refused_until_one_ends(path: Path) -> None:
    clients = [Client(path) for _ in range(MAX_CLIENTS_A_USER)]
    for client in clients:
        client.ask("status")
    with Client(path) as one_more, pytest.raises(DaemonRefusedError, match="connections"):
        one_more.ask("status")
    clients.pop().close()
    for _ in range(200):
        try:
            assert answers_still(path)
            break
        except (DaemonRefusedError, RunError):  # the end has not been noticed yet
            continue
    else:
        pytest.fail("the place was not given back")
    for client in clients:
        client.close()


def test_a_client_waits_for_a_loop_that_is_not_ready_and_tells_once(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refusals = [RefusedError(Code.NOT_READY, "the loop process is compiling; try again")] * 3
    monkeypatch.setattr(conversation, "READY_POLL_S", 0.01)
    monkeypatch.setattr(f"{__name__}.before_start", refusals)
    told: list[str] = []
    with Client(path) as client:
        answer = client.ask_when_ready("start", told.append, axis="x")
        assert answer == {"did": "start"}
        (why,) = told
        assert "the loop process is compiling" in why
        assert client.ask_when_ready("start", lambda _: told.append("again"), axis="x") == answer
        assert (told, refusals) == ([why], [])
        with pytest.raises(DaemonRefusedError, match="not now"):
            client.ask_when_ready("estop", lambda _: told.append("never"))
        monkeypatch.setattr(conversation, "PATIENCE_S", {})
        refusals += [RefusedError(Code.NOT_READY, "still compiling")] * 100
        with pytest.raises(DaemonRefusedError, match="still compiling"):
            client.ask_when_ready("start", lambda _: None, axis="x")
