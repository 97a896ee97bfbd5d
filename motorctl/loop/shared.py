"""The memory between supervisor and loop process: mailbox, status, program slots, ring of samples.

One memfd, mapped by both. Every field has one writer; a word is announced after the data that it
stands for and looked at before them (`motorctl.loop.handover`), so no lock is needed that one side
could hold while the other waits.
"""

from __future__ import annotations

import itertools
import json
import mmap
import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motorctl.kernels import kernels_cached, specialise
from motorctl.log.sample import TICK_SAMPLE, axis_sample
from motorctl.loop.excitation import EXCITATION, Excitation
from motorctl.loop.vocabulary import STATUS_ROWS, Phase, Reply, Verb, Word
from motorctl.motion import SEGMENT

with kernels_cached():
    from motorctl.loop.handover import announce, look_at

HEADER_BYTES = 4096
NOTES_BYTES = 4096
REOPEN_TOLD_BYTES = 1024
MODELS_TOLD_BYTES = 1024
MAILBOX_SIZE = 64
KEPT_FOR_STOPS = 4
"""Of its places: whoever floods it with commands leaves room for an emergency stop."""
PROGRAM_SEGMENTS = 65536
"""Longest program of one axis, in segments."""
RING_SECONDS = 8.0

LOOP_STATUS = np.dtype(
    [
        ("pid", "i8"),
        ("phase", "i8"),
        ("beat", "i8"),  # written by the supervisor
        ("tick", "i8"),  # the last tick that was finished
        ("time_s", "f8"),
        ("overruns", "i8"),
        ("skipped_periods", "i8"),
        ("degraded", "u8"),
        ("ring_head", "i8"),  # rows written so far
        ("mail_head", "i8"),  # written by the supervisor
        ("mail_tail", "i8"),  # commands whose replies can be read
        ("mail_taken", "i8"),  # commands that the loop has taken; its own
        ("message", "S512"),  # why the process failed or ended
        ("notes", f"S{NOTES_BYTES}"),  # of the drivers, when they were opened, a line each
        ("reopen_asked", "i8"),  # drivers to open anew until now, one at a time; the supervisor's
        ("reopen_axis", "i8"),  # an axis of the last one; the supervisor's
        ("reopen_clears", "i8"),  # 1: its device is only to forget a fault; the supervisor's
        ("reopen_done", "i8"),  # orders of these that are done
        ("reopen_failed", "i8"),  # 1: the last one is not open
        ("reopen_told", f"S{REOPEN_TOLD_BYTES}"),  # why, or what it notes, a line each
        ("models_done", "i8"),  # the last order for other models that is done
        ("models_refused", "i8"),  # 1: the old ones go on
        ("models_told", f"S{MODELS_TOLD_BYTES}"),  # why
        ("models_row", "i8"),  # rows written so far when the models last changed
    ],
    align=True,
)

COMMAND = np.dtype(
    [
        ("verb", "i8"),
        ("axis", "i8"),
        ("slot", "i8"),
        ("tick", "i8"),
        ("program", "i8"),  # a number that the axes of one program share; 0: it moves one alone
    ],
    align=True,
)


def axis_status(parameters: int) -> np.dtype[np.void]:
    """Return the dtype of one axis' status, for a theta of at most `parameters` entries."""
    return np.dtype(
        [
            ("state", "i4"),  # AxisState
            ("inner_state", "i4"),  # motorctl.loop.states.State
            ("fault", "i4"),  # FaultCause
            ("homed", "i4"),
            ("slot", "i4"),  # program slot in use, or -1
            ("position_m", "f8"),
            ("velocity_m_s", "f8"),
            ("reference_m", "f8"),
            ("reference_velocity_m_s", "f8"),
            ("following_error_m", "f8"),
            ("command_v", "f8"),
            ("d0_hat_v", "f8"),
            ("theta_hat", "f8", (parameters,)),
            ("fault_value", "f8"),  # what tripped the limit
            ("fault_limit", "f8"),
            ("fault_time_s", "f8"),
            ("fault_status", "i8"),  # the driver's status word then
            ("device_status", "i8"),  # and now
            ("excitation_left", "i8"),  # ticks of the axis until its excitation ends; 0: none
            ("held_ticks", "i8"),  # without a new sample until now
            ("missed_ticks", "i8"),  # all of them since the loop began
            ("longest_missed_ticks", "i8"),
            ("skew_m", "f8"),  # of a dual drive; zero else, as the next ones
            ("skew_reference_m", "f8"),
            ("skew_command_v", "f8"),
            ("second_device_status", "i8"),
        ],
        align=True,
    )


