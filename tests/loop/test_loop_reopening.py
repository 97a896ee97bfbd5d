"""A driver that is opened anew beside the ticks: what its axes see, and that no tick waits."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from loop_bench import Hand, Still, gantry, homed_by, with_axes, with_driver

from motorctl.errors import RunError
from motorctl.hal import Inputs, Outputs, Status
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import Reply, Verb, reopening
from motorctl.loop.guards.device import FORGET_PLACE
from motorctl.loop.realtime import enter_beside
from motorctl.loop.reopening import ReopeningThread
from motorctl.loop.vocabulary import Word

GONE = Status.BUS_OFF | Status.COMMUNICATION_LOST
HOME_M = 0.1
AWAY_COUNTS = 5000


class Unplugged(Still):
    """Opens when the test lets it; notes what a tick does with it while it is not open."""

    def __init__(self, *arguments) -> None:
        super().__init__(*arguments)
        self.answers = threading.Event()
        self.answers.set()
        self.refuses: Exception | None = None
        self.is_open = False
        self.misused = 0

    def open(self) -> None:
        super().open()
        assert self.answers.wait(60.0)
        if self.refuses is not None:
            raise self.refuses
        self.status[:] = 0
        self.is_open = True

    def close(self) -> None:
        super().close()
        self.is_open = False

    def read(self, inputs: Inputs) -> None:
        super().read(inputs)
        self.misused += not self.is_open

    def write(self, outputs: Outputs) -> None:
        super().write(outputs)
        self.misused += not self.is_open


class Bench(Hand):
    """Ticks by hand, and the thread beside them."""

    def __init__(self) -> None:
        machine = with_driver(gantry(), Unplugged)
        super().__init__(with_axes(machine, homing=homed_by("index", home_position_m=HOME_M)))
        self.bell_fd = os.eventfd(0)
        self.reopening = ReopeningThread(self.tick, self.memory, self.bell_fd)
        self.beside = self.reopening.begin()
        self.orders = 0

    def end(self) -> None:
        busy = self.reopening.end()
        self.tick.close(busy=busy)
        self.memory.close()

    def order(self, axis: str = "x") -> None:
        """Ask for the axis' driver, as the supervisor does."""
        self.orders += 1
        self.memory.status["reopen_axis"][0] = self.names.index(axis)
        self.memory.announce(Word.REOPEN_ASKED, self.orders)
        os.eventfd_write(self.bell_fd, 1)

    def until(self, reached: Callable[[], bool]) -> None:
        """Tick until something is so."""
        deadline = time.monotonic() + 60.0
        while not reached():
            assert time.monotonic() < deadline, self.driver.calls
            self.step()
            time.sleep(1e-4)

    def until_done(self) -> str:
        """Tick until the order is done; give what is told of a driver that is not open."""
        self.until(lambda: self.memory.look_at(Word.REOPEN_DONE) == self.orders)
        status = self.memory.status[0]
        return bytes(status["reopen_told"]).decode() if status["reopen_failed"] else ""

    def lose(self) -> None:
        """Let the bus be gone."""
        self.driver.status[:] = int(GONE)
        self.step()

    def home(self, axis: str = "x") -> None:
        assert self.ask(Verb.HOME, axis) is Reply.OK
        self.driver.status[:] = int(Status.INDEX_LATCHED)
        self.until(lambda: bool(self.status(axis)["homed"]))
        self.driver.status[:] = 0


@pytest.fixture
def bench() -> Iterator[Bench]:
    one = Bench()
    yield one
    one.driver.answers.set()
    one.end()
    os.close(one.bell_fd)


def test_the_place_is_forgotten_and_what_was_learned_is_kept(bench: Bench):
    bench.home()
    assert bench.status()["position_m"] == pytest.approx(HOME_M)
    bench.lose()
    assert bench.status()["state"] == AxisState.FAULT
    assert bench.status()["fault"] == FaultCause.COMMUNICATION
    assert bench.status()["homed"]  # where the device counts on, the bus alone takes no zero
    learned = bench.status()["theta_hat"].copy()
    bench.driver.counts[:] = AWAY_COUNTS
    bench.order()
    assert bench.until_done() == ""
    told = bench.status()
    assert (told["state"], told["homed"]) == (AxisState.FAULT, 0)
    unit_m = bench.tick.machine.axes["x"].encoder.resolution_m
    assert told["position_m"] == pytest.approx(AWAY_COUNTS * unit_m)
    assert np.array_equal(told["theta_hat"], learned)
    # Latched until each axis is reset.
    assert bench.ask(Verb.RESET, "x") is Reply.OK
    assert bench.status()["state"] == AxisState.OFF
    assert bench.ask(Verb.FOLLOW, "x") is Reply.WRONG_STATE
    bench.home()


