"""The machine: what a checked configuration becomes, frozen."""

from __future__ import annotations

import builtins
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict

from motorctl.config.axis_keys import AxisSettings
from motorctl.config.keys import LateSamples, LoopSettings
from motorctl.config.recording_keys import FlightRecorderSettings, RecordingKeys
from motorctl.hal import Driver, DriverOptions
from motorctl.model import Effect, EffectList
from motorctl.motion import Program

MOST_PARAMETERS = 64
"""Entries of theta that a model may have. Every machine's records have room for so many: a model
that is learned while it runs always fits, and machines share kernels. More take time in each tick
and memory (64 instead of 32: 0.2 us of 3.2 with two axes, 10 MB an axis of a ring at 5 kHz), fewer
refuse models with profiles along the way. By hand: two of those that diagnosis tries, and six."""


@dataclass(frozen=True)
class Estimate:
    """Start value, bounds and initial covariance of one parameter, the effect's defaults in."""

    initial: float
    lower: float
    upper: float
    covariance: float


class Axis(AxisSettings):
    """One axis: what its keys say, and the list of effects that they make."""

    model_config = ConfigDict(arbitrary_types_allowed=True)

    name: str
    declared: EffectList
    """The list as the configuration declares it; the axis runs `model`."""
    model: EffectList
    """`declared` under C2; under C1 without its electromagnetic effects."""
    estimates: tuple[Estimate, ...]
    """One for each parameter of `model`, in its order."""
    divisor: int = 1
    """Ticks of the loop in one of the axis: the same for all axes of a driver."""

    @property
    def theta_initial(self) -> NDArray[np.float64]:
        """theta_hat(0), (n,), each parameter in its own unit."""
        return np.array([estimate.initial for estimate in self.estimates])


@dataclass(frozen=True)
class DriverSetup:
    """A driver and its options; the axes name it."""

    name: str
    type: str
    cls: builtins.type[Driver]
    options: DriverOptions
    late: LateSamples = field(default_factory=LateSamples)


@dataclass(frozen=True)
class Machine:
    """A whole, checked machine."""

    name: str
    source: Path
    rate_hz: float
    drivers: Mapping[str, DriverSetup]
    axes: Mapping[str, Axis]
    programs: Mapping[str, Program]
    further_effects: Mapping[str, type[Effect]]
    """Effects that diagnosis tries beside those that are known or declared."""
    loop: LoopSettings
    recording: RecordingKeys
    resolved: Mapping[str, object]
    """The configuration with every default filled in, JSON-serialisable, for log metadata."""
    stop_together: tuple[tuple[str, ...], ...] | None = None
    """Groups of axes that stop when one of them trips; None: those of one running program."""

    @property
    def log_directory(self) -> Path:
        """Where logs go unless `run` is told otherwise."""
        return self.recording.directory

    @property
    def flight_recorder(self) -> FlightRecorderSettings:
        """What is kept of a fault."""
        return self.recording.flight_recorder

    @property
    def period_s(self) -> float:
        """Ts."""
        return 1.0 / self.rate_hz

    def period_of(self, axis: str) -> float:
        """Return the period of an axis [s]: the loop's, or a whole multiple."""
        return self.period_s * self.axes[axis].divisor

    def period_of_driver(self, driver: str) -> float:
        """Return the period of a driver's exchanges [s], which all of its axes have."""
        return next(self.period_of(a.name) for a in self.axes.values() if a.driver == driver)

    def group_of(self, axis: str) -> int:
        """Return the number of the group that an axis stops together with, from 1; 0: of none."""
        groups = enumerate(self.stop_together or (), 1)
        return next((number for number, group in groups if axis in group), 0)

    @property
    def followed_programs(self) -> list[str]:
        """Names of the programs that axes follow after `start`, each once."""
        names = [axis.program for axis in self.axes.values() if axis.program]
        return list(dict.fromkeys(names))