class LoopMemory:
    """The mapped memory, seen as numpy views. Made by the supervisor, attached by the loop."""

    def __init__(self, fd: int, layout: dict[str, int]) -> None:
        self.fd = fd
        self.layout = layout
        axes, parameters = layout["axes"], layout["parameters"]
        self.ring_rows, segments = layout["ring_rows"], layout["segments"]
        parts: list[tuple[str, np.dtype[np.void] | str, tuple[int, ...]]] = [
            ("_status", LOOP_STATUS, (1,)),
            ("axis_status_rows", axis_status(parameters), (STATUS_ROWS, axes)),
            ("mailbox", COMMAND, (MAILBOX_SIZE,)),
            ("replies", "i8", (MAILBOX_SIZE,)),
            ("segments", SEGMENT, (axes, 2, segments)),
            ("segment_counts", "i8", (axes, 2)),
            ("excitations", EXCITATION, (axes,)),
            ("ticks", TICK_SAMPLE, (self.ring_rows,)),
            ("samples", axis_sample(parameters), (self.ring_rows, axes)),
        ]
        offset = HEADER_BYTES
        places = []
        for name, dtype, shape in parts:
            places.append((name, np.dtype(dtype), shape, offset))
            size = np.dtype(dtype).itemsize * int(np.prod(shape))
            offset += -(-size // 4096) * 4096
        if os.fstat(fd).st_size < offset:
            os.ftruncate(fd, offset)
        self._map = mmap.mmap(fd, offset)
        views = {
            name: np.frombuffer(self._map, dtype, int(np.prod(shape)), place).reshape(shape)
            for name, dtype, shape, place in places
        }
        self.status: NDArray[np.void] = views["_status"]
        """Shape (1,), of LOOP_STATUS."""
        self.axis_status_rows: NDArray[np.void] = views["axis_status_rows"]
        """Shape (STATUS_ROWS, axes): a row a tick, that of the ring's row modulo STATUS_ROWS."""
        # As bytes: numpy copies a record field by field, which takes three times as long.
        self._axis_status_bytes: NDArray[np.uint8] = self.axis_status_rows.view(np.uint8)
        self.mailbox: NDArray[np.void] = views["mailbox"]
        self.replies: NDArray[np.int64] = views["replies"]
        self.segments: NDArray[np.void] = views["segments"]
        self.segment_counts: NDArray[np.int64] = views["segment_counts"]
        self.excitations: NDArray[np.void] = views["excitations"]
        self.ticks: NDArray[np.void] = views["ticks"]
        self.samples: NDArray[np.void] = views["samples"]
        self._drained = 0
        self._programs = itertools.count(1)
        # Compiled here: a supervisor that compiles while the loop ticks misses its beats.
        with kernels_cached():
            self._look_at = specialise(look_at, self.status, 0)
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
        layout = {
            "axes": len(axes),
            "parameters": parameters,
            "ring_rows": -(-max(4096, int(RING_SECONDS * rate_hz)) // STATUS_ROWS) * STATUS_ROWS,
            "segments": PROGRAM_SEGMENTS,
        }
        os.ftruncate(fd, HEADER_BYTES)
        os.pwrite(fd, json.dumps(layout).encode().ljust(HEADER_BYTES, b"\0"), 0)
        return cls(fd, layout)

    @classmethod
    def attach(cls, fd: int) -> LoopMemory:
        """Map the memory that the other process made."""
        header = os.pread(fd, HEADER_BYTES, 0)
        return cls(fd, json.loads(header.rstrip(b"\0")))

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

    def look_at(self, word: Word) -> int:
        """Return a word, before what it announces is read."""
        value: int = self._look_at(self.status, word)
        return value

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
                f"the loop has not taken the last {room} commands; does it still tick?"
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

    def load_program(self, axis: int, segments: NDArray[np.void]) -> int:
        """Write a trajectory into the program slot that the axis does not follow.

        Parameters
        ----------
        axis
            Index of the axis.
        segments
            Of SEGMENT, shape (N,).

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

    def drain(self) -> tuple[NDArray[np.void], NDArray[np.void], int]:
        """Copy the rows that were announced since the last call.

        Returns
        -------
        ticks
            Of TICK_SAMPLE, shape (N,).
        samples
            Of `axis_sample`, shape (N, axes).
        lost
            How many rows before these were overwritten unread.
        """
        ticks, samples, first, head = self._copy_from(self._drained)
        lost = first - self._drained
        self._drained = max(head, first)
        return ticks, samples, lost

    def newest(self, rows: int) -> tuple[NDArray[np.void], NDArray[np.void]]:
        """Copy the newest rows, whoever has drained them.

        Parameters
        ----------
        rows
            How many at most; fewer where the ring holds fewer.

        Returns
        -------
        ticks
            Of TICK_SAMPLE, shape (N,).
        samples
            Of `axis_sample`, shape (N, axes).
        """
        head = self._look_at(self.status, Word.RING_HEAD)
        return self._copy_from(max(0, head - rows))[:2]

    @property
    def models_row(self) -> int:
        """Of the rows, counted from the beginning, the first that is of the models that run now."""
        return int(self.status["models_row"][0])

    @property
    def drained(self) -> int:
        """How many rows were drained so far."""
        return self._drained

    def newest_of_models(self) -> tuple[NDArray[np.void], NDArray[np.void]]:
        """Copy the rows that the ring still holds of the models that run now; as `newest`."""
        return self._copy_from(self.models_row)[:2]

    def _copy_from(self, row: int) -> tuple[NDArray[np.void], NDArray[np.void], int, int]:
        """Copy every whole row from this one on; return the number of the first and of the next."""
        head = self._look_at(self.status, Word.RING_HEAD)
        first = max(row, head - self.ring_rows)
        index = np.arange(first, head) % self.ring_rows
        ticks, samples = self.ticks[index], self.samples[index]
        # Rows that the loop overwrote while they were copied are lost, not passed on torn.
        torn = self._look_at(self.status, Word.RING_HEAD) + 1 - self.ring_rows - first
        if torn > 0:
            ticks, samples, first = ticks[torn:], samples[torn:], first + torn
        return ticks, samples, first, head

    def close(self) -> None:
        """Close the file descriptor; the mapping goes with its last view."""
        os.close(self.fd)