def test_ticks_go_on_and_leave_the_driver_alone_while_it_is_opened(bench: Bench):
    bench.lose()
    bench.driver.answers.clear()
    bench.order()
    bench.until(lambda: bench.driver.calls == ["open", "safe", "close", "open"])
    bench.steps(200)
    for axis in bench.names:
        assert bench.status(axis)["device_status"] == GONE | Status.STALE
        assert bench.ask(Verb.START, axis) is Reply.STILL_FAULTY
    assert bench.driver.misused == 0
    bench.driver.answers.set()
    assert bench.until_done() == ""
    assert bench.driver.misused == 0
    assert bench.status()["device_status"] == 0


def test_what_cannot_be_opened_stays_gone_and_may_be_tried_again(bench: Bench):
    assert bench.ask(Verb.START) is Reply.OK
    bench.lose()
    for error, told in (
        (RunError("port p: nobody answers"), "port p: nobody answers"),
        (OSError("the cable is out"), "OSError: the cable is out"),
    ):
        bench.driver.refuses = error
        bench.order()
        assert bench.until_done() == told
        bench.steps(5)
        assert bench.status()["device_status"] == GONE | Status.STALE
        assert bench.ask(Verb.RESET) is Reply.STILL_FAULTY
    assert bench.driver.calls == ["open", "safe", "close", "open", "safe", "open", "safe"]
    bench.driver.refuses = None
    bench.order()
    assert bench.until_done() == ""
    assert bench.driver.misused == 0
    assert bench.ask(Verb.RESET) is Reply.OK


def test_an_axis_that_is_enabled_meanwhile_trips_before_its_driver_is_touched(bench: Bench):
    assert bench.ask(Verb.START, "y") is Reply.OK
    assert bench.driver.enable.tolist() == [0, 1]
    bench.order("y")
    bench.until_done()
    told = bench.status("y")
    assert (told["state"], told["fault"]) == (AxisState.FAULT, FaultCause.COMMUNICATION)
    assert bench.driver.enable.tolist() == [0, 0]
    assert bench.driver.calls == ["open", "safe", "close", "open"]


def test_a_driver_that_never_opens_keeps_the_loop_from_no_end(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(reopening, "END_S", 0.1)
    bench = Bench()
    bench.lose()
    bench.driver.answers.clear()
    bench.order()
    bench.until(lambda: bench.driver.calls[-1] == "open" and len(bench.driver.calls) > 1)
    bench.end()
    assert bench.driver.calls == ["open", "safe", "close", "open"]  # nobody else touched it
    bench.driver.answers.set()
    os.close(bench.bell_fd)


def test_a_driver_that_did_not_open_is_not_closed_twice():
    bench = Bench()
    bench.lose()
    bench.driver.refuses = RunError("gone")
    bench.order()
    bench.until_done()
    bench.end()
    os.close(bench.bell_fd)
    assert bench.driver.calls.count("close") == 1
    assert bench.driver.calls[-1] == "safe"


def test_no_status_bit_of_a_driver_means_that_the_place_is_forgotten():
    assert not any(bit & FORGET_PLACE for bit in Status)


def test_a_reopening_thread_runs_below_the_loop_on_its_cpu(monkeypatch: pytest.MonkeyPatch):
    set_to = {}
    monkeypatch.setattr(os, "sched_getscheduler", lambda _: os.SCHED_FIFO)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3})  # where the loop was pinned to
    monkeypatch.setattr(os, "sched_setaffinity", lambda _, cpus: set_to.update(cpus=cpus))

    def schedule(_: int, policy: int, how: os.sched_param) -> None:
        set_to.update(policy=policy, priority=how.sched_priority)

    monkeypatch.setattr(os, "sched_setscheduler", schedule)
    bench = Bench()
    settings = bench.tick.machine.loop
    enter_beside(bench.beside, settings)
    bench.end()
    assert set_to["policy"] == os.SCHED_FIFO
    assert set_to["priority"] == settings.priority - 1
    assert set_to["cpus"] == {3}
    os.close(bench.bell_fd)


def test_a_fault_is_cleared_at_the_axis_own_device_and_its_driver_stays_open(bench: Bench):
    asked: list[int] = []
    bench.driver.clear_fault = asked.append
    bench.step()
    opened = bench.driver.calls.count("open")
    bench.memory.status["reopen_clears"][0] = 1
    bench.order("y")
    assert bench.until_done() == ""
    assert [bench.driver.channels[number].axis for number in asked] == ["y"]
    assert bench.driver.calls.count("open") == opened
