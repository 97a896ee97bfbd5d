"""What a log tells of an axis' loop: its error, the gains behind it, the plant, the noise."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from motorctl.axis_units import LINEAR, AxisUnits
from motorctl.config.analysis import DelayedPlant, LoopGains
from motorctl.config.loop_rules import loop_gains, parameter_range
from motorctl.config.machine import Axis, Machine
from motorctl.errors import DataError, UsageError
from motorctl.identify.columns.measured import Measured, with_others
from motorctl.identify.columns.position_noise import position_noise_density, position_noise_rms
from motorctl.identify.compare.measures import MeasuredRun, measure_axis
from motorctl.identify.fit.declared_models import machine_of
from motorctl.identify.fit.judgement import EntangledInputError
from motorctl.identify.fit.recording import fit_axis
from motorctl.identify.fit.result import AxisFit
from motorctl.log import AxisRecording, Recording
from motorctl.log.sample import SampleFlag
from motorctl.model import EffectList
from motorctl.response.measurement import Measurement
from motorctl.tune.measured_plant import LINE_ERRORS, MeasuredPlant, measured_plant
from motorctl.tune.same_loop import require_same_loop, require_sound_rows

Array = NDArray[np.float64]
Range = tuple[float, float]

QUANTISED = 1.0 / math.sqrt(12.0)
"""Standard deviation of what an encoder rounds away, in counts: that of a uniform distribution."""
BEFORE_S = 1.0
"""Rows before those that count [s], in which a filter may settle. Shorter than the slowest motion
of the error lets the filter's start into the figures; longer takes time. Chosen by hand: a hundred
times the time constant 1/k1 of ordinary gains."""
DELAY_ERRORS = 2.0
"""Standard errors of the fitted delay that the margins bear besides. Fewer trust a delay that the
motion hardly shows, more gives error away. Convention: 95 %."""
VAGUE_INERTIA = 0.1
"""Standard error of the inertia, relative, from which a log does not tell the loop. Larger promises
margins that nobody knows, smaller refuses quiet programs: a tenth is 0.8 dB of gain margin."""


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
    """Of the command, beyond the hold, with what its standard error leaves open [s]."""
    lag_s: float
    """Of the amplifier, as the model declares it [s]."""
    delay_open_s: float = 0.0
    """By how much delay and lag together exceed what was estimated, for what errors leave open
    [s]."""

    def at(
        self, theta1: float, theta2: float, period_s: float, delay_s: float | None = None
    ) -> DelayedPlant:
        """Return the sampled plant with these parameters; None: with `delay_s`."""
        delay_s = self.delay_s if delay_s is None else delay_s
        return DelayedPlant((theta1, theta2, 0.0), period_s, delay_s, self.lag_s)

    def nominal(self, period_s: float) -> DelayedPlant:
        """Return the sampled plant as it was identified."""
        return self.at(self.theta1, self.theta2, period_s)

    def corners(self, period_s: float) -> tuple[DelayedPlant, ...]:
        """Return the sampled plants at the corners of the bounds."""
        return tuple(self.at(*parameters, period_s) for parameters in self.at_bounds)

    @property
    def at_bounds(self) -> tuple[tuple[float, float], ...]:
        """Inertia and viscous friction at each corner of the bounds."""
        return tuple(product(self.theta1_bounds, self.theta2_bounds))


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
    ahead: Array
    """By how much the desired velocity of the law is ahead of the mean one over the last period
    (n,) [m/s]: zero where it is matched, about half a period's acceleration as published."""
    goes_round: bool
    """Whether the rows are whole periods, so that the first one follows the last."""
    counted: int
    """Rows at the end of `error` over which eF is taken."""
    plant: PlantEstimate
    noise_rms_m: float
    """Of one measured position: no less than what the encoder rounds away [m]."""
    notes: tuple[str, ...] = ()
    """What a reader of the margins should know."""
    measured: MeasuredPlant | None = None
    """The plant as its response was measured, which `plant` is the rigid part of then."""
    units: AxisUnits = LINEAR

    @property
    def eF_m(self) -> float:
        """The largest error over the rows that count, as recorded."""
        return float(np.abs(self.error[-self.counted :]).max())

    def plant_response(self, w: Array) -> NDArray[np.complex128]:
        """Return the plant [m/V] at frequencies w [rad/s], (n,): measured where it was."""
        known = self.measured or self.plant.nominal(self.period_s)
        return known.response(w)


