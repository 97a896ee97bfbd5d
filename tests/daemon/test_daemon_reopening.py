"""When a reset opens a driver anew, and what is said where it does not; the loop is the test's."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from daemon_rig import bench_config

from motorctl.config import load
from motorctl.daemon import reopening
from motorctl.daemon.commander import Commander
from motorctl.daemon.protocol import Code, RefusedError, parse_request
from motorctl.daemon.reopening import Reopening
from motorctl.daemon.report import Report
from motorctl.hal import Status, error_bits
from motorctl.log.sample import AxisState
from motorctl.loop import LoopMemory, Phase, Reply, Verb
from motorctl.loop.faults import needs_opening
from motorctl.loop.vocabulary import Word
from motorctl_sim import SimDriver

GONE = Status.BUS_OFF | Status.COMMUNICATION_LOST
RESTARTED = Status.DEVICE_RESTARTED | Status.ENCODER_LOST
RESET_X, RESET_Y = b'{"do": "reset", "axis": "x"}', b'{"do": "reset", "axis": "y"}'


class OpensOnce(SimDriver):
    """Of a library that can be begun once in a process."""

    reopens = False


class Loop:
    """Two axes of one driver, and a loop that answers what the test tells it to."""

    def __init__(self, folder: Path, cls: type[SimDriver] = SimDriver) -> None:
        (folder / "bench.yaml").write_text(bench_config())
        machine = load(str(folder / "bench.yaml"))
        drivers = {name: replace(setup, cls=cls) for name, setup in machine.drivers.items()}
        self.machine = replace(machine, drivers=drivers)
        self.memory = LoopMemory.create(tuple(machine.axes), 6, 400.0)
        self.memory.phase = Phase.RUNNING
        report = Report(self.machine, self.memory, folder / "s")
        reopener = Reopening(self.machine, self.memory, self.rung)
        self.commander = Commander(self.machine, self.memory, report, reopener)
        self.why: str | None = None
        """Why the driver cannot be opened; None: it can."""
        self.hangs = False
        self.ends = False
        """Whether the loop process ends instead of opening anything."""
        self.opened = 0

    def set(self, axis: str, state: AxisState, status: int = 0) -> None:
        rows = self.memory.axis_status_rows[:, list(self.machine.axes).index(axis)]
        rows["state"], rows["device_status"] = state, status

    def rung(self) -> None:
        """Open the driver, as the loop's thread would."""
        asyncio.get_running_loop().call_later(0.05, self.open)

    def open(self) -> None:
        if self.ends:
            self.memory.phase = Phase.FAILED
        if self.hangs or self.ends:
            return
        self.opened += 1
        status = self.memory.status[0]
        status["reopen_failed"] = self.why is not None
        status["reopen_told"] = (self.why or "").encode()
        if self.why is None:
            self.memory.axis_status_rows["device_status"] = 0
        self.memory.announce(Word.REOPEN_DONE, self.memory.look_at(Word.REOPEN_ASKED))

    def _obey(self) -> None:
        taken = self.memory.look_at(Word.MAIL_TAIL)
        command = self.memory.mailbox[taken]
        assert Verb(int(command["verb"])) is Verb.RESET
        self.memory.replies[taken] = Reply.OK
        self.set(list(self.machine.axes)[int(command["axis"])], AxisState.OFF)
        self.memory.announce(Word.MAIL_TAIL, taken + 1)

    def ask(self, *lines: bytes) -> list[Any]:
        """Have the daemon handle requests at once; give each answer or refusal, in a minute."""

        async def obey() -> None:
            while True:
                while self.memory.look_at(Word.MAIL_TAIL) < self.memory.look_at(Word.MAIL_HEAD):
                    self._obey()
                await asyncio.sleep(0)

        async def all_of_them() -> list[Any]:
            obeying = asyncio.create_task(obey())
            try:
                asked = (self.commander.handle(parse_request(line)) for line in lines)
                async with asyncio.timeout(60.0):
                    return await asyncio.gather(*asked, return_exceptions=True)
            finally:
                obeying.cancel()

        return asyncio.run(all_of_them())

    def refused(self, line: bytes) -> RefusedError:
        (no,) = self.ask(line)
        assert isinstance(no, RefusedError), no
        return no


@pytest.fixture
def loop(tmp_path: Path) -> Loop:
    return Loop(tmp_path)


def test_only_what_opening_can_mend_opens_a_driver(loop: Loop) -> None:
    for word in (0, Status.STALE, Status.ENCODER_LOST, Status.AMPLIFIER_FAULT, Status.ESTOP):
        loop.set("x", AxisState.FAULT, word)
        (answer,) = loop.ask(RESET_X)
        assert "opened" not in answer
    assert loop.opened == 0
    for word in (GONE, RESTARTED):
        loop.set("x", AxisState.FAULT, word)
        (answer,) = loop.ask(RESET_X)
        assert (answer["opened"], answer["state"]) == ("gantry", "off")
    assert loop.opened == 2


def test_a_channel_that_is_not_reached_takes_no_other_along() -> None:
    lost = int(Status.COMMUNICATION_LOST)
    assert not needs_opening(lost, [lost, 0])
    assert needs_opening(lost, [lost, lost])
    assert needs_opening(lost, [lost])


def test_a_bus_that_is_lost_while_the_axis_is_off_comes_back_as_well(loop: Loop) -> None:
    for axis in ("x", "y"):
        loop.set(axis, AxisState.OFF, GONE)
    (answer,) = loop.ask(RESET_X)
    assert (answer["opened"], answer["state"]) == ("gantry", "off")


