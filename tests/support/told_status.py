"""A status document of the daemon's own making: the gantry in virtual time, without a daemon."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from loop_bench import Rig, gantry, with_axes

from motorctl.config.guard_keys import Thermal
from motorctl.daemon.report import Report
from motorctl.loop import Verb

THERMAL = Thermal(continuous_voltage_v=2.0, time_constant_s=10.0)


@contextmanager
def reported(folder: Path) -> Iterator[tuple[Rig, Report]]:
    """Hold axis x, of which the motor is known, with y off; advance the rig as you like."""
    with Rig(with_axes(gantry(), ["x"], guards={"thermal": THERMAL})) as rig:
        rig.order(Verb.START, "x")
        rig.advance(50)
        yield rig, Report(rig.machine, rig.memory, folder / "m.sock")


def document_of(rig: Rig, report: Report) -> dict[str, Any]:
    """Return the document as it comes over the control socket."""
    told: dict[str, Any] = json.loads(json.dumps(report.document(rig.names, {})))
    return told
