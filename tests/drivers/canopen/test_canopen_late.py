"""Answers to SYNC that are late or lost: a PDO has no number, and must not pass for a newer one."""

from __future__ import annotations

import struct
from collections.abc import Set as AbstractSet
from unittest.mock import patch

import can
from canopen_bench import PERIOD_S, data
from hypothesis import example, given, settings
from hypothesis import strategies as st

from motorctl.hal import Channel, Status
from motorctl_canopen import exchange as exchange_module
from motorctl_canopen.exchange import Exchange
from motorctl_canopen.node import Node
from motorctl_canopen.options import CanopenOptions

PERIODS = 250
WAIT = 0.7
"""Share of a period for which a read waits."""
OPERATION_ENABLED = 0x27


class LateBus:
    """Two drives whose answers come a time after SYNC, and the clock; it counts in periods."""

    lost = passing = 0

    def __init__(self, late: float) -> None:
        self.now = self.waited_s = 0.0
        self.late = late
        self.loses: set[int] = set()
        """Periods in which answers are lost."""
        self.dead_from: dict[int, int] = {}
        """From which period on a node answers no more."""
        self.stalls: dict[int, float] = {}
        """From the beginning of a period on nothing comes for so many periods, then all at once."""
        self._coming: list[tuple[float, int, int]] = []
        self._asked_at = -1.0

    def send(self, message: can.Message) -> bool:
        if message.arbitration_id == 0x80:
            self._asked_at = self.now
            if int(self.now) not in self.loses:
                self._coming += [
                    (self.now + self.late, node, int(self.now))
                    for node in (1, 2)
                    if self.now < self.dead_from.get(node, PERIODS)
                ]
        return True

    def monotonic(self) -> float:
        """Return the time as motorctl reads it [s]."""
        return self.now * PERIOD_S + self.waited_s

    def receive(self, timeout_s: float) -> can.Message | None:
        # By the periods alone: after SYNC it is waited for, however long that takes this computer.
        until = self.now + (WAIT if self._asked_at == self.now else 0.0)
        if not self._coming or self._arrives(self._coming[0][0]) > until:
            self.waited_s += timeout_s
            return None
        _, node, position = self._coming.pop(0)
        told = bytearray(struct.pack("<Hi", OPERATION_ENABLED, position))
        return can.Message(arbitration_id=0x180 + node, is_extended_id=False, data=told)

    def _arrives(self, due: float) -> float:
        ends = [begin + lasts for begin, lasts in self.stalls.items() if begin <= due]
        return max(due, *ends, 0.0)

    def more(self) -> bool:
        return False


def fresh_samples(bus: LateBus, skipped: AbstractSet[int] = frozenset()) -> list[tuple[int, int]]:
    """Return in which periods a sample was told as new, and from which period it was.

    In `skipped` periods the loop does not come to ask.
    """
    node = {"rated_torque_v": 10.0}
    nodes = {axis: {**node, "node": i} for i, axis in enumerate("xy", 1)}
    options = CanopenOptions.model_validate(data(nodes=nodes, sync={"wait_s": 2e-5}))
    made = [
        Node(options.nodes[axis], Channel(axis, i, 0.5e-6, 32, 10.0), PERIOD_S, 1.0, 1e9)
        for i, axis in enumerate("xy")
    ]
    exchange = Exchange(options, made, PERIOD_S)
    exchange.link = bus  # type: ignore[assignment]
    found = []
    for period in range(PERIODS):
        if period in skipped:
            continue
        bus.now = float(period)
        bus.waited_s = 0.0
        with patch.object(exchange_module, "time", bus):
            exchange.ask()
        words = [drive.status(0.0) for drive in made]
        if not words[0] & Status.STALE:
            found.append((period, made[0].shown))
    return found


def test_answers_in_time_are_all_new():
    assert fresh_samples(LateBus(0.3)) == [(k, k) for k in range(PERIODS)]


@given(st.floats(WAIT + 0.01, 100.0))
@example(1.2)
@example(4.3)
@example(30.3)
def test_answers_that_are_late_never_pass_for_newer_ones(late):
    assert fresh_samples(LateBus(late)) == []


@settings(max_examples=300)
@given(st.floats(WAIT + 0.01, 40.0), st.sets(st.integers(1, PERIODS - 1), max_size=6))
def test_late_answers_never_pass_for_newer_ones_where_the_loop_skips_periods(late, skipped):
    assert fresh_samples(LateBus(late), skipped) == []


@settings(max_examples=300)
@given(
    st.floats(2.0 + WAIT + 0.01, 40.0),
    st.dictionaries(st.integers(1, PERIODS - 1), st.floats(0.0, 2.9), max_size=4),
    st.sets(st.integers(1, PERIODS - 1), max_size=4),
)
def test_late_answers_never_pass_for_newer_ones_where_a_few_come_later_yet(late, stalls, skipped):
    bus = LateBus(late)
    bus.stalls = stalls
    assert fresh_samples(bus, skipped) == []


@given(st.sets(st.integers(1, PERIODS - 1)))
def test_where_answers_are_lost_every_sample_is_of_its_own_period(lost):
    bus = LateBus(0.3)
    bus.loses = lost
    assert all(period == position for period, position in fresh_samples(bus))


def test_a_lost_answer_costs_three_samples():
    bus = LateBus(0.3)
    bus.loses = {100}
    found = fresh_samples(bus)
    missing = set(range(PERIODS)) - {period for period, _ in found}
    assert missing == {100, 101, 102}  # it, one that may be its late answer, one without SYNC


def test_beside_a_dead_drive_a_lost_answer_of_the_other_costs_three_samples_as_ever():
    bus = LateBus(0.3)
    bus.dead_from, bus.loses = {2: 50}, {100, 150}
    missing = set(range(PERIODS)) - {period for period, _ in fresh_samples(bus, {140})}
    assert missing == {100, 101, 102, 140, 150, 151, 152}


def test_a_period_that_the_loop_skipped_in_a_long_silence_costs_nothing_after_it():
    bus = LateBus(0.3)
    bus.loses = set(range(20, 200))
    found = [period for period, _ in fresh_samples(bus, {190})]
    assert min(period for period in found if period > 20) <= 206


def test_a_drive_that_was_silent_is_heard_five_periods_after_it_speaks_again():
    bus = LateBus(0.3)
    bus.loses = set(range(100, 200))
    found = [period for period, _ in fresh_samples(bus)]
    assert min(period for period in found if period > 100) == 204
