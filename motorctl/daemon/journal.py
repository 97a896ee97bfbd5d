"""Tell on standard error, and so in systemd's journal, what happens to the machine."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from motorctl.config.machine import Machine
from motorctl.daemon.axis_faults import faults_of
from motorctl.daemon.patient_stream import PatientHandler
from motorctl.log.sample import AxisState
from motorctl.loop import LoopMemory
from motorctl.printable import printable

_log = logging.getLogger("motorctl")
NOWHERE = -1
"""Of a process that was begun without standard error: what is written there is lost."""


class _Harmless(logging.Formatter):
    """Writes out what a terminal would obey: devices, files and users have their words in here.

    What goes on over several lines is indented, so that nobody's text begins a message.
    """

    def format(self, record: logging.LogRecord) -> str:
        return printable(super().format(record)).replace("\n", "\n  ")


@contextmanager
def journal() -> Iterator[None]:
    """Send what motorctl has to tell to standard error, a line each, as long as this lasts.

    A terminal that was stopped (Ctrl-S) or a full pipe holds up nobody.
    """
    handler = PatientHandler(sys.stderr.fileno() if sys.stderr else NOWHERE)
    handler.setFormatter(_Harmless("motorctl: %(message)s"))
    level = _log.level
    _log.addHandler(handler)
    _log.setLevel(logging.INFO)
    try:
        yield
    finally:
        _log.removeHandler(handler)
        _log.setLevel(level)
        handler.close()


class Journal:
    """Tells changes of the axes' states once."""

    def __init__(self, machine: Machine, memory: LoopMemory) -> None:
        self._machine = machine
        self._memory = memory
        self._states = dict.fromkeys(machine.axes, AxisState.OFF)

    def tell_changes(self) -> None:
        """Compare with the last call and tell what is new."""
        statuses = self._memory.axis_status
        faults = faults_of(self._machine, statuses)
        for status, (name, before) in zip(statuses, list(self._states.items()), strict=True):
            state = AxisState(int(status["state"]))
            if state is not before:
                self._states[name] = state
                fault = faults[name]
                reason = f": {fault['message']}" if fault else ""
                level = logging.ERROR if fault else logging.INFO
                _log.log(level, "axis %s: %s%s", name, state.name.lower(), reason)