def recorded_loop(
    recording: Recording,
    machine: Machine,
    name: str,
    *,
    most_missing: int = 0,
    response: Measurement | None = None,
) -> RecordedLoop:
    """Return what a log tells of the loop of an axis.

    Inertia, friction and delay are fitted to the log. A lag that the model declares is taken out of
    the delay; one that it does not declare counts as delay, which leaves more margin than is told.

    Parameters
    ----------
    recording
        A log of this program: its configuration tells the gains.
    machine
        The configuration whose gains are to be chosen. But for its gains, its loop must be the
        log's: the recorded error is what that loop leaves.
    name
        The axis.
    most_missing
        Rows that may be missing between two.
    response
        The axis' measured response, which tells the plant better than the log.

    Returns
    -------
    RecordedLoop
        Error, gains, plant and noise of the axis.

    Raises
    ------
    UsageError
        No such axis, a recording that is no log of this program, or of another loop.
    DataError
        The log cannot tell it: no motion, no reference, a fault, lost rows, or the plant is not
        known well enough.
    """
    if name not in recording.axes:
        known = ", ".join(recording.axes)
        raise UsageError(f"{recording.source}: no axis '{name}'; it has: {known}")
    logged = machine_of(recording)
    if logged is None or name not in logged.axes:
        raise UsageError(
            f"{recording.source}: the gains that it was recorded with are not known: tuning needs "
            "a log that motorctl wrote"
        )
    require_same_loop(recording, logged, machine, name)
    before, axis, data = logged.axes[name], machine.axes[name], recording.axes[name]
    run = measure_axis(recording, name)
    rows, goes_round = _rows(run, recording.sample_rate_hz)
    require_sound_rows(recording, name, rows, most_missing)
    error, d0_hat, ahead = _columns(recording, data, before, logged.period_of(name), rows)
    counted = len(range(*run.last_rows.indices(len(data.position))))
    used = with_others(recording, name)
    plant, notes = _plant(used, before, axis, alone=response is None)
    measured = None
    if response is not None:
        measured = measured_plant(response, name, logged.period_of(name))
        plant, more = _as_measured(plant, measured)
        notes += more
    low, high = plant.theta1_bounds
    if not low <= plant.theta1 <= high:
        notes += (
            f"the fitted inertia, {plant.theta1:.4g} V*s^2/m, is outside its bounds, {low:g} to "
            f"{high:g}",
        )
    if (share := _saturated(data, rows)) > 0.0:
        notes += (
            f"the command stood at its limit in {100.0 * share:.2g} % of the rows, where the "
            "prediction does not hold",
        )
    return RecordedLoop(
        units=axis.units,
        axis=name,
        source=recording.source,
        period_s=logged.period_of(name),
        gains=loop_gains(before.gains, logged.period_of(name)),
        d_hat_max_v=axis.gains.d_hat_max_v,
        max_voltage_v=axis.limits.max_voltage_v,
        error=error,
        d0_hat=d0_hat,
        ahead=ahead,
        goes_round=goes_round,
        counted=max(counted // before.divisor, 1),
        plant=plant,
        noise_rms_m=_noise(used, axis),
        notes=(*recording.notes, *map(axis.units.words, notes)),
        measured=measured,
    )


def _rows(run: MeasuredRun, sample_rate_hz: float) -> tuple[slice, bool]:
    """Return the rows that count, with so many before as a filter needs, and if they go round."""
    period_s = run.period_s or BEFORE_S
    settling = round(math.ceil(BEFORE_S / period_s) * period_s * sample_rate_hz)
    first = run.last_rows.start - settling
    whole = run.period_s is not None and first >= run.rows.start
    return slice(max(first, run.rows.start), run.last_rows.stop), whole


def _columns(
    recording: Recording, data: AxisRecording, axis: Axis, period_s: float, rows: slice
) -> tuple[Array, Array, Array]:
    """Return error, d0_hat and how far the desired velocity is ahead, at the axis' own ticks."""
    error, reference, velocity = data.following_error, data.reference, data.reference_velocity
    if error is None or reference is None or velocity is None or data.d0_hat is None:
        raise DataError(
            f"{recording.source}: axis {data.name}: its reference or d0_hat was not recorded"
        )
    own = slice(rows.start, rows.stop, axis.divisor)
    reference, velocity = reference[own], velocity[own]
    ahead = np.zeros(len(reference))
    if axis.gains.velocity == "published":
        ahead[1:] = velocity[1:] - np.diff(reference) / period_s
    columns = error[own], data.d0_hat[own], ahead
    if not all(np.isfinite(column).all() for column in columns):
        raise DataError(
            f"{recording.source}: axis {data.name}: its error or d0_hat is no number in some rows"
        )
    return columns


def _as_measured(
    plant: PlantEstimate, measured: MeasuredPlant
) -> tuple[PlantEstimate, tuple[str, ...]]:
    """Return the plant with what its response tells of it, and how that differs from the log."""
    fitted, notes = measured.measured.fitted, []
    if abs(fitted.theta1 - plant.theta1) > VAGUE_INERTIA * plant.theta1:
        notes.append(
            f"the response tells an inertia of {fitted.theta1:.4g} V*s^2/m, the log of the program "
            f"{plant.theta1:.4g}: is it the same load?"
        )
    low, high = measured.band_hz
    notes.append(
        f"margins around the response of {measured.source}, {low:.3g} to {high:.3g} Hz, less "
        f"{LINE_ERRORS:g} standard errors of it; beyond, around the plant that was fitted to it"
    )
    notes += [f"in the plant: {part}" for part in measured.parts]
    delay_s, lag_s = fitted.mostly_delay(DELAY_ERRORS)
    known = replace(
        plant,
        theta1=fitted.theta1,
        theta2=fitted.theta2,
        delay_s=delay_s,
        lag_s=lag_s,
        delay_open_s=delay_s + lag_s - (fitted.delay_s + fitted.lag_s),
    )
    return known, tuple(notes)


def _plant(
    data: Measured, before: Axis, axis: Axis, *, alone: bool
) -> tuple[PlantEstimate, tuple[str, ...]]:
    """Fit the plant; return it, and what is to be known of the fit.

    alone: whether no response tells the plant better; then it is said what this one lacks.
    """
    model, notes = before.declared, []
    fit, without = _fitted(data, model)
    if without and alone:
        notes.append(
            "the log does not tell inertia from the electromagnetic effects: it was fitted without "
            "them, so it is a mean over the commands, and where the motor saturates the loop at "
            "rest has less margin than is told"
        )
    place, viscous = fit.model.index_of("acceleration"), fit.model.index_of("velocity")
    assert place is not None  # no configuration is valid without
    theta1, error = float(fit.theta[place]), float(fit.std_error[place])
    if _is_vague(fit):
        raise DataError(
            f"{data.place}: its inertia is {theta1:.3g} +- {error:.2g} "
            f"{axis.units.words('V*s^2/m')}: margins need it "
            f"within {100.0 * VAGUE_INERTIA:g} %: give a log of a program that accelerates more"
        )
    # The fitted delay is all by which the command is late, a declared lag and delay included.
    open_s = DELAY_ERRORS * fit.estimate.delay_std_error_s
    fitted_s = fit.delay_s + open_s - model.lag_s
    plant = PlantEstimate(
        theta1=theta1,
        theta2=0.0 if viscous is None else max(float(fit.theta[viscous]), 0.0),
        theta1_bounds=parameter_range(axis.model, axis.estimates, "acceleration")[1:],
        theta2_bounds=parameter_range(axis.model, axis.estimates, "velocity")[1:],
        delay_s=max(fitted_s, model.delay_s + axis.adaptation.input_delay_s),
        lag_s=model.lag_s,
        delay_open_s=open_s,
    )
    told = (fit.model.parameter_names[place], "delay")
    notes += [note for note in fit.notes if any(name in note for name in told)]
    for ringing in (e.name for e in axis.model.effects if alone and "resonance" in e.groups):
        notes.append(
            f"{ringing} is not in the plant around which margins and stability are reckoned: look "
            f"at `motorctl response {axis.name}` with these gains before they are relied upon"
        )
    return plant, tuple(notes)


def _fitted(data: Measured, model: EffectList) -> tuple[AxisFit, bool]:
    """Return the fit that tells inertia, and whether it is one without electromagnetic effects."""
    without = model.without_electromagnetic()
    try:
        fit = fit_axis(data, model)
    except EntangledInputError:
        return fit_axis(data, without), True
    if _is_denied(fit) and len(without) < len(model):
        with suppress(DataError):
            plain = fit_axis(data, without)
            if not (_is_vague(plain) or _is_denied(plain)):
                return plain, True
    return fit, False


def _is_vague(fit: AxisFit) -> bool:
    """Return whether a fit does not tell inertia well enough for margins."""
    place = fit.model.index_of("acceleration")
    return place is None or not fit.std_error[place] <= VAGUE_INERTIA * fit.theta[place]


def _is_denied(fit: AxisFit) -> bool:
    """Return whether instruments deny an inertia that least squares gave."""
    place = fit.model.index_of("acceleration")
    if place is None or fit.instruments is None or fit.estimator == "instruments":
        return False
    ordinary, other = (float(e.theta[place]) for e in (fit.least_squares, fit.instruments))
    apart = abs(ordinary - other) > VAGUE_INERTIA * max(ordinary, other)
    return apart and bool(fit.disagreement()[place])


def _saturated(data: AxisRecording, rows: slice) -> float:
    if data.flags is None:
        return 0.0
    return float(np.mean(data.flags[rows] & int(SampleFlag.SATURATED) != 0))


def _noise(data: Measured, axis: Axis) -> float:
    measured_m = position_noise_rms(position_noise_density(data), data.sample_rate_hz)
    return max(measured_m, QUANTISED * axis.encoder.resolution_m)
