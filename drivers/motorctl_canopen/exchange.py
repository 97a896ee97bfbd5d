"""The traffic of a period: SYNC, the drives' answers to it, commands, heartbeat."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import can

from motorctl.hal import Outputs, Status
from motorctl_can.link import Link
from motorctl_canopen import objects
from motorctl_canopen.node import INPUTS, STATE, Node
from motorctl_canopen.options import CanopenOptions

BABBLE = int(Status.CORRUPT)
TAKES_STATE, TAKES_INPUTS, TAKES_EMERGENCY, TAKES_HEARTBEAT = range(4)
HEARTBEATS_A_WATCHDOG = 4
"""So many heartbeats are sent in the time after which a drive that hears none switches off."""
OPENING_PERIOD_S = 0.01
SILENT_PERIODS = 3
"""At most so many periods without SYNC tell that answers which are owed were lost."""
BETWEEN_SILENCES = 8
"""Periods with SYNC, at least, from a silence in which something came to the next."""
REMEMBERED = (1 << 128) - 1
"""Of so many periods it is known whether SYNC was sent; later than that no answer is expected."""
UNSENT_PERIODS = 3
"""So many more without room for SYNC or commands than with it are a bus that is lost."""


class Exchange:
    """All frames of the drives of one bus. Nothing here allocates once it is made."""

    def __init__(self, options: CanopenOptions, nodes: Sequence[Node], period_s: float) -> None:
        self.link: Link
        self._nodes = tuple(nodes)
        self._wait_s = options.sync.wait_s
        self._period_s = period_s
        self._skipped_s = period_s + max(0.5 * period_s, self._wait_s)
        self._room = options.max_frames_per_read
        self._sync = _message(objects.SYNC_ID, 0)
        self._nmt = _message(objects.NMT_ID, 2)
        self._heartbeat = _message(objects.HEARTBEAT_ID + options.host_node, 1)
        self._heartbeat.data[0] = objects.OPERATIONAL
        self._heartbeat_periods = heartbeat_periods(options.watchdog_s, period_s)
        self._until_heartbeat = 0
        self._places: dict[int, tuple[int, Node]] = {}
        for node in nodes:
            self._places[objects.TPDO1_ID + node.number] = (TAKES_STATE, node)
            self._places[objects.EMCY_ID + node.number] = (TAKES_EMERGENCY, node)
            self._places[objects.HEARTBEAT_ID + node.number] = (TAKES_HEARTBEAT, node)
            if node.asked & INPUTS:
                self._places[objects.TPDO2_ID + node.number] = (TAKES_INPUTS, node)
        self.start_over()

    @property
    def wanted(self) -> list[tuple[int, bool]]:
        """Return the frames that are received."""
        answers = [objects.SDO_ANSWER_ID + node.number for node in self._nodes]
        return [(identifier, False) for identifier in (*self._places, *answers)]

    def start_over(self) -> None:
        """Begin as before the first period."""
        for node in self._nodes:
            node.missing = node.asked
            node.forget_owed()
            node.refused = False
        self._quiet_left = 0
        self._until_silence = 0
        self._must_ask = False
        self.asked_s = 0.0
        """What came before this time has been taken: a silence is one until then, not until now, as
        in a pause of the loop frames wait."""
        self._history = 0
        self._sent = self._waiting = False
        self._asked = True
        self._unsent = 0
        self._until_heartbeat = 0

    def take(self, message: can.Message) -> None:
        """Take a frame, whatever it is."""
        if message.is_error_frame:
            self.link.error_frame(message)
            return
        if message.is_extended_id or message.is_remote_frame:
            return
        found = self._places.get(message.arbitration_id)
        if found is None:
            return
        kind, node = found
        if kind == TAKES_HEARTBEAT:
            node.take_heartbeat(message.data, time.monotonic())
        elif kind == TAKES_EMERGENCY:
            node.take_emergency(message.data)
        else:
            bit = STATE if kind == TAKES_STATE else INPUTS
            whole = node.take_state if kind == TAKES_STATE else node.take_inputs
            if not whole(message.data):
                return
            if node.takes_owed(bit):
                # Or it answers this SYNC, after one whose answer was lost: PDOs have no number.
                node.doubted = node.doubted or self._waiting
            elif node.missing & bit:
                node.missing &= ~bit
            else:
                node.doubted = node.refused = True
        self.link.lost = 0

    def ask(self) -> None:
        """Send SYNC, and take the answers until all are here or it takes too long."""
        link = self.link
        self._remember_periods(time.monotonic())
        for node in self._nodes:
            node.next_period(self._sent, self._quiet_left > 0)
        self._sent = False
        room = self._drain(self._room)
        silent = self._stays_silent()
        for node in self._nodes:
            node.missing = node.asked
        if silent:
            return
        self._asked = self._sent = link.send(self._sync)
        if not self._sent:
            return
        self._waiting = True
        deadline = time.monotonic() + self._wait_s
        while room > 0:
            left = deadline - time.monotonic()
            message = link.receive(left if left > 0 else 0)
            if message is not None:
                room -= 1
                self.take(message)
                if self._all_here():
                    break
            elif left <= 0 or link.lost:
                break
        else:
            link.passing |= BABBLE
        self._waiting = False

    def _remember_periods(self, now_s: float) -> None:
        """Note whether the last period had a SYNC, and which ones the loop skipped since."""
        passed_s = now_s - self.asked_s
        self.asked_s = now_s
        history = self._history << 1 | self._sent
        if passed_s > self._skipped_s:
            history <<= min(max(round(passed_s / self._period_s) - 1, 1), 128)
        self._history = history & REMEMBERED

    def _stays_silent(self) -> bool:
        """Tell whether this period has no SYNC: what comes in it is the answer to an older one.

        Answers that are late by whole periods come in it as in every other; where some were lost,
        and the others are in time, nothing comes. The more are owed, the longer it is listened, as
        a late one may be later yet. Only drives that answer are asked: a dead one owes nothing.
        """
        if self._must_ask:
            self._must_ask, self._quiet_left = False, 0
            return False
        if self._quiet_left:
            self._quiet_left -= 1
            if self._quiet_left and not all(n.came or not n.doubted for n in self._nodes):
                return True
            self._quiet_left = 0
            for node in self._nodes:
                if node.doubted and node.judge_silence():
                    self._until_silence = BETWEEN_SILENCES
            return False
        self._until_silence = max(self._until_silence - 1, 0)
        most, tells = 0, not self._until_silence
        for node in self._nodes:
            if node.doubted:
                owed = max(node.owed, 1)
                most, tells = max(most, owed), tells and self._would_come(owed)
        if not most or not tells:
            return False
        self._quiet_left = min(most, SILENT_PERIODS)
        return True

    def _would_come(self, owed: int) -> bool:
        """Tell whether the SYNCs whose late answers would come in a silence now were all sent.

        A period without one, by an older silence or as the loop skipped it, is a hole in late
        answers, and would look as if they had been lost.
        """
        left, place = self._history, -1
        for _ in range(owed):
            if not left:
                return True  # nobody answers so late
            last = left & -left
            left ^= last
            place = last.bit_length() - 1
        first = max(place - SILENT_PERIODS, 0)
        window = ((1 << place + 2) - 1) >> first << first
        return self._history & window == window & REMEMBERED

    def _all_here(self) -> bool:
        return all(not node.missing for node in self._nodes)

    def _drain(self, room: int) -> int:
        """Take what waits, at most `room` frames; return how many more may be taken."""
        link = self.link
        while room > 0:
            message = link.receive(0)
            if message is not None:
                self.take(message)
            elif not link.more():
                return room
            room -= 1
        link.passing |= BABBLE
        return 0

    def send(self, outputs: Outputs) -> None:
        """Send every drive's command, and the heartbeat where it is due."""
        link = self.link
        whole = self._asked
        self._asked = True
        volts, enable = outputs.volts, outputs.enable
        for i, node in enumerate(self._nodes):
            self._must_ask = self._must_ask or (node.was_enabled and not enable[i])
            node.was_enabled = bool(enable[i])
            node.command(float(volts[i]), node.was_enabled)
            whole = link.send(node.message) and whole
            if node.to_start:
                node.to_start = False
                self.send_nmt(objects.NMT_START, node.number)
        self._until_heartbeat -= 1
        if self._until_heartbeat <= 0:
            self._until_heartbeat = self._heartbeat_periods
            whole = link.send(self._heartbeat) and whole
        unsent = self._unsent - 1 if whole else self._unsent + 1
        self._unsent = min(max(unsent, 0), UNSENT_PERIODS)
        if self._unsent == UNSENT_PERIODS:
            link.lose_commands()

    def send_nmt(self, command: int, node: int) -> None:
        """Send a command of network management to one node."""
        self._nmt.data[0], self._nmt.data[1] = command, node
        self.link.send(self._nmt)

    def send_off(self) -> bool:
        """Disable every drive, and let those that wait for a SYNC obey.

        Returns
        -------
        bool
            Whether the bus took all of it.
        """
        whole = True
        for node in self._nodes:
            node.switch_off()
            whole = self.link.send(node.message) and whole
        return self.link.send(self._sync) and whole

    # Before the first tick.

    def listen(self, done: Callable[[], bool], timeout_s: float) -> bool:
        """Take what comes until something is so; return whether it is."""
        deadline = time.monotonic() + timeout_s
        while not done():
            left = deadline - time.monotonic()
            if left <= 0:
                return False
            message = self.link.receive(min(left, OPENING_PERIOD_S))
            if message is not None:
                self.take(message)
            elif self.link.lost:
                time.sleep(min(left, 1e-3))
        return True

    def run(self, done: Callable[[], bool], timeout_s: float) -> bool:
        """Exchange periods, every drive disabled, until something is so; return whether it is."""
        deadline = time.monotonic() + timeout_s
        while not done():
            if time.monotonic() > deadline:
                return False
            for node in self._nodes:
                node.missing = node.asked
                node.command(0.0, False)
                self.link.send(node.message)
            self.link.send(self._sync)
            self.listen(self._all_here, OPENING_PERIOD_S)
            time.sleep(OPENING_PERIOD_S / 10)
        return True


def heartbeat_periods(watchdog_s: float, period_s: float) -> int:
    """Return how many periods lie between two of motorctl's heartbeats.

    Parameters
    ----------
    watchdog_s
        The time after which a drive that hears none switches off [s].
    period_s
        Of the bus [s].
    """
    return max(1, int(watchdog_s / HEARTBEATS_A_WATCHDOG / period_s))


def _message(identifier: int, length: int) -> can.Message:
    return can.Message(
        arbitration_id=identifier, is_extended_id=False, data=bytearray(length), is_rx=False
    )
