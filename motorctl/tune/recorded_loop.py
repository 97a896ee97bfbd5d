"""What a log tells of an axis' loop: its error, the gains behind it, the plant, the noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.config.analysis import DelayedPlant, LoopGains
from motorctl.config.loop_rules import parameter_range
from motorctl.config.machine import Axis, Machine
from motorctl.errors import DataError, UsageError
from motorctl.identify.columns.measured import with_others
from motorctl.identify.columns.position_noise import position_noise_density, position_noise_rms
from motorctl.identify.compare.measures import MeasuredRun, measure_axis
from motorctl.identify.fit.declared_models import machine_of
from motorctl.identify.fit.recording import fit_axis
from motorctl.log import AxisRecording, Recording

Array = NDArray[np.float64]
Range = tuple[float, float]

QUANTISED = 1.0 / np.sqrt(12.0)
"""Standard deviation of what an encoder rounds away, in counts: that of a uniform distribution."""
BEFORE_S = 1.0
"""Rows before those that count [s], in which a filter may settle. Shorter than the slowest motion
of the error lets the filter's start into the figures; longer takes time. Chosen by hand: a hundred
times the time constant 1/k1 of ordinary gains."""


@dataclass(frozen=True)
class PlantEstimate:
    """The rigid plant as it was identified, and the box in which a controller must bear it."""

    theta1: float
    """Inertia [V s^2/m]."""
    theta2: float
    """Viscous friction [V s/m]."""
    theta1_bounds: Range
    theta2_bounds: Range
    delay_s: float
    """Of the command, beyond the hold [s]."""
    lag_s: float
    """Of the amplifier, as the model declares it [s]."""

    def at(self, theta1: float, theta2: float, period_s: float) -> DelayedPlant:
        """Return the sampled plant with these parameters."""
        return DelayedPlant((theta1, theta2, 0.0), period_s, self.delay_s, self.lag_s)

    def nominal(self, period_s: float) -> DelayedPlant:
        """Return the sampled plant as it was identified."""
        return self.at(self.theta1, self.theta2, period_s)

    def corners(self, period_s: float) -> tuple[DelayedPlant, ...]:
        """Return the sampled plants at the corners of the bounds."""
        return tuple(
            self.at(theta1, theta2, period_s)
            for theta1 in self.theta1_bounds
            for theta2 in self.theta2_bounds
        )


@dataclass(frozen=True)
class RecordedLoop:
    """One axis that followed its program, and the loop that it followed it with."""

    axis: str
    source: str
    period_s: float
    """Of the axis."""
    gains: LoopGains
    """With which it was recorded."""
    d_hat_max_v: float
    max_voltage_v: float
    error: Array
    """Position error (n,) [m]: the rows that count, and those in which a filter settles before."""
    d0_hat: Array
    """Fast adaptation (n,) [V] of the same rows."""
    counted: int
    """Rows at the end of `error` over which eF is taken."""
    plant: PlantEstimate
    noise_rms_m: float
    """Of one measured position: no less than what the encoder rounds away [m]."""

    @property
    def eF_m(self) -> float:
        """The largest error over the rows that count, as recorded."""
        return float(np.abs(self.error[-self.counted :]).max())


def recorded_loop(recording: Recording, machine: Machine, name: str) -> RecordedLoop:
    """Return what a log tells of the loop of an axis.

    Inertia, friction and delay are fitted to the log; a lag and a delay that the model declares
    come on top of the delay.

    Parameters
    ----------
    recording
        A log of this program: its configuration tells the gains.
    machine
        The configuration whose gains are to be chosen. Its model must be the log's: what it
        compensates besides is not in the recorded error.
    name
        The axis.

    Returns
    -------
    RecordedLoop
        Error, gains, plant and noise of the axis.

    Raises
    ------
    UsageError
        No such axis, a recording that is no log of this program, or another model's.
    DataError
        The log cannot tell it: no motion, no reference, or the model cannot be fitted.
    """
    axis = _axis_of(machine, name)
    if name not in recording.axes:
        raise UsageError(
            f"{recording.source}: no axis '{name}'; it has: {', '.join(recording.axes)}"
        )
    logged = machine_of(recording)
    if logged is None or name not in logged.axes:
        raise UsageError(
            f"{recording.source}: the gains that it was recorded with are not known: tuning needs "
            "a log that motorctl wrote"
        )
    before = logged.axes[name]
    _require_same_model(recording, before, axis, machine)
    run = measure_axis(recording, name)
    data = recording.axes[name]
    rows = _rows(run, recording.sample_rate_hz)
    counted = len(range(*run.last_rows.indices(len(data.position))))
    step = before.divisor
    error = data.following_error
    if error is None or data.d0_hat is None or not np.isfinite(error[rows]).all():
        raise DataError(f"{recording.source}: axis {name}: its error or d0_hat was not recorded")
    fit = fit_axis(with_others(recording, name), before.declared)
    place = before.declared.index_of("acceleration")
    if place is None:
        raise UsageError(f"axis {name}: its model has no inertia, so there is no loop to shape")
    viscous = before.declared.index_of("velocity")
    density = position_noise_density(with_others(recording, name))
    return RecordedLoop(
        axis=name,
        source=recording.source,
        period_s=logged.period_of(name),
        gains=LoopGains(before.gains.k1_1_s, before.gains.ks_v_s_m, before.gains.gamma_d),
        d_hat_max_v=axis.gains.d_hat_max_v,
        max_voltage_v=axis.limits.max_voltage_v,
        error=error[rows][::step],
        d0_hat=data.d0_hat[rows][::step],
        counted=max(counted // step, 1),
        plant=PlantEstimate(
            theta1=float(fit.theta[place]),
            theta2=0.0 if viscous is None else max(float(fit.theta[viscous]), 0.0),
            theta1_bounds=parameter_range(axis.model, axis.estimates, "acceleration")[1:],
            theta2_bounds=parameter_range(axis.model, axis.estimates, "velocity")[1:],
            delay_s=max(fit.delay_s, 0.0) + before.declared.delay_s,
            lag_s=before.declared.lag_s,
        ),
        noise_rms_m=_noise(data, axis, position_noise_rms(density, recording.sample_rate_hz)),
    )


def _axis_of(machine: Machine, name: str) -> Axis:
    if name not in machine.axes:
        known = ", ".join(machine.axes)
        raise UsageError(f"{machine.source}: no axis '{name}'; it has: {known}")
    return machine.axes[name]


def _require_same_model(recording: Recording, logged: Axis, axis: Axis, machine: Machine) -> None:
    """Insist that the recorded error is what this model leaves."""
    if logged.model.names != axis.model.names or logged.gains.velocity != axis.gains.velocity:
        raise UsageError(
            f"{recording.source}: axis {axis.name} was recorded with the model "
            f"{', '.join(logged.model.names)} and velocity: {logged.gains.velocity}; "
            f"{machine.source} has {', '.join(axis.model.names)} and velocity: "
            f"{axis.gains.velocity}: record its program with that configuration first"
        )


def _rows(run: MeasuredRun, sample_rate_hz: float) -> slice:
    """Return the rows that count, and so many before as a filter needs, where there are any."""
    period_s = run.period_s or BEFORE_S
    settling = round(max(period_s, BEFORE_S) * sample_rate_hz)
    return slice(max(run.last_rows.start - settling, run.rows.start), run.last_rows.stop)


def _noise(data: AxisRecording, axis: Axis, measured_m: float) -> float:
    resolution = data.resolution or axis.encoder.resolution_m
    return max(measured_m, float(QUANTISED) * resolution)
