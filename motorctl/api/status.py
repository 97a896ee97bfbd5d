"""What a running machine says of itself and its axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from motorctl.axis_units import units_of
from motorctl.notebook import frame_of_rows, html_lines, html_table

if TYPE_CHECKING:
    import pandas as pd

State = Literal["off", "homing", "idle", "running", "stopping", "fault"]
NUMBERS = (
    "position_m",
    "velocity_m_s",
    "reference_m",
    "following_error_m",
    "command_v",
)
"""Keys of the status document that are numbers of the moment; None where they are not known."""


@dataclass(frozen=True)
class AxisStatus:
    """One axis at one moment; a number is None where it is not known."""

    axis: str
    state: State
    """`idle`: enabled, holds its position. `running`: moves, or follows a program."""
    homed: bool
    position_m: float | None
    velocity_m_s: float | None
    reference_m: float | None
    following_error_m: float | None
    """Position - reference."""
    command_v: float | None
    travel_m: tuple[float, float]
    """The soft limits."""
    max_voltage_v: float
    fault: str | None
    """What tripped it and what to do, in words."""
    fault_cause: str | None
    """As in logs, in small letters: `following_error`, …"""
    theta_hat: Mapping[str, float | None]
    """The learned parameters by their full names, each in its own unit."""
    document: Mapping[str, Any]
    """All that the daemon tells of the axis."""

    @property
    def position_unit(self) -> str:
        """m, or rad of a rotary axis: of all that is named in metres."""
        return units_of(self.document.get("position_unit")).position

    def shown(self) -> tuple[tuple[float | None, float, str, str], ...]:
        """Return position, velocity and error with scale, format and unit, as people read them."""
        units = units_of(self.document.get("position_unit"))
        place, speed, error = units.place, units.velocity, units.error
        return (
            (self.position_m, place.factor, f".{units.place_digits}f", place.unit),
            (self.velocity_m_s, speed.factor, f".{units.velocity_digits}f", speed.unit),
            (self.following_error_m, error.factor, ".2f", error.unit),
        )

    @classmethod
    def of(cls, axis: str, document: Mapping[str, Any]) -> AxisStatus:
        """Return the status that a document of the control socket tells."""
        fault = document["fault"] or {}
        low, high = document["travel_m"]
        return cls(
            axis=axis,
            state=document["state"],
            homed=document["homed"],
            **{name: document[name] for name in NUMBERS},
            travel_m=(low, high),
            max_voltage_v=document["max_voltage_v"],
            fault=fault.get("message"),
            fault_cause=fault.get("cause"),
            theta_hat=document["theta_hat"],
            document=document,
        )


@dataclass(frozen=True)
class MachineStatus:
    """A machine and its axes at one moment."""

    machine: str
    rate_hz: float
    """Of the loop."""
    axes: Mapping[str, AxisStatus]
    recording: str | None
    """The log that is being recorded."""
    document: Mapping[str, Any]
    """All that the daemon tells: ``motorctl status --json``."""

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> MachineStatus:
        """Return the status that a document of the control socket tells."""
        axes = {name: AxisStatus.of(name, told) for name, told in document["axes"].items()}
        loop, recording = document["loop"], document["recording"]
        return cls(document["machine"], loop["rate_hz"], axes, recording["file"], document)

    def __getitem__(self, axis: str) -> AxisStatus:
        return self.axes[axis]

    def to_pandas(self) -> pd.DataFrame:
        """Return a row an axis: state, homed, positions, error, command, fault.

        Raises UsageError where pandas is not installed.
        """
        columns = ("axis", "state", "homed", *NUMBERS, "fault")
        rows = [{name: getattr(axis, name) for name in columns} for axis in self.axes.values()]
        return frame_of_rows(rows, columns)

    def _repr_html_(self) -> str:
        rows = [
            (
                axis.axis,
                axis.state if axis.homed else f"{axis.state}, not homed",
                *(_number(*cell) for cell in axis.shown()),
                _number(axis.command_v, 1.0, ".3f", "V"),
            )
            for axis in self.axes.values()
        ]
        headings = ("axis", "state", "position", "velocity", "error", "command")
        faults = [f"{axis.axis}: {axis.fault}" for axis in self.axes.values() if axis.fault]
        title = f"{self.machine} at {self.rate_hz:g} Hz"
        return html_table(headings, rows, title) + html_lines(faults)


def _number(value: float | None, scale: float, digits: str, unit: str) -> str:
    return "–" if value is None else f"{value * scale:{digits}} {unit}"
