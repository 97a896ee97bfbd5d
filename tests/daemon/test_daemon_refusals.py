"""What the daemon says no to, whatever the loop is doing; against a loop of the test's own."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Coroutine, Iterator
from pathlib import Path
from typing import Any, TypeVar

import pytest
from daemon_rig import bench_config

from motorctl.config import load
from motorctl.daemon.client import DaemonRefusedError
from motorctl.daemon.commander import Commander
from motorctl.daemon.protocol import ExciteCommand, RefusedError, Request, parse_request
from motorctl.daemon.report import Report
from motorctl.hal import Status
from motorctl.loop import LoopMemory, Phase, Reply, Verb
from motorctl.loop.states import OPERATION, State

T = TypeVar("T")


class Loop:
    """Answers every command with the same reply, and remembers what it was asked."""

    def __init__(self, folder: Path) -> None:
        (folder / "bench.yaml").write_text(bench_config())
        self.machine = load(str(folder / "bench.yaml"))
        self.memory = LoopMemory.create(tuple(self.machine.axes), 6, 400.0)
        self.report = Report(self.machine, self.memory, folder / "s")
        self.commander = Commander(self.machine, self.memory, self.report)
        self.asked: list[Verb] = []
        self.phase(Phase.RUNNING)

    def phase(self, phase: Phase) -> None:
        self.memory.phase = phase

    def ask(self, line: str, reply: Reply = Reply.OK) -> dict[str, Any]:
        """Have the daemon handle a request while the loop answers."""
        return self.handle(parse_request(line.encode()), reply)

    def handle(self, request: Request, reply: Reply = Reply.OK) -> dict[str, Any]:
        """The same with a request."""
        return self._while_it_answers(self.commander.handle(request), reply)

    def leave(self, request: ExciteCommand) -> None:
        """Have the daemon know that whoever excited an axis is gone."""
        self._while_it_answers(self.commander.excitations.leave(request), Reply.OK)

    def _while_it_answers(self, doing: Coroutine[Any, Any, T], reply: Reply) -> T:
        async def answer() -> None:
            status = self.memory.status[0]
            while True:
                while status["mail_tail"] < status["mail_head"]:
                    self.asked.append(Verb(int(self.memory.mailbox["verb"][status["mail_tail"]])))
                    self.memory.replies[status["mail_tail"]] = reply
                    status["mail_tail"] += 1
                await asyncio.sleep(0)

        async def both() -> T:
            answering = asyncio.create_task(answer())
            try:
                return await doing
            finally:
                answering.cancel()

        return asyncio.run(both())

    def refusal(self, line: str, reply: Reply = Reply.OK) -> RefusedError:
        with pytest.raises(RefusedError) as refused:
            self.ask(line, reply)
        return refused.value


@pytest.fixture
def loop(tmp_path: Path) -> Iterator[Loop]:
    made = Loop(tmp_path)
    yield made
    made.memory.close()


def test_an_emergency_stop_is_taken_as_long_as_the_loop_ticks(loop: Loop) -> None:
    loop.report.stopping = True
    assert loop.ask('{"do": "estop"}') == {"axes": ["x", "y"]}
    assert loop.asked == [Verb.ESTOP]
    assert loop.refusal('{"do": "start", "axis": "x"}').code == "stopping"
    assert loop.asked == [Verb.ESTOP]
    for phase in (Phase.STOPPED, Phase.FAILED):
        loop.phase(phase)
        assert loop.refusal('{"do": "estop"}').code == "stopping"


PREPARING = {
    Phase.STARTING: ("the loop process is starting: it loads its libraries",),
    Phase.COMPILING: ("the control loop is being compiled", "about 10 s, more on a busy computer"),
}


@pytest.mark.parametrize("phase", PREPARING)
def test_only_a_loop_that_is_about_to_tick_is_called_not_ready(loop: Loop, phase: Phase) -> None:
    loop.phase(phase)
    no = loop.refusal('{"do": "stop", "axis": "x"}')
    assert no.code == "not_ready"
    for part in (*PREPARING[phase], "s so far; try again in some seconds"):
        assert part in no.message
    assert loop.refusal('{"do": "stop", "axis": "z"}').code == "unknown_axis"
    told = loop.ask('{"do": "status"}')["loop"]
    assert told["phase"] == phase.name.lower()
    assert PREPARING[phase][0] in told["preparing"]
    loop.phase(Phase.RUNNING)
    assert loop.ask('{"do": "status"}')["loop"]["preparing"] is None


@pytest.mark.parametrize(
    ("word", "lost"),
    [
        (Status(0), False),
        (Status.STALE | Status.ESTOP, False),
        (Status.COMMUNICATION_LOST | Status.BUS_OFF, True),
        (Status.ENCODER_LOST | Status.DEVICE_RESTARTED, True),
    ],
)
def test_the_status_tells_whether_samples_are_missing_or_the_device_is_lost(
    loop: Loop, word: Status, lost: bool
) -> None:
    loop.memory.axis_status_rows["device_status"][:, 0] = word
    axes = loop.ask('{"do": "status"}')["axes"]
    assert (axes["x"]["samples"]["lost"], axes["y"]["samples"]["lost"]) == (lost, False)


@pytest.mark.parametrize("command", ["start", "reset"])
def test_an_axis_that_still_moves_is_named(loop: Loop, command: str) -> None:
    loop.memory.axis_status_rows["velocity_m_s"] = -0.25
    no = loop.refusal(f'{{"do": "{command}", "axis": "y"}}', Reply.STILL_MOVING)
    assert no.code == "still_moving"
    assert no.message == (
        "axis y still moves, with 0.25 m/s: wait until it is slower than 0.01 m/s, 1% of its top "
        f"speed, then {command} is possible"
    )
    assert DaemonRefusedError(no.code, no.message).exit_status == 2


NEXT_STEP = r"`motorctl |possible now: |try again|wait until"


@pytest.mark.parametrize("command", ["start", "stop", "home", "reset"])
@pytest.mark.parametrize("reply", [reply for reply in Reply if reply is not Reply.OK])
def test_whatever_the_loop_refuses_the_answer_says_what_to_do_next(
    loop: Loop, reply: Reply, command: str
) -> None:
    loop.memory.axis_status_rows["device_status"] = Status.ENCODER_LOST
    if reply is Reply.NOT_POWERED and command == "home":
        return  # it is enabled then, and asked again
    no = loop.refusal(f'{{"do": "{command}", "axis": "x"}}', reply)
    assert no.message.startswith("axis x")
    assert re.search(NEXT_STEP, no.message), f"it says no next step: {no.message}"
    for told in re.findall(r"`motorctl ([a-z]+)", no.message):
        assert told in {"start", "stop", "home", "reset", "status"}


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("command", ["move", "program"])
def test_a_motion_that_a_state_refuses_is_told_what_is_possible(
    loop: Loop, state: State, command: str
) -> None:
    lead(loop, state)
    rest = '"position_m": 0.1' if command == "move" else '"name": "shuttle"'
    no = loop.refusal(f'{{"do": "{command}", "axis": "x", {rest}}}')
    assert re.search(NEXT_STEP, no.message)
    if state is State.FAULT:
        assert "`motorctl status x` tells why it tripped, and what to do" in no.message


@pytest.mark.parametrize(
    ("rest", "told"),
    [
        ('"position_m": 0.9', "target 0.9 m: .* the travel -0.05 to 0.45 m, limits.travel_m"),
        ('"by_m": -0.5', "target -0.5 m: must lie within the travel"),
        (
            '"position_m": 0.1, "velocity_m_s": 5',
            "5 m/s: .* at most 1 m/s, limits.max_vel",
        ),
        ('"position_m": 0.1, "acceleration_m_s2": 50', "at most 10 m/s.2, limits.max_accel"),
    ],
)
def test_a_move_beyond_a_limit_is_told_value_unit_limit_and_key(
    loop: Loop, rest: str, told: str
) -> None:
    lead(loop, State.HOLDING)
    loop.memory.axis_status_rows["homed"] = 1
    no = loop.refusal(f'{{"do": "move", "axis": "x", {rest}}}')
    assert no.code == "out_of_limits"
    assert re.search(told, no.message)


def test_a_daemon_that_ends_says_when_to_ask_again(loop: Loop) -> None:
    loop.phase(Phase.FAILED)
    assert "ask again once it is started anew" in loop.refusal('{"do": "estop"}').message
    loop.phase(Phase.RUNNING)
    loop.report.stopping = True
    no = loop.refusal('{"do": "start", "axis": "x"}')
    assert "takes no command but estop; ask again once it is started anew" in no.message


EXCITE = '{"do": "excite", "axis": "x", "volts": [%s], "periods": %d, "fade_periods": 1}'


def lead(loop: Loop, state: State, excitation_left: int = 0) -> None:
    """Let the loop's status say what an axis does."""
    loop.memory.axis_status_rows["state"] = state.told
    loop.memory.axis_status_rows["inner_state"] = state
    loop.memory.axis_status_rows["excitation_left"] = excitation_left


