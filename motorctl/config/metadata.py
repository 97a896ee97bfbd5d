"""What a log says of the run that it holds."""

from __future__ import annotations

import platform
from datetime import UTC, datetime

from motorctl.config.machine import Machine
from motorctl.hal import Status
from motorctl.log import LogAxis
from motorctl.version import VERSION


def log_axes(machine: Machine) -> list[LogAxis]:
    """Return what the columns of a log of this machine are made of."""
    return [
        LogAxis(
            a.name,
            a.model.parameter_names,
            dual_drive=a.dual_drive is not None,
            learning=a.learning is not None,
            units=a.units,
            theta_units=a.model.parameter_units,
        )
        for a in machine.axes.values()
    ]


def log_metadata(machine: Machine) -> dict[str, object]:
    """Return the document that a log of this machine carries, JSON-serialisable."""
    seeds = {name: getattr(setup.options, "seed", None) for name, setup in machine.drivers.items()}
    return {
        "version": VERSION,
        "machine": machine.name,
        "rate_hz": machine.rate_hz,
        "device_statuses": {bit.value: bit.name for bit in Status},
        "config": machine.resolved,
        "seed": seeds,
        "host": {
            "name": platform.node(),
            "kernel": platform.release(),
            "python": platform.python_version(),
        },
        "started_utc": datetime.now(UTC).isoformat(timespec="milliseconds"),
    }
