"""A recording as the analysis sees it, whatever file it came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from motorctl.axis_units import PositionUnit
from motorctl.log.axis_names import insist_on_names
from motorctl.log.units import CommandUnit, unit_for

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
Part = Literal["fit", "held_out"]


@dataclass(frozen=True)
class ForcePerCommand:
    """The motor's force or torque for one unit of the command."""

    value: float
    unit: str
    """``N/V``, ``N*m/A``, …"""

    @property
    def force_unit(self) -> str:
        """N or N*m."""
        return self.unit.partition("/")[0]


@dataclass(frozen=True)
class AxisRecording:
    """One axis of a recording: read-only arrays of shape (N,); None where nothing is known.

    A rotary axis has its positions in rad; then every field that is called metres is in rad.
    """

    name: str
    position: Array
    command: Array
    reference: Array | None = None
    reference_velocity: Array | None = None
    reference_acceleration: Array | None = None
    velocity: Array | None = None
    virtual_command: Array | None = None
    excitation: Array | None = None
    """What was injected beside the law's command, for a frequency response."""
    learned: Array | None = None
    """What was learned for a program that repeats; it is in `command`, and explains nothing."""
    d0_hat: Array | None = None
    theta_hat: Mapping[str, Array] = field(default_factory=dict)
    """Estimates by the full names of their parameters."""
    state: IntArray | None = None
    """AxisState."""
    fault: IntArray | None = None
    """FaultCause."""
    flags: IntArray | None = None
    """SampleFlag."""
    position_unit: PositionUnit = "m"
    command_unit: CommandUnit = "V"
    force_per_command: ForcePerCommand | None = None
    recorded: NDArray[np.bool_] | None = None
    """Which samples were recorded and not filled in; None: all."""
    uneven: bool = False
    """Whether the samples were taken unevenly and brought to a uniform rate."""
    resolution: float | None = None
    """One count of the encoder in `position_unit`, where it is known."""

    def __post_init__(self) -> None:
        """Protect the arrays against changes."""
        _protect(*vars(self).values(), *self.theta_hat.values())

    @property
    def following_error(self) -> Array | None:
        """e = position - reference; None where no reference is known."""
        return None if self.reference is None else self.position - self.reference

    def unit(self, model_unit: str) -> str:
        """Translate a unit of the model (V and m) to this axis' units."""
        return unit_for(model_unit, self.position_unit, self.command_unit)


@dataclass(frozen=True)
class Recording:
    """A run of one or more axes, sampled at one rate. Arrays are read-only, of shape (N,)."""

    source: str
    sample_rate_hz: float
    time_s: Array
    axes: Mapping[str, AxisRecording]
    metadata: Mapping[str, Any] = field(default_factory=dict)
    """The JSON document of a log; empty for a foreign recording."""
    lateness_s: Array | None = None
    """NaN in rows that were not recorded but filled in."""
    turnaround_s: Array | None = None
    segments: Mapping[Part, tuple[float, float]] = field(default_factory=dict)
    """Begin and end [s] of the parts that a description sets aside for fitting and testing."""
    rows_filled: int = 0
    """Rows that were interpolated over skipped periods."""
    notes: tuple[str, ...] = ()
    """What a reader of results should know about how the file was read."""

    def __post_init__(self) -> None:
        """Look at the axes' names, and protect the arrays against changes."""
        insist_on_names(self.source, self.axes)
        _protect(*vars(self).values())

    @property
    def period_s(self) -> float:
        """The time between two samples."""
        return 1.0 / self.sample_rate_hz

    @property
    def duration_s(self) -> float:
        """The number of samples times their period."""
        return len(self.time_s) / self.sample_rate_hz

    def rows(self, part: Part) -> slice | None:
        """Return the rows of a described segment; None where the description has none."""
        if part not in self.segments:
            return None
        begin, end = self.segments[part]
        first, last = np.searchsorted(self.time_s + self.period_s / 2, (begin, end))
        return slice(int(first), int(last))


def _protect(*values: object) -> None:
    """Make arrays read-only."""
    for each in values:
        if isinstance(each, np.ndarray):
            each.flags.writeable = False
