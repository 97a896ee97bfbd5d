"""What a wire does to the messages of one direction, under the ordered faults."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import Generic, Literal, TypeVar

from motorctl_devices.schedule import NEVER, Fault

M = TypeVar("M")

MOST_WAITING = 4096
"""Messages that a delay may hold back; more are lost, as in a full buffer."""


class Line(Generic[M]):
    """One direction of a wire: messages go in with `send` and come out at `deliver`.

    Delay and jitter keep the order of messages, as wires do; `reordering` lets the next message
    overtake one. `spoil` gives a message with wrong bits, `cut` one of a wrong length.
    """

    def __init__(
        self,
        deliver: Callable[[M], None],
        spoil: Callable[[M, Fault], M],
        cut: Callable[[M, Fault], M],
        faults: Sequence[Fault],
        way: Literal["from_device", "to_device"],
    ) -> None:
        self._deliver = deliver
        self._spoil, self._cut = spoil, cut
        self._faults = [fault for fault in faults if fault.order.goes(way)]
        self._to_device = way == "to_device"
        self._active: list[Fault] = []
        self._waiting: deque[tuple[int, M]] = deque(maxlen=MOST_WAITING)
        self._overtaken: M | None = None
        self._calm = True
        self.silent = False
        """Nothing passes: the device is dead or the wire is pulled."""
        self.due_ns = NEVER
        """When `flush` has to be called next."""

    def settle(self) -> None:
        """Take over which faults are in force."""
        self._active = [fault for fault in self._faults if fault.active]
        kinds = {fault.order.kind for fault in self._active}
        if "reordering" not in kinds and self._overtaken is not None:
            self._hand_over(self._overtaken, 0)
            self._overtaken = None
        self._calm = not kinds.intersection(_TOUCHING) and not self._waiting

    def drop(self) -> None:
        """Forget what waits: the device it came from or goes to began anew."""
        self._waiting.clear()
        self._overtaken = None
        self.due_ns = NEVER
        self.settle()

    def send(self, message: M, now_ns: int) -> None:
        """Let a message into the wire."""
        if self._calm:
            if not self.silent:
                self._deliver(message)
            return
        due_ns = now_ns
        copies = 1
        held = False
        for fault in self._active:
            kind = fault.order.kind
            fault.to_device = self._to_device
            if kind == "delay":
                due_ns += fault.amount_ns
                fault.fired += 1
            elif kind == "jitter":
                due_ns += int(fault.random.random() * fault.amount_ns)
                fault.fired += 1
            elif kind == "silence":
                fault.fired += 1
                copies = 0
            elif kind == "bit_errors":
                message = self._spoil(message, fault)
            elif kind in _PER_MESSAGE and fault.strikes():
                if kind == "loss":
                    copies = 0
                elif kind == "duplicates":
                    copies *= 2
                elif kind == "wrong_length":
                    message = self._cut(message, fault)
                else:
                    held = True
        if self.silent or copies == 0:
            return
        if held and self._overtaken is None:
            self._overtaken = message
            return
        for _ in range(min(copies, 8)):
            self._queue(message, due_ns, now_ns)
        if self._overtaken is not None:
            late, self._overtaken = self._overtaken, None
            self._queue(late, due_ns, now_ns)

    def flush(self, now_ns: int) -> None:
        """Deliver what is due."""
        waiting = self._waiting
        while waiting and waiting[0][0] <= now_ns:
            message = waiting.popleft()[1]
            if not self.silent:
                self._deliver(message)
        self.due_ns = waiting[0][0] if waiting else NEVER
        if not waiting:
            self.settle()

    def _queue(self, message: M, due_ns: int, now_ns: int) -> None:
        if not self._waiting and due_ns <= now_ns:
            self._deliver(message)
        else:
            self._hand_over(message, due_ns)

    def _hand_over(self, message: M, due_ns: int) -> None:
        waiting = self._waiting
        waiting.append((max(due_ns, waiting[-1][0]) if waiting else due_ns, message))
        self.due_ns = waiting[0][0]


_PER_MESSAGE = ("loss", "duplicates", "wrong_length", "reordering")
_TOUCHING = ("delay", "jitter", "silence", "bit_errors", *_PER_MESSAGE)


def flip_bits(data: bytes, fault: Fault, first: int = 0) -> bytes:
    """Return the bytes with bits flipped from index `first` on, as the fault orders.

    With `byte_share` each byte may be hit; else a message that is hit has one wrong bit.
    """
    if first >= len(data):
        return data
    share = fault.order.byte_share
    if share is None:
        if not fault.strikes():
            return data
        places = [fault.random.randrange(first, len(data))]
    else:
        draw = fault.random.random
        places = [place for place in range(first, len(data)) if draw() < share]
        fault.fired += bool(places)
    spoiled = bytearray(data)
    for place in places:
        spoiled[place] ^= 1 << fault.random.randrange(8)
    return bytes(spoiled)


def change_length(data: bytes, fault: Fault, longest: int) -> bytes:
    """Return the bytes with some cut off at the end, or one more where there is room."""
    if len(data) < 2 or (len(data) < longest and fault.random.random() < 0.5):
        return data + bytes([fault.random.randrange(256)])
    return data[: fault.random.randrange(1, len(data))]