def test_an_excitation_reaches_the_axis_slot_whole(loop: Loop) -> None:
    lead(loop, State.HOLDING)
    volts = [0.01 * (k % 100) for k in range(400)]
    answer = loop.ask(EXCITE % (", ".join(map(str, volts)), 3))
    assert answer == {"axis": "x", "duration_s": pytest.approx(5 * 400 / 400.0)}
    assert loop.asked == [Verb.EXCITE]
    slot = loop.memory.excitations[0]
    assert slot["volts"][:400].tolist() == volts
    assert (slot["ticks"], slot["fade"], slot["total"]) == (400, 400, 2000)


def test_no_axis_is_excited_beyond_its_limit_or_for_too_long(loop: Loop) -> None:
    lead(loop, State.HOLDING)
    no = loop.refusal(EXCITE % (", ".join(["2.5"] * 200), 3))
    assert no.code == "out_of_limits"
    assert "2.5 V: limit 2 V (limits.max_excitation_share 0.2 of 10 V)" in no.message
    no = loop.refusal(EXCITE % (", ".join(["1"] * 200), 100_000))
    assert "limit 1800 s" in no.message
    assert loop.asked == []


@pytest.mark.parametrize("state", [s for s in State if s not in OPERATION or s is State.HOMING])
def test_an_axis_that_is_not_led_is_not_excited_and_what_is_possible_is_told(
    loop: Loop, state: State
) -> None:
    lead(loop, state)
    # The loop has the last word of an axis that is enabled and waits for its law.
    no = loop.refusal(EXCITE % (", ".join(["1"] * 200), 3), Reply.WRONG_STATE)
    assert no.code == "wrong_state"
    assert "excite is not possible; possible now: " in no.message
    assert state.told.name.lower() in no.message


