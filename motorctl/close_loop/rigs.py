"""Where motions are run and recorded: in virtual time, or on the machine that a daemon runs."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from motorctl.config import Machine
from motorctl.errors import RunError
from motorctl.loop.simulation import simulate
from motorctl.loop.virtual import require_virtual_time

Share = Callable[[float], None]
"""Told the share of a motion that is done."""


class Rig(Protocol):
    """Runs a machine's motions and records them."""

    verb: str
    """What it does with a motion, for whoever waits, such as `simulating`."""

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
        """


class SimulatedRig:
    """Virtual time, for machines whose drivers support it."""

    verb = "simulating"

    def insist(self, machine: Machine) -> None:
        """Raise UsageError where a driver does not support virtual time."""
        require_virtual_time(machine)

    def run(self, machine: Machine, log: Path, duration_s: float | None, progress: Share) -> None:
        """Simulate the motion; as `Rig.run`."""
        simulate(machine, log, duration_s=duration_s, progress=progress)


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

    def insist(self, machine: Machine) -> None:
        """As the rig behind it."""
        self._rig.insist(machine)

    def run(self, machine: Machine, log: Path, duration_s: float | None, progress: Share) -> None:
        """Run it where that was not done before; one that tripped then raises that again."""
        note = log.with_suffix(".run.json")
        asked = _digest(machine, duration_s)
        done = _read(note) if self._reuse else None
        if done is not None and done["asked"] == asked:
            if done["tripped"]:
                raise RunError(str(done["tripped"]))
            if log.is_file():
                return
        note.unlink(missing_ok=True)
        # of one that is broken off nothing is noted: it is run again
        try:
            self._rig.run(machine, log, duration_s, progress)
        except RunError as error:
            _write(note, {"asked": asked, "tripped": str(error)})
            raise
        _write(note, {"asked": asked, "tripped": ""})


def _digest(machine: Machine, duration_s: float | None) -> str:
    text = json.dumps([machine.resolved, duration_s], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _read(note: Path) -> dict[str, str] | None:
    try:
        done = json.loads(note.read_text())
    except (OSError, ValueError):
        return None
    return done if isinstance(done, dict) and done.keys() == {"asked", "tripped"} else None


def _write(note: Path, done: dict[str, str]) -> None:
    draft = note.with_name(f"{note.name}.{os.getpid()}")
    draft.write_text(json.dumps(done))
    draft.replace(note)
