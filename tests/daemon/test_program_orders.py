"""How the orders of a program reach the loop: all, or none that stands; the loop is the test's."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest
from played_loop import PlayedLoop

from motorctl.daemon import commander
from motorctl.daemon.commander import Commander
from motorctl.daemon.protocol import Code, RefusedError, parse_request
from motorctl.loop import Reply, Verb
from motorctl.loop.vocabulary import Word
from motorctl.motion import Program, Trajectory, parse_program

LIST = {
    "kind": "moves",
    "axis": "y",
    "start_m": 0.1,
    "cycles": 2,
    "moves": [
        {
            "target_m": target_m,
            "max_velocity_m_s": 0.1,
            "max_acceleration_m_s2": 1,
            "max_jerk_m_s3": 50,
        }
        for target_m in (0.12, 0.1)
    ],
}


class Loop(PlayedLoop):
    """Has the daemon answer one request after another."""

    def ask(self, line: bytes, act: Callable[[Loop], None]) -> dict[str, Any]:
        """Have the daemon answer a request, while the loop acts again and again."""
        taking = Commander(self.machine, self.memory, self.report)

        async def acting() -> None:
            while True:
                act(self)
                await asyncio.sleep(1e-3)

        async def both() -> dict[str, Any]:
            task = asyncio.create_task(acting())
            try:
                return await taking.handle(parse_request(line))
            finally:
                task.cancel()

        return asyncio.run(both())

    def refused(self, line: bytes, act: Callable[[Loop], None]) -> RefusedError:
        """Have the daemon refuse a request."""
        with pytest.raises(RefusedError) as no:
            self.ask(line, act)
        return no.value


@pytest.fixture
def loop(tmp_path: Path) -> Loop:
    return Loop(tmp_path)


@dataclass
class Watched:
    """A program that notes which threads plan its motion."""

    inner: Program
    threads: set[int] = field(default_factory=set)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.inner, name)

    @property
    def period_s(self) -> float | None:
        self.threads.add(threading.get_ident())
        return self.inner.period_s

    def trajectories(self) -> dict[str, Trajectory]:
        self.threads.add(threading.get_ident())
        return self.inner.trajectories()


def test_a_list_of_moves_is_never_planned_where_signs_of_life_are_given(loop: Loop) -> None:
    inner = parse_program("list", LIST, directory=Path(), axis_names=loop.names, file="list")
    watched = Watched(inner)
    loop.machine = replace(loop.machine, programs={"list": watched})
    answer = loop.ask(b'{"do": "program", "axis": "y", "name": "list"}', Loop.take)
    assert loop.taken == [(Verb.FOLLOW, "y")]
    assert answer["duration_s"] - answer["approach_s"] == pytest.approx(2 * (inner.period_s or 0))
    assert watched.threads
    assert threading.get_ident() not in watched.threads


RING = b'{"do": "program", "axis": "x", "name": "ring"}'
FOLLOWED = [(Verb.FOLLOW, "x"), (Verb.FOLLOW, "y")]


def test_both_axes_of_a_program_are_ordered_and_nothing_else(loop: Loop) -> None:
    loop.ask(RING, Loop.take)
    assert loop.taken == FOLLOWED


def test_an_axis_does_not_follow_alone_where_the_mailbox_fills_up(loop: Loop) -> None:
    for _ in range(59):  # room for one more order, and four that are kept for emergency stops
        loop.memory.post(Verb.RESET, 1)

    def late(loop: Loop) -> None:
        if loop.memory.look_at(Word.MAIL_HEAD) >= 60:  # not before the first axis is ordered
            loop.take()

    no = loop.refused(RING, late)
    assert no.code is Code.LOOP_SILENT
    assert loop.taken[59:] == [(Verb.FOLLOW, "x"), (Verb.STOP, "x")]


def test_axes_whose_loop_fell_silent_before_it_answered_all_are_stopped(
    loop: Loop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commander, "REPLY_TIMEOUT_S", 0.5)

    def silent(loop: Loop) -> None:
        if not loop.taken:
            loop.take(1)
        elif loop.memory.look_at(Word.MAIL_HEAD) == 4:
            loop.take()

    no = loop.refused(RING, silent)
    assert no.code is Code.LOOP_SILENT
    assert loop.taken == [*FOLLOWED, (Verb.STOP, "x"), (Verb.STOP, "y")]


def test_where_one_axis_refuses_the_other_is_stopped_and_the_refusal_told(loop: Loop) -> None:
    loop.answers = {(Verb.FOLLOW, "y"): Reply.LATE, (Verb.STOP, "x"): Reply.WRONG_STATE}
    no = loop.refused(RING, Loop.take)
    assert no.message.startswith("axis y: follow: the loop took the order after its first tick")
    assert loop.taken == [*FOLLOWED, (Verb.STOP, "x")]


def test_an_axis_whose_loop_fell_silent_before_it_was_excited_is_stopped(
    loop: Loop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commander, "REPLY_TIMEOUT_S", 0.3)

    def late(loop: Loop) -> None:
        if loop.memory.look_at(Word.MAIL_HEAD) == 2:
            loop.take()

    wave = {"volts": [0.1, -0.1] * 100, "periods": 1000, "fade_periods": 1}
    no = loop.refused(json.dumps({"do": "excite", "axis": "x", **wave}).encode(), late)
    assert no.code is Code.LOOP_SILENT
    assert loop.taken == [(Verb.EXCITE, "x"), (Verb.STOP, "x")]
