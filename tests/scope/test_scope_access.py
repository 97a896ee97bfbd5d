"""Whom the scope's server refuses, and what it never tells."""

from __future__ import annotations

import asyncio
import random
import shutil
import socket
import string
from contextlib import AsyncExitStack
from pathlib import Path

import pytest
from asked_scope import OWN, asked

pytest.importorskip("aiohttp", reason="the scope needs the extra [scope]")

from aiohttp import CookieJar
from aiohttp.test_utils import TestClient, TestServer

from motorctl.own_names import own_names
from motorctl.scope.access import Access
from motorctl.scope.server import Logs, application

TOKEN = "a-token-of-this-test"


@pytest.mark.parametrize(
    ("headers", "words"),
    [
        ({"Host": "evil.example"}, "under the name 'evil.example', which is none of this server's"),
        ({"Host": "evil.example:8080"}, "none of this server's"),
        ({"Origin": "http://evil.example"}, "a page from 'http://evil.example' asked"),
        ({"Origin": "null"}, "a page from 'null' asked"),
        ({"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"}, "another page asked"),
    ],
)
def test_pages_of_others_are_refused(log: Path, headers: dict[str, str], words: str) -> None:
    status, _, body = asked([log], ("/api/logs", {"headers": headers}))
    assert (status, words in body.decode()) == (403, True)


def test_the_page_is_told_to_load_and_ask_nothing_from_elsewhere(log: Path) -> None:
    answers = asked(
        [log],
        ("/", {}),
        ("/main.js", {}),
        ("/uplot/uPlot.iife.min.js", {}),
        ("/no_such.js", {}),
        ("/../server.py", {}),
        ("/uplot/LICENSE", {}),
    )
    assert [status for status, _, _ in answers] == [200, 200, 200, 404, 404, 404]
    for _, headers, _ in answers:
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
    assert answers[0][1]["Content-Type"].startswith("text/html")
    assert b"https://" not in answers[0][2]


def sent(log: Path, request: str, access: Access = OWN, **headers: bytes) -> bytes:
    """Return what is answered to a request as it stands: a client's own would be tidied before."""

    async def run() -> bytes:
        server = TestServer(application(Logs.of([log]), access))
        async with server:
            assert server.port is not None
            told, listens = await asyncio.open_connection("127.0.0.1", server.port)
            host = headers.pop("Host", b"127.0.0.1")
            lines = [request.encode(), b"Host: " + host, b"Connection: close"]
            lines += [name.encode() + b": " + value for name, value in headers.items()]
            listens.write(b"\r\n".join(lines) + b"\r\n\r\n")
            answer = await told.read()
            listens.close()
            return answer

    return asyncio.run(run())


def test_no_file_of_this_computer_is_told_but_the_pages_own(log: Path) -> None:
    letters = "".join(random.choices(string.ascii_lowercase, k=16))
    secret = Path("/tmp") / letters / "secret.html"  # the names that are served have no digits
    secret.parent.mkdir()
    try:
        secret.write_text("of somebody else")
        for path in (f"/{secret}", f"//{secret}", f"/uplot/{secret}", f"/{'a' * 300}.html"):
            answer = sent(log, f"GET {path} HTTP/1.1")
            assert answer.startswith(b"HTTP/1.1 404"), answer
    finally:
        shutil.rmtree(secret.parent)


@pytest.mark.parametrize(
    ("header", "value", "words"),
    [
        ("Origin", b"http://[", b"a page from 'http://[' asked"),
        ("Origin", b"\xff", rb"a page from '\udcff' asked"),
        ("Host", b"\xff", rb"under the name '\udcff'"),
        ("Cookie", b"motorctl_scope=\xff", b"the token is missing or wrong"),
    ],
)
def test_headers_that_make_no_sense_are_refused_in_words(
    log: Path, header: str, value: bytes, words: bytes
) -> None:
    access = Access("127.0.0.1", TOKEN if header == "Cookie" else None)
    answer = sent(log, "GET /api/logs HTTP/1.1", access, **{header: value})
    assert (answer.startswith(b"HTTP/1.1 403"), words in answer) == (True, True), answer


