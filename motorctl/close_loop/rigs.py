"""What runs motions and records them; and what passes over those that were run before."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import pyarrow as pa
import pyarrow.parquet as pq

from motorctl.config import Machine
from motorctl.errors import DataError, MotorctlError
from motorctl.log.convert import load_metadata
from motorctl.log.folder import StoredLog, in_use
from motorctl.loop.simulation import simulate
from motorctl.loop.virtual import require_virtual_time

Share = Callable[[float], None]
"""Told the share of a motion that is done."""


class BrokenOffError(MotorctlError):
    """A motion did not come to its end, and that says nothing of the models that ran."""


class Rig(Protocol):
    """Runs a machine's motions and records them."""

    verb: str
    """What it does with a motion, for whoever waits, such as `simulating`."""
    runs_on: str
    """Names the machine that it moves: what was run on another one is run again."""
    goes_on: bool
    """Whether time and place go on from one motion to the next; virtual time begins anew."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Why what axes had learned was not used in the last motion, a sentence each."""

    def insist(self, machine: Machine) -> None:
        """Raise UsageError where it cannot run this machine."""

    def run(self, machine: Machine, log: Path, duration_s: float | None, progress: Share) -> None:
        """Let every axis follow its program, and write a log of it.

        Parameters
        ----------
        machine
            With the models that shall run, and the programs that shall be followed.
        log
            The log's file.
        duration_s
            When the motion is ended early [s]; None: not at all.
        progress
            Told how far it is.

        Raises
        ------
        RunError
            Where an axis trips.
        BrokenOffError
            Where anything else ends it early.
        """

    def keep(self, machine: Machine) -> None:
        """Take note that these models shall run when all is done, until others are kept."""


class SimulatedRig:
    """Virtual time, for machines whose drivers support it."""

    verb = "simulating"
    runs_on = "virtual time"
    goes_on = False

    def __init__(self) -> None:
        self.notes: tuple[str, ...] = ()

    def insist(self, machine: Machine) -> None:
        """Raise UsageError where a driver does not support virtual time."""
        require_virtual_time(machine)

    def run(self, machine: Machine, log: Path, duration_s: float | None, progress: Share) -> None:
        """Simulate the motion; as `Rig.run`."""
        self.notes = simulate(machine, log, duration_s=duration_s, progress=progress).notes

    def keep(self, machine: Machine) -> None:
        """Do nothing: no machine runs on."""


class ResumedRig:
    """Passes over what was run before: its log is there, of the same machine and motion.

    Parameters
    ----------
    rig
        Runs what is missing.
    reuse
        Whether anything is passed over; else only what is run now is noted.
    """

    def __init__(self, rig: Rig, *, reuse: bool) -> None:
        self._rig = rig
        self._reuse = reuse
        self.verb = rig.verb
        self.runs_on = rig.runs_on
        self.goes_on = rig.goes_on

    @property
    def notes(self) -> tuple[str, ...]:
        """As the rig behind it."""
        return self._rig.notes

    def insist(self, machine: Machine) -> None:
        """As the rig behind it."""
        self._rig.insist(machine)

    def run(self, machine: Machine, log: Path, duration_s: float | None, progress: Share) -> None:
        """Run it where that was not done before; what tripped or was broken off was not."""
        note = log.with_suffix(".run")
        asked = _digest(self.runs_on, machine, duration_s)
        if self._reuse and log.is_file() and note.is_file() and note.read_bytes() == asked.encode():
            return
        note.unlink(missing_ok=True)
        _remove_unfinished(log)
        self._rig.run(machine, log, duration_s, progress)
        note.write_text(asked)

    def keep(self, machine: Machine) -> None:
        """As the rig behind it."""
        self._rig.keep(machine)


def in_virtual_time(log: Path) -> bool:
    """Return whether a log was simulated. Raises DataError where it cannot be read."""
    try:
        return "virtual_time" in load_metadata(pq.read_schema(log))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise DataError(f"{log}: cannot be read: {error}") from error


def _remove_unfinished(log: Path) -> None:
    """Remove what a run that was killed left of a log, unless another one is at it."""
    left = StoredLog(log, 0, 0.0, partial=True)
    if not in_use(left):
        left.partial_path.unlink(missing_ok=True)


def _digest(runs_on: str, machine: Machine, duration_s: float | None) -> str:
    text = json.dumps([runs_on, machine.resolved, duration_s], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()
