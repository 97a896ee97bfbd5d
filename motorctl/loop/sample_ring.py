"""The ring of samples as its readers see it: rows since the last look, whole ones only.

Whoever reads has its own place in the ring and writes nothing: the loop does not know of it.
"""

from __future__ import annotations

import json
import mmap
import os
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from motorctl.kernels import kernels_cached, specialise
from motorctl.loop.layout import HEADER_BYTES, places
from motorctl.loop.vocabulary import Word

with kernels_cached():
    from motorctl.loop.handover import look_at


class SampleRing:
    """The memory between supervisor and loop, mapped to be read.

    Parameters
    ----------
    fd
        Its descriptor, which may be one to read only.
    layout
        How it is laid out, as of `motorctl.loop.layout.places`.
    writes
        Map it to be written, too.
    """

    def __init__(self, fd: int, layout: Mapping[str, int], *, writes: bool = False) -> None:
        self.fd = fd
        self.layout = dict(layout)
        self.ring_rows = layout["ring_rows"]
        self._places, size = places(layout)
        access = mmap.PROT_READ | (mmap.PROT_WRITE if writes else 0)
        self._map = mmap.mmap(fd, size, prot=access)
        self.status: NDArray[np.void] = self._view("status")
        """Shape (1,), of LOOP_STATUS."""
        self.ticks: NDArray[np.void] = self._view("ticks")
        self.samples: NDArray[np.void] = self._view("samples")
        self._drained = 0
        # Compiled here: a supervisor that compiles while the loop ticks misses its beats.
        with kernels_cached():
            self._look_at = specialise(look_at, self.status, 0)

    @classmethod
    def attach(cls, fd: int) -> Self:
        """Map the memory that another process made."""
        header = os.pread(fd, HEADER_BYTES, 0)
        return cls(fd, json.loads(header.rstrip(b"\0")))

    def _view(self, name: str) -> NDArray[Any]:
        dtype, shape, place = self._places[name]
        return np.frombuffer(self._map, dtype, int(np.prod(shape)), place).reshape(shape)

    def look_at(self, word: Word) -> int:
        """Return a word, before what it announces is read."""
        value: int = self._look_at(self.status, word)
        return value

    def skip(self, keep_rows: int = 0) -> None:
        """Let the next `drain` begin at the rows that are to come, or so many before them.

        But at none that the ring does not hold any more, or that are of earlier models.
        """
        head: int = self._look_at(self.status, Word.RING_HEAD)
        oldest = head - self.ring_rows + 1  # the one before may be written anew just now
        self._drained = max(0, oldest, min(head, self.models_row), head - keep_rows)

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
    def last_models_rows(self) -> tuple[int, int]:
        """The first row of the models before those that run now, and `models_row`."""
        while True:  # a change may come between
            now, before = self.models_row, int(self.status["models_row_before"][0])
            if now == self.models_row:
                return before, now

    @property
    def drained(self) -> int:
        """How many rows were drained so far."""
        return self._drained

    @property
    def overwritten(self) -> int:
        """How many rows are overwritten that were not drained: the next `drain` counts them."""
        return max(0, -self.room)

    @property
    def room(self) -> int:
        """How many rows can still come before one is overwritten that was not drained.

        Negative where some are.
        """
        head: int = self._look_at(self.status, Word.RING_HEAD)  # first: who drains may be a thread
        # The row before the oldest may be written anew just now: `drain` gives it up, too.
        return self._drained + self.ring_rows - 1 - head

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
