"""What the rigs of the buses share: a device that is played by a peer in a thread of its own."""

from __future__ import annotations

from typing import Any

from motorctl.hal.conformance import Received, Rig


class PeerRig(Rig):
    """Faults to order, and what was received, at a peer."""

    peer: Any
    samples_a_fault = 1
    """Replies that are damaged for one fault to be seen."""

    def move_to(self, counts) -> None:
        self.peer.counts = counts.tolist()

    def received(self) -> Received:
        return Received(self.peer.volts, self.peer.enabled)

    def lose_next_reply(self) -> None:
        self.peer.faults.extend([None] * self.samples_a_fault)

    def garble_next_reply(self, random) -> None:
        self.peer.faults.extend([random] * self.samples_a_fault)

    def go_silent(self) -> None:
        self.peer.silent = True

    def speak_again(self) -> None:
        self.peer.silent = False

    def restart(self) -> None:
        self.peer.restart()

    def vanish(self) -> None:
        self.peer.end()

    def come_back(self) -> None:
        self.peer.restart()
        self.peer.begin()
