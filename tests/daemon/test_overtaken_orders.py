"""What waits while a stop comes is not done after it, and its client is told; a played loop."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from played_loop import PlayedLoop

from motorctl.daemon import commander
from motorctl.daemon.commander import Commander
from motorctl.daemon.protocol import Code, RefusedError, parse_request
from motorctl.log.sample import AxisState
from motorctl.loop import Verb
from motorctl.loop.plan import plan_program

START_Y, STOP_Y = b'{"do": "start", "axis": "y"}', b'{"do": "stop", "axis": "y"}'
RESET_Y, ESTOP = b'{"do": "reset", "axis": "y"}', b'{"do": "estop"}'
LEADS_TO = {
    Verb.START: AxisState.IDLE,
    Verb.STOP: AxisState.OFF,
    Verb.HOME: AxisState.IDLE,
    Verb.RESET: AxisState.OFF,
    Verb.FOLLOW: AxisState.RUNNING,
}

Ask = Callable[[bytes], Awaitable[Any]]


class Loop(PlayedLoop):
    """Obeys at once, whatever state an axis is in."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.first: Any = None
        """Answer or refusal of the program of x."""
        self.planning, self.may_plan = threading.Event(), threading.Event()

    def state(self, name: str) -> AxisState:
        return AxisState(int(self.memory.axis_status["state"][self.names.index(name)]))

    def set(self, name: str, state: AxisState) -> None:
        self.memory.axis_status_rows["state"][:, self.names.index(name)] = state

    def obey(self) -> None:
        before = len(self.taken)
        self.take()
        for verb, name in self.taken[before:]:
            for axis in self.names if verb is Verb.ESTOP else [name]:
                self.set(axis, LEADS_TO.get(verb, AxisState.FAULT))

    def plan_when_allowed(self, *given: Any) -> Any:
        self.planning.set()
        assert self.may_plan.wait(20.0)
        return plan_program(*given)

    def while_x_is_planned(self, waiting: bytes, *then: bytes) -> tuple[Any, list[Any]]:
        """Ask for something while a program of x is planned, then for more, then let it go on.

        Returns
        -------
        object
            Answer or refusal of what had to wait.
        list
            Those of what came after it.
        """
        taking = Commander(self.machine, self.memory, self.report)

        async def ask(line: bytes) -> Any:
            try:
                return await taking.handle(parse_request(line))
            except RefusedError as no:
                return no

        async def obeying() -> None:
            while True:
                self.obey()
                await asyncio.sleep(1e-3)

        async def all_of_it() -> tuple[Any, list[Any]]:
            loop = asyncio.create_task(obeying())
            try:
                first = asyncio.create_task(
                    ask(b'{"do": "program", "axis": "x", "name": "shuttle"}')
                )
                await asyncio.to_thread(self.planning.wait, 20.0)
                late = asyncio.create_task(ask(waiting))
                await asyncio.sleep(0.01)
                answers = [await ask(line) for line in then]
                self.may_plan.set()
                self.first = await first
                return await late, answers
            finally:
                loop.cancel()

        return asyncio.run(all_of_it())


@pytest.fixture
def loop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Loop]:
    loop = Loop(tmp_path)
    monkeypatch.setattr(commander, "plan_program", loop.plan_when_allowed)
    yield loop
    loop.may_plan.set()


@pytest.mark.parametrize(
    "line",
    [
        START_Y,
        b'{"do": "move", "axis": "y", "position_m": 0.2}',
        b'{"do": "program", "axis": "y", "name": "ring"}',
    ],
)
@pytest.mark.parametrize(
    ("then", "by"),
    [((STOP_Y,), "a stop of axis y"), ((ESTOP, RESET_Y), "an emergency stop")],
)
def test_what_waited_while_a_stop_came_is_refused_and_orders_nothing(
    loop: Loop, line: bytes, then: tuple[bytes, ...], by: str
) -> None:
    loop.set("y", AxisState.OFF if line is START_Y else AxisState.IDLE)
    no, answers = loop.while_x_is_planned(line, *then)
    assert all(answer["state"] == "off" for answer in answers if "state" in answer)
    assert loop.state("y") is AxisState.OFF
    assert not {(Verb.START, "y"), (Verb.FOLLOW, "y")} & set(loop.taken)
    assert isinstance(no, RefusedError)
    assert no.code is Code.OVERTAKEN
    assert f"was overtaken by {by} that came while it waited" in no.message


def test_what_is_asked_after_a_stop_is_done_however_long_it_waits(loop: Loop) -> None:
    loop.set("y", AxisState.OFF)
    late, _ = loop.while_x_is_planned(START_Y)
    assert late == {"axis": "y", "state": "idle"}


def test_a_stop_of_another_axis_overtakes_nothing(loop: Loop) -> None:
    loop.set("y", AxisState.OFF)
    late, _ = loop.while_x_is_planned(START_Y, b'{"do": "stop", "axis": "x"}')
    assert late == {"axis": "y", "state": "idle"}


def test_a_program_whose_axis_is_stopped_and_enabled_while_it_is_planned_is_not_followed(
    loop: Loop,
) -> None:
    stop, home = b'{"do": "stop", "axis": "x"}', b'{"do": "home", "axis": "x"}'
    loop.while_x_is_planned(b'{"do": "status"}', stop, home)
    assert loop.state("x") is AxisState.IDLE
    assert isinstance(loop.first, RefusedError)
    assert loop.first.code is Code.OVERTAKEN
    assert (Verb.FOLLOW, "x") not in loop.taken


class SlowToOpen:
    """A driver that is opened anew for as long as the test likes."""

    def __init__(self, opened: asyncio.Event) -> None:
        self.opened = opened

    def is_needed(self, name: str) -> bool:
        return True

    async def open_anew(self, name: str) -> str:
        await self.opened.wait()
        return "gantry"


def test_a_reset_that_waits_for_its_driver_does_not_undo_a_later_emergency_stop(loop: Loop) -> None:
    loop.set("y", AxisState.FAULT)

    async def ask() -> list[Any]:
        opened = asyncio.Event()
        slow: Any = SlowToOpen(opened)
        taking = Commander(loop.machine, loop.memory, loop.report, slow)
        reset = asyncio.create_task(taking.handle(parse_request(RESET_Y)))
        await asyncio.sleep(0)
        stopping = asyncio.create_task(taking.handle(parse_request(ESTOP)))
        while not stopping.done():
            loop.obey()
            await asyncio.sleep(1e-3)
        opened.set()
        async with asyncio.timeout(10.0):
            while not reset.done():
                loop.obey()
                await asyncio.sleep(1e-3)
        return await asyncio.gather(reset, return_exceptions=True)

    (no,) = asyncio.run(ask())
    assert loop.state("y") is AxisState.FAULT
    assert isinstance(no, RefusedError)
    assert no.code is Code.OVERTAKEN
    assert no.message.startswith("reset was overtaken by an emergency stop")
