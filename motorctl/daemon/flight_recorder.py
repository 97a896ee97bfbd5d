"""Keep the last seconds before a fault: from the ring to a log of its own, beside the loop.

The ring that the loop fills holds more seconds than a record needs, so nothing has to be switched
on beforehand and the loop does nothing for it.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.config.machine import Machine
from motorctl.config.metadata import log_axes, log_metadata
from motorctl.daemon.axis_faults import faults_of
from motorctl.daemon.error_text import in_words
from motorctl.flight import FOLDER, free_record_path, later_than_all, remove_oldest
from motorctl.flight.records import MEGABYTE, METADATA
from motorctl.log import LogWriter
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import LoopMemory
from motorctl.loop.axis_records import DEVICE_WORD_MASK

LOOP_ENDED = "loop_ended"
"""The cause in a record's name where no axis tripped: the loop process died."""
LIBRARIES = ("numpy", "numba", "pyarrow", "pydantic")
"""Told in a record beside Python's version and motorctl's own: what computes, checks and writes."""

_log = logging.getLogger("motorctl")


@dataclass
class _Incident:
    """Axes that tripped together, until their record is written."""

    due_at: float
    """By the monotonic clock: then the seconds after the fault are in the ring."""
    faults: dict[str, dict[str, Any]]
    machine: Machine
    """That ran then."""


class FlightRecorder:
    """Watches for faults and writes a record of each; several axes that trip together share one.

    Parameters
    ----------
    machine
        Whose faults.
    memory
        Where the loop writes.
    log_directory
        Records stand in a folder of their own in it.
    facts
        Asked for what the record says of loop and motions.
    now
        Asked for the time that stands in a record's name.
    """

    def __init__(
        self,
        machine: Machine,
        memory: LoopMemory,
        log_directory: Path,
        facts: Callable[[], dict[str, Any]],
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        self.folder = log_directory / FOLDER
        self.newest: Path | None = None
        self.failure: str | None = None
        """Why the last record could not be written, or None."""
        self.machine = machine
        """What runs; another one once its models have changed."""
        self._memory = memory
        self._facts = facts
        self._now = now
        self._settings = machine.flight_recorder
        self._seen: dict[str, tuple[int, float]] = {}
        self._incident: _Incident | None = None
        self._writer = ThreadPoolExecutor(1, thread_name_prefix="flight-recorder")

    def watch(self) -> None:
        """Look for new faults and write the record of those whose time has come; takes no time."""
        new = self._new_faults()
        if new and self._incident is None:
            due_at = time.monotonic() + self._settings.after_s
            self._incident = _Incident(due_at, {}, self.machine)
        if self._incident is not None:
            self._incident.faults |= new
            if time.monotonic() >= self._incident.due_at:
                self._hand_over(self._incident)

    @property
    def busy(self) -> bool:
        """Whether a fault's record waits for the seconds after it."""
        return self._incident is not None

    def finish(self, loop_ended: str | None = None) -> None:
        """Write what is left to write; call when the loop has ended.

        Parameters
        ----------
        loop_ended
            In words, where it did not end in order: then there is a record of that, too, unless
            one of a fault holds the same seconds.
        """
        self.watch()
        if loop_ended and self._incident is None and len(self._memory.newest(1)[0]):
            self._incident = _Incident(0.0, {}, self.machine)
        if self._incident is not None:
            self._hand_over(self._incident, loop_ended)
        self._writer.shutdown(wait=True)

    def _new_faults(self) -> dict[str, dict[str, Any]]:
        statuses = self._memory.axis_status
        told: dict[str, dict[str, Any] | None] = {}
        new = {}
        for name, status in zip(self.machine.axes, statuses, strict=True):
            if AxisState(int(status["state"])) is not AxisState.FAULT:
                self._seen.pop(name, None)
                continue
            mark = (int(status["fault"]), float(status["fault_time_s"]))
            if self._seen.get(name) == mark:
                continue
            self._seen[name] = mark
            told = told or faults_of(self.machine, statuses, with_remedy=False)
            new[name] = _fault(status, told[name])
        return new

    def _hand_over(self, incident: _Incident, loop_ended: str | None = None) -> None:
        self._incident = None
        self._writer.submit(self._write, incident, loop_ended)

    def _write(self, incident: _Incident, loop_ended: str | None) -> None:
        try:
            path = self._written(incident.machine, _in_order(incident.faults), loop_ended)
            removed = remove_oldest(
                self.folder, self._settings.keep_records, self._settings.max_size_mb * MEGABYTE
            )
        except Exception as error:  # whatever it was: the machine and its log go on
            self.failure = in_words(error)
            _log.error("flight record: not written: %s", self.failure)
            return
        self.newest, self.failure = path, None
        _log.info("flight record %s; `motorctl fault show` tells of it", path)
        if removed:
            _log.info("flight record: the oldest were removed: %d", len(removed))

    def _written(
        self, machine: Machine, faults: Mapping[str, dict[str, Any]], loop_ended: str | None
    ) -> Path:
        ticks, samples = self._seconds(faults)
        now = self._now()
        axis, first = next(iter(faults.items()), (None, None))
        cause = first["cause"] if first else LOOP_ENDED
        time_s = first["time_s"] if first else float(ticks["time_s"][-1])
        own = {
            "cause": cause,
            "message": first["message"] if first else loop_ended,
            "time_s": time_s,
            "written_utc": now.isoformat(timespec="milliseconds"),
            "faults": faults,
            "loop_ended": loop_ended,
            "settings": self._settings.model_dump(),
            "libraries": {name: version(name) for name in LIBRARIES},
        }
        axes = log_axes(machine)
        metadata = {**log_metadata(machine), "clock": "wall", METADATA: own}
        path = free_record_path(self.folder, later_than_all(self.folder, now), axis, cause)
        writer = LogWriter(path, metadata, axes)
        writer.append(ticks, samples)
        return writer.close(self._facts())

    def _seconds(
        self, faults: Mapping[str, dict[str, Any]]
    ) -> tuple[NDArray[np.void], NDArray[np.void]]:
        """Copy the seconds around the first fault out of the ring."""
        settings = self._settings
        ticks, samples = self._memory.newest_of_models()
        times = ticks["time_s"]
        at = min((fault["time_s"] for fault in faults.values()), default=float(times[-1]))
        # An axis may have tripped before the first tick was written, at no time of its own.
        at = at if math.isfinite(at) else float(times[-1])
        rows = (times >= at - settings.before_s) & (times <= at + settings.after_s)
        return ticks[rows], samples[rows]


def _fault(status: np.void, told: Mapping[str, Any] | None) -> dict[str, Any]:
    number = {
        key: float(status[f"fault_{key}"]) if math.isfinite(status[f"fault_{key}"]) else None
        for key in ("value", "limit")
    }
    return {
        **(told or {}),
        "time_s": float(status["fault_time_s"]),
        **number,
        "device_status": int(status["fault_status"]) & DEVICE_WORD_MASK,
    }


def _in_order(faults: Mapping[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the axis that tripped first before the others, and a cause before its partners."""
    partner = FaultCause.PARTNER.name.lower()
    return dict(sorted(faults.items(), key=lambda f: (f[1]["time_s"], f[1]["cause"] == partner)))
