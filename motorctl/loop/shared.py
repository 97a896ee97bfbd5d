"""The memory between supervisor and loop process: mailbox, status, program slots, ring of samples.

One memfd, mapped by both. Every field has one writer; a word is announced after the data that it
stands for and looked at before them (`motorctl.loop.handover`), so no lock is needed that one side
could hold while the other waits.
"""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from motorctl.kernels import kernels_cached, specialise
from motorctl.loop.excitation import Excitation
from motorctl.loop.layout import (
    HEADER_BYTES,
    KEPT_FOR_STOPS,
    MAILBOX_SIZE,
    PROGRAM_SEGMENTS,
    RING_SECONDS,
    places,
)
from motorctl.loop.learned_feedforward import LearnedFeedforward, write_slot
from motorctl.loop.sample_ring import SampleRing
from motorctl.loop.vocabulary import STATUS_ROWS, Phase, Reply, Verb, Word

with kernels_cached():
    from motorctl.loop.handover import announce


class LoopMemory(SampleRing):
    """The mapped memory, seen as numpy views. Made by the supervisor, attached by the loop."""

    def __init__(self, fd: int, layout: Mapping[str, int]) -> None:
        _, size = places(layout)
        if os.fstat(fd).st_size < size:
            os.ftruncate(fd, size)
        super().__init__(fd, layout, writes=True)
        self.axis_status_rows: NDArray[np.void] = self._view("axis_status_rows")
        """Shape (STATUS_ROWS, axes): a row a tick, that of the ring's row modulo STATUS_ROWS."""
        # As bytes: numpy copies a record field by field, which takes three times as long.
        self._axis_status_bytes: NDArray[np.uint8] = self.axis_status_rows.view(np.uint8)
        self.mailbox: NDArray[np.void] = self._view("mailbox")
        self.replies: NDArray[np.int64] = self._view("replies")
        self.segments: NDArray[np.void] = self._view("segments")
        self.segment_counts: NDArray[np.int64] = self._view("segment_counts")
        self.excitations: NDArray[np.void] = self._view("excitations")
        self.learned: NDArray[np.void] = self._view("learned")
        self._programs = itertools.count(1)
        with kernels_cached():
            self._announce = specialise(announce, self.status, 0, 0)

    @classmethod
    def create(cls, axes: Sequence[str], parameters: int, rate_hz: float) -> LoopMemory:
        """Make the memory.

        Parameters
        ----------
        axes
            Names of the axes.
        parameters
            Length of the longest theta.
        rate_hz
            The loop's rate; the ring holds RING_SECONDS of it.
        """
        fd = os.memfd_create("motorctl-loop", 0)
        # Whoever was handed a descriptor to read may open it anew: to write, only its owner.
        os.fchmod(fd, 0o600)
        layout = {
            "axes": len(axes),
            "parameters": parameters,
            "ring_rows": -(-max(4096, int(RING_SECONDS * rate_hz)) // STATUS_ROWS) * STATUS_ROWS,
            "segments": PROGRAM_SEGMENTS,
        }
        os.ftruncate(fd, HEADER_BYTES)
        os.pwrite(fd, json.dumps(layout).encode().ljust(HEADER_BYTES, b"\0"), 0)
        return cls(fd, layout)

    def open_to_read(self) -> int:
        """Return a descriptor of the memory that reads and cannot write, for another process."""
        return os.open(f"/proc/self/fd/{self.fd}", os.O_RDONLY | os.O_CLOEXEC)

    @property
    def notes(self) -> list[str]:
        """What the drivers found worth knowing when they were opened."""
        text: bytes = self.status["notes"][0]
        return text.decode(errors="replace").splitlines()

    @property
    def phase(self) -> Phase:
        """How far the loop process is."""
        return Phase(self.look_at(Word.PHASE))

    @phase.setter
    def phase(self, phase: Phase) -> None:
        self.announce(Word.PHASE, phase)

    def announce(self, word: Word, value: int) -> None:
        """Write a word after what it announces."""
        self._announce(self.status, word, value)

    @property
    def axis_status(self) -> NDArray[np.void]:
        """The axes' status after the last tick, shape (axes,): a copy, every field of one tick.

        A loop process that dies within a tick leaves the status of the tick before.
        """
        while True:
            head = self._look_at(self.status, Word.RING_HEAD)
            newest = (head - 1) % self.ring_rows % STATUS_ROWS
            copied = self._axis_status_bytes[newest].copy()
            # The row is written anew in the tick after these; then it may be torn.
            if self._look_at(self.status, Word.RING_HEAD) < head + STATUS_ROWS - 1:
                told: NDArray[np.void] = copied.view(self.axis_status_rows.dtype)
                return told

    def beat(self) -> None:
        """Tell the loop that the supervisor lives; call it often within `loop.patience_s`."""
        self.status["beat"][0] += 1

    def post(
        self, verb: Verb, axis: int = 0, *, slot: int = 0, tick: int = 0, program: int = 0
    ) -> int:
        """Put a command into the mailbox.

        Parameters
        ----------
        verb
            What to do.
        axis
            Index of the axis; verbs for all axes ignore it.
        slot
            With FOLLOW: the program slot, from `load_program`.
        tick
            With FOLLOW: the tick at which the program begins; 0: at once.
        program
            With FOLLOW: a number that the axes of one program share, from `program_number`; 0: the
            axis follows its program alone.

        Returns
        -------
        int
            The number under which `reply` answers.

        Raises
        ------
        BufferError
            While the loop has not yet taken the last 60 commands; 64 with ESTOP and SHUTDOWN.
        """
        head: int = self._look_at(self.status, Word.MAIL_HEAD)
        room = MAILBOX_SIZE - (0 if verb in (Verb.ESTOP, Verb.SHUTDOWN) else KEPT_FOR_STOPS)
        if head - self._look_at(self.status, Word.MAIL_TAIL) >= room:
            raise BufferError(
                f"the loop has not taken the last {room} commands: `motorctl status` tells whether "
                "it ticks"
            )
        self.mailbox[head % MAILBOX_SIZE] = (verb, axis, slot, tick, program)
        self._announce(self.status, Word.MAIL_HEAD, head + 1)
        return head

    def program_number(self) -> int:
        """Return a number for a program that several axes begin to follow; each time another."""
        return next(self._programs)

    def reply(self, number: int) -> Reply | None:
        """Return the answer to a command, or None until the tick that took it is over."""
        if self._look_at(self.status, Word.MAIL_TAIL) <= number:
            return None
        return Reply(int(self.replies[number % MAILBOX_SIZE]))

    def load_program(
        self,
        axis: int,
        segments: NDArray[np.void],
        learned: LearnedFeedforward | None = None,
    ) -> int:
        """Write a trajectory into the program slot that the axis does not follow.

        Parameters
        ----------
        axis
            Index of the axis.
        segments
            Of SEGMENT, shape (N,).
        learned
            What an axis that learns adds meanwhile to its command; None: nothing.

        Returns
        -------
        int
            The slot, for `post`.

        Raises
        ------
        ValueError
            Where there are more segments than a slot holds.
        """
        if len(segments) > self.layout["segments"]:
            raise ValueError(
                f"the program has {len(segments)} segments; limit {self.layout['segments']}. "
                "Use fewer points or cycles"
            )
        slot = 1 if int(self.axis_status["slot"][axis]) == 0 else 0
        self.segments[axis, slot, : len(segments)] = segments
        self.segment_counts[axis, slot] = len(segments)
        write_slot(self.learned[axis, slot], learned, self.models_row)
        return slot

    def load_excitation(self, axis: int, excitation: Excitation) -> None:
        """Write an excitation into the axis' slot; not while the axis is excited.

        Parameters
        ----------
        axis
            Index of the axis.
        excitation
            One that the axis allows.
        """
        slot = self.excitations[axis]
        slot["volts"][: excitation.ticks] = excitation.volts
        slot["ticks"], slot["fade"] = excitation.ticks, excitation.fade_ticks
        slot["total"] = excitation.total_ticks