def test_two_scopes_of_a_computer_are_both_open_in_one_browser(log: Path) -> None:
    async def run() -> list[int]:
        jar = CookieJar(unsafe=True)  # as a browser's for an address, in which no port counts
        found = []
        async with AsyncExitStack() as stack:
            clients = []
            for token in ("one", "another"):
                server = TestServer(application(Logs.of([log]), Access("127.0.0.1", token)))
                client = await stack.enter_async_context(TestClient(server, cookie_jar=jar))
                await client.get("/", params={"token": token})
                clients.append(client)
            for client in clients:
                found.append((await client.get("/api/logs")).status)
        return found

    assert asyncio.run(run()) == [200, 200]


def test_the_name_server_is_not_asked_for_each_request(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked_for: list[str] = []

    def slow(name: str = "") -> str:
        asked_for.append(name)
        return "scope.example"

    monkeypatch.setattr(socket, "getfqdn", slow)
    access = Access("0.0.0.0", TOKEN, own_names())
    known, unknown = (
        sent(log, f"GET /?token={'no'} HTTP/1.1", access, Host=host)
        for host in (b"scope.example", b"evil.example")
    )
    assert (b"the token is missing" in known, b"none of this" in unknown) == (True, True)
    assert len(asked_for) == 1


def test_a_link_from_elsewhere_opens_the_page_and_nothing_else(log: Path) -> None:
    headers = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate"}
    page, data = asked([log], ("/", {"headers": headers}), ("/api/logs", {"headers": headers}))
    assert (page[0], data[0]) == (200, 403)


def test_nothing_can_be_changed_or_sent(log: Path) -> None:
    large, long = asked(
        [log],
        ("/api/logs", {"method": "POST", "data": b"x" * 500_000}),
        ("/api/values?log=0&at_s=" + "1" * 20_000, {}),
    )
    assert (large[0], b"the scope only shows" in large[2]) == (405, True)
    assert (long[0], b"Got more than 8190 bytes" in long[2]) == (400, True)


def test_only_the_own_page_sets_a_trigger_and_only_of_a_machine(log: Path) -> None:
    own = {"method": "POST", "data": b'{"kind": "fault"}'}

    async def run() -> tuple[int, str]:
        async with TestClient(TestServer(application(Logs.of([log]), OWN))) as client:
            origin = str(client.make_url("/")).rstrip("/")
            answer = await client.post("/api/trigger", headers={"Origin": origin}, data=own["data"])
            return answer.status, await answer.text()

    without, foreign = asked(
        [log],
        ("/api/trigger", dict(own)),
        ("/api/trigger", own | {"headers": {"Origin": "http://evil.example"}}),
    )
    assert (without[0], foreign[0]) == (403, 403)
    assert asyncio.run(run()) == (400, "no machine is shown, but logs\n")


def test_elsewhere_only_who_has_the_token_is_let_in(log: Path) -> None:
    access = Access("0.0.0.0", TOKEN)
    here = {"Host": "127.0.0.1:8765"}
    without, wrong, cookie, right = asked(
        [log],
        ("/api/logs", {}),
        ("/?token=guessed", {}),
        ("/api/logs", {"cookies": {"motorctl_scope_8765": "guessed"}, "headers": here}),
        (f"/?token={TOKEN}", {"headers": here}),
        access=access,
    )
    for status, _, body in (without, wrong, cookie):
        assert (status, b"the token is missing or wrong" in body) == (403, True)
    assert (right[0], right[1]["Location"]) == (302, "/")
    assert (
        f"motorctl_scope_8765={TOKEN}; HttpOnly; Path=/; SameSite=Strict" in right[1]["Set-Cookie"]
    )
    cookies = {"cookies": {"motorctl_scope_8765": TOKEN}}
    status, _, _ = asked([log], ("/api/logs", cookies | {"headers": here}), access=access)
    assert status == 200
    foreign = cookies | {"headers": {"Host": "evil.example"}}
    assert asked([log], ("/api/logs", foreign), access=access)[0] == 403