@pytest.mark.parametrize("state", [AxisState.IDLE, AxisState.RUNNING, AxisState.STOPPING])
def test_an_enabled_axis_of_the_same_driver_is_not_taken_along(
    loop: Loop, state: AxisState
) -> None:
    loop.set("x", AxisState.FAULT, GONE)
    loop.set("y", state)
    no = loop.refused(RESET_X)
    assert no.code == Code.WRONG_STATE
    assert "the bus or the port is gone" in no.message
    assert "`motorctl stop y` first" in no.message
    assert loop.opened == 0


def test_why_it_could_not_be_opened_is_told_with_what_to_do(loop: Loop) -> None:
    loop.set("x", AxisState.FAULT, GONE)
    loop.why = "port /dev/ttyUSB0: No such file or directory"
    for tries in (1, 2):
        no = loop.refused(RESET_X)
        assert no.code == Code.STILL_FAULTY
        assert no.message == (
            "axis x: reset refused: driver gantry could not be opened anew: port /dev/ttyUSB0: No "
            "such file or directory. Once that is mended, `motorctl reset x` tries again"
        )
        assert loop.opened == tries


def test_two_resets_at_once_open_the_driver_once(loop: Loop) -> None:
    for axis in ("x", "y"):
        loop.set(axis, AxisState.FAULT, GONE)
    answers = loop.ask(RESET_X, RESET_Y)
    assert [answer["state"] for answer in answers] == ["off", "off"]
    assert loop.opened == 1


def test_a_driver_that_opens_once_in_a_process_says_to_restart_the_daemon(tmp_path: Path) -> None:
    loop = Loop(tmp_path, OpensOnce)
    loop.set("x", AxisState.FAULT, GONE)
    no = loop.refused(RESET_X)
    assert "restart the daemon once the device is back" in no.message
    assert loop.opened == 0


def test_a_driver_that_does_not_come_back_in_time_is_told(
    loop: Loop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reopening, "ANSWER_S", 0.1)
    loop.set("x", AxisState.FAULT, GONE)
    loop.hangs = True
    no = loop.refused(RESET_X)
    assert "driver gantry is not open again after 0.1 s, and still trying" in no.message


def test_whoever_waits_for_a_driver_is_told_when_the_loop_ends(loop: Loop) -> None:
    loop.set("x", AxisState.FAULT, GONE)
    loop.ends = True
    no = loop.refused(RESET_X)
    assert no.code is Code.STOPPING


class KeepsFaults(SimDriver):
    """Of drives that keep their own fault until they are told to forget it."""

    clears_faults = True


class Clears(Loop):
    """A loop whose device forgets its fault, or does not."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, KeepsFaults)
        self.cleared: list[str] = []
        self.lasts = False

    def open(self) -> None:
        if self.ends:
            self.memory.phase = Phase.FAILED
        if self.hangs or self.ends:
            return
        status = self.memory.status[0]
        assert status["reopen_clears"]
        axis = list(self.machine.axes)[int(status["reopen_axis"])]
        self.cleared.append(axis)
        if not self.lasts:
            index = list(self.machine.axes).index(axis)
            self.memory.axis_status_rows["device_status"][:, index] = 0
        self.memory.announce(Word.REOPEN_DONE, self.memory.look_at(Word.REOPEN_ASKED))


def test_reset_asks_a_device_that_keeps_its_fault_to_forget_it(tmp_path: Path) -> None:
    loop = Clears(tmp_path)
    for state in (AxisState.FAULT, AxisState.OFF):
        for axis in ("x", "y"):
            loop.set(axis, state, int(Status.AMPLIFIER_FAULT) | error_bits(0x2310))
        (answer,) = loop.ask(RESET_X)
        assert answer["cleared"]
        assert answer["state"] == "off"
    assert loop.cleared == ["x", "x"]


def test_reset_is_refused_with_the_code_while_the_device_keeps_its_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reopening, "CLEARED_S", 0.05)
    loop = Clears(tmp_path)
    loop.lasts = True
    loop.set("x", AxisState.FAULT, int(Status.AMPLIFIER_FAULT) | error_bits(0x3220))
    no = loop.refused(RESET_X)
    assert no.code is Code.STILL_FAULTY
    assert "error 3220h: under voltage of the DC link" in str(no)


def test_a_fault_that_the_loop_does_not_clear_in_time_is_told_and_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reopening, "ANSWER_S", 0.2)
    loop = Clears(tmp_path)
    loop.hangs = True
    loop.set("x", AxisState.FAULT, int(Status.AMPLIFIER_FAULT))
    no = loop.refused(RESET_X)
    assert no.code is Code.STILL_FAULTY
    assert "the loop did not ask the device within 0.2 s to forget its fault" in no.message
    monkeypatch.undo()
    loop.hangs = False
    loop.open()  # the order that nobody waits for any more
    loop.set("x", AxisState.FAULT, int(Status.AMPLIFIER_FAULT))
    (answer,) = loop.ask(RESET_X)
    assert answer["cleared"]
    assert loop.cleared == ["x", "x"]


def test_whoever_waits_for_a_fault_to_be_cleared_is_told_when_the_loop_ends(tmp_path: Path) -> None:
    loop = Clears(tmp_path)
    loop.ends = True
    loop.set("x", AxisState.FAULT, int(Status.AMPLIFIER_FAULT))
    no = loop.refused(RESET_X)
    assert no.code is Code.STOPPING


def test_a_device_in_order_or_an_enabled_axis_is_asked_nothing(tmp_path: Path) -> None:
    loop = Clears(tmp_path)
    loop.set("x", AxisState.FAULT, 0)
    loop.ask(RESET_X)
    loop.set("y", AxisState.RUNNING, int(Status.AMPLIFIER_FAULT))
    loop.ask(RESET_Y)
    assert loop.cleared == []
