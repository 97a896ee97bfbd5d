"""Many clients at once on a control socket: some ask, some flood, some send rubbish, some dawdle.

They run in processes of their own, one for each user: a daemon admits 32 connections of a user, so
a crowd that is all served needs several. Where this process is root it makes up users, who belong
to the socket's group and nothing else; else all clients are of its own user, and most are refused.
"""

from __future__ import annotations

import asyncio
import json
import os
import random
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field, fields
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from motorctl_benchmarks.control_socket.fuzz import fuzzed

FIRST_USER = 61_000
"""Of those that are made up; nothing has to know them."""
CLIENTS_A_USER = 30
ASK_S = 0.1
RETRY_S = 0.5
LATEST = 10.0
"""Times the length that was asked for: so long the last fuzzed bytes may take."""
STATUS = b'{"id":1,"do":"status"}\n'
KINDS = ("asks", "floods", "fuzzes", "dawdles")


@dataclass(frozen=True)
class Crowd:
    """What a crowd is to do."""

    socket: str
    clients: int
    fuzzed_bytes: int
    seconds: float
    seed: int


@dataclass
class Told:
    """What became of it."""

    connections: int = 0
    """That were made."""
    most_at_once: int = 0
    """Served at one time."""
    refused: int = 0
    """Connections beyond what one user may have."""
    answers: int = 0
    """To proper requests."""
    refusals: int = 0
    """Of what was no request."""
    mistakes: int = 0
    """Answers that tell of a mistake of the daemon's own."""
    fuzzed_bytes: int = 0
    waits_s: list[float] = field(default_factory=list)
    """For each answer to a client that asks ten times a second."""

    def add(self, other: Told, *, at_once: bool) -> None:
        """Add what other clients were told, at the same time or at another."""
        for each in fields(self):
            mine, more = getattr(self, each.name), getattr(other, each.name)
            largest = each.name == "most_at_once" and not at_once
            setattr(self, each.name, max(mine, more) if largest else mine + more)


def run_crowd(crowd: Crowd) -> Told:
    """Let a crowd loose; return what became of it when its time is over and its bytes are sent."""
    made_up = os.geteuid() == 0
    users = -(-crowd.clients // CLIENTS_A_USER) if made_up else 1
    group = Path(crowd.socket).stat().st_gid
    context = get_context("fork")
    results = context.SimpleQueue()
    processes = []
    for k in range(users):
        numbers = range(k, crowd.clients, users)
        user = FIRST_USER + k if made_up else None
        process = context.Process(target=_be_a_user, args=(crowd, user, group, numbers, results))
        process.start()
        processes.append(process)
    whole = Told()
    for _ in processes:
        whole.add(Told(**results.get()), at_once=True)
    for process in processes:
        process.join()
    return whole


def main() -> None:
    """Read a crowd as JSON from standard input, run it, and write what became of it."""
    json.dump(asdict(run_crowd(Crowd(**json.load(sys.stdin)))), sys.stdout)


def _be_a_user(crowd: Crowd, user: int | None, group: int, numbers: range, results: Any) -> None:
    told = Told()
    try:
        if user is not None:
            os.setgroups([group])
            os.setgid(group)
            os.setuid(user)
        asyncio.run(_User(crowd, told).run(numbers))
    finally:
        results.put(asdict(told))


class _User:
    """The clients of one user."""

    def __init__(self, crowd: Crowd, told: Told) -> None:
        self._crowd = crowd
        self._told = told
        self._served = 0
        self._ends_at = time.monotonic() + crowd.seconds
        self._latest = time.monotonic() + LATEST * crowd.seconds
        fuzzing = sum(1 for number in range(crowd.clients) if _kind(number) == "fuzzes")
        self._share = -(-crowd.fuzzed_bytes // max(fuzzing, 1))

    async def run(self, numbers: range) -> None:
        await asyncio.gather(*(self._client(number) for number in numbers))

    async def _client(self, number: int) -> None:
        kind, dice = _kind(number), random.Random(f"{self._crowd.seed}/{number}")
        act = getattr(self, f"_{kind}")
        left = [self._share if kind == "fuzzes" else 0]
        while self._goes_on(left[0]):
            try:
                reader, writer = await asyncio.open_unix_connection(
                    self._crowd.socket, limit=1 << 20
                )
            except OSError:
                await asyncio.sleep(RETRY_S)
                continue
            self._told.connections += 1
            with self._counted(), suppress(OSError, asyncio.IncompleteReadError, ValueError):
                await act(reader, writer, dice, left)
            writer.transport.abort()
            await asyncio.sleep(dice.uniform(0.01, 0.1))

    def _goes_on(self, left: int) -> bool:
        now = time.monotonic()
        return now < self._ends_at or (left > 0 and now < self._latest)

    @contextmanager
    def _counted(self) -> Iterator[None]:
        self._served += 1
        self._told.most_at_once = max(self._told.most_at_once, self._served)
        try:
            yield
        finally:
            self._served -= 1

    async def _asks(
        self,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        _dice: random.Random,
        _left: list[int],
    ) -> None:
        while self._goes_on(0):
            began = time.monotonic()
            writer.write(STATUS)
            if not await self._answered(reader):
                return
            self._told.waits_s.append(time.monotonic() - began)
            await asyncio.sleep(ASK_S)

    async def _floods(
        self,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        _dice: random.Random,
        _left: list[int],
    ) -> None:
        while self._goes_on(0):
            writer.write(STATUS * 20)
            for _ in range(20):
                if not await self._answered(reader):
                    return

    async def _fuzzes(
        self,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        dice: random.Random,
        left: list[int],
    ) -> None:
        hearing = asyncio.create_task(self._hear(reader))
        pace = left[0] / max(self._ends_at - time.monotonic(), 0.1)
        try:
            for _ in range(dice.randint(20, 400)):
                if left[0] <= 0 or not self._goes_on(left[0]) or hearing.done():
                    break
                rubbish = fuzzed(dice)[: left[0]]
                writer.write(rubbish)
                await asyncio.wait_for(writer.drain(), 15.0)
                left[0] -= len(rubbish)
                self._told.fuzzed_bytes += len(rubbish)
                await asyncio.sleep(len(rubbish) / max(pace, 1.0))
            else:
                return
            if left[0] <= 0:
                await asyncio.sleep(RETRY_S)
        finally:
            hearing.cancel()
            with suppress(asyncio.CancelledError, Exception):
                await hearing

    async def _dawdles(
        self,
        _reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        dice: random.Random,
        _left: list[int],
    ) -> None:
        """Say a part of a line, or ask and take no answer, and hang up in the middle."""
        writer.write(STATUS[: dice.randint(1, len(STATUS))] * dice.randint(1, 3))
        await asyncio.sleep(dice.uniform(0.05, 2.0))

    async def _answered(self, reader: asyncio.StreamReader) -> bool:
        line = await reader.readline()
        if line:
            self._take(line)
        return bool(line) and b"already has" not in line

    async def _hear(self, reader: asyncio.StreamReader) -> None:
        while line := await reader.readline():
            self._take(line)

    def _take(self, line: bytes) -> None:
        answer = json.loads(line)
        if answer.get("ok"):
            self._told.answers += 1
        elif "already has" in answer["error"]["message"]:
            self._told.refused += 1
        else:
            self._told.refusals += 1
            self._told.mistakes += answer["error"]["code"] == "internal"


def _kind(number: int) -> str:
    return KINDS[number // 7 % len(KINDS)]