def test_an_axis_that_is_excited_keeps_its_excitation(loop: Loop) -> None:
    lead(loop, State.HOLDING, excitation_left=17)
    before = loop.memory.excitations[0].copy()
    no = loop.refusal(EXCITE % (", ".join(["1"] * 200), 3))
    assert no.message == "axis x is excited already: wait until that ends, or stop the axis"
    assert loop.memory.excitations[0] == before
    assert loop.ask('{"do": "status"}')["axes"]["x"]["excitation"] == {"left_s": 17 / 400.0}


def test_what_became_of_an_axis_after_its_excitation_is_not_stopped(loop: Loop) -> None:
    lead(loop, State.HOLDING)
    first, second = (parse_request((EXCITE % (", ".join(["1"] * 200), n)).encode()) for n in (3, 4))
    assert isinstance(first, ExciteCommand)
    for request in (first, second):
        loop.handle(request)
    lead(loop, State.FOLLOWING, excitation_left=17)  # by the second: who left was the first
    loop.leave(first)
    assert loop.asked == [Verb.EXCITE, Verb.EXCITE]
    assert isinstance(second, ExciteCommand)
    loop.leave(second)
    assert loop.asked == [Verb.EXCITE, Verb.EXCITE, Verb.STOP]
    lead(loop, State.FOLLOWING)  # a motion after it
    loop.leave(second)
    assert loop.asked == [Verb.EXCITE, Verb.EXCITE, Verb.STOP]


def test_home_of_an_absolute_axis_in_fault_tells_its_state_and_what_is_possible(loop: Loop) -> None:
    lead(loop, State.FAULT)
    no = loop.refusal('{"do": "home", "axis": "x"}', Reply.NO_HOMING)
    assert no.code == "wrong_state"
    assert "axis x is in fault: home is not possible; possible now: " in no.message
    lead(loop, State.HOLDING)
    assert loop.refusal('{"do": "home", "axis": "x"}', Reply.NO_HOMING).code == "no_homing"
