"""Identify the declared model of an axis from a recording.

The way: form the columns (regression_data), solve least squares with the acceleration on the left
(least_squares), solve again with instruments built from the reference (instruments), take the
one that is least biased, judge (judgement).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.identify.columns.frozen_position import without_stale_start
from motorctl.identify.columns.measured import Measured, check_usable, counterpart, with_others
from motorctl.identify.columns.usual_mistakes import check_columns
from motorctl.identify.fit.instruments import by_instruments
from motorctl.identify.fit.judgement import check_direction, check_exchanged, judge
from motorctl.identify.fit.least_squares import by_least_squares, physical_bounds, within
from motorctl.identify.fit.regression_data import RegressionData, TooFewRowsError, prepare
from motorctl.identify.fit.result import AxisFit, FitError, FitEstimate, RecordingFit
from motorctl.identify.fit.settings import Estimator, FitOptions, Segment
from motorctl.log import Recording
from motorctl.log.recording import Part
from motorctl.model import EffectList

Array = NDArray[np.float64]

SHORTEST_CORRELATION_S = 0.1
"""Residuals closer than this always count as correlated [s]. Longer leaves few independent ones, so
standard errors are themselves rough; shorter makes them too small where the residual swings slowly.
Chosen by hand."""
ROWS_PER_PARAMETER = 10
"""Fewest rows for each parameter. Smaller fits noise, larger refuses short recordings. Convention:
ten observations a parameter."""


def fit_recording(
    recording: Recording,
    models: Mapping[str, EffectList],
    options: FitOptions | None = None,
    evaluate_on: Recording | None = None,
    progress: Callable[[str], None] | None = None,
) -> RecordingFit:
    """Identify each axis that `models` names.

    Parameters
    ----------
    recording
        What is fitted.
    models
        The list of effects of each axis to be identified.
    options
        Choices of the identification; what they leave open is chosen from the recording.
    evaluate_on
        A second recording that gives the held-out error; its axis is that of the same name, or its
        only one.
    progress
        Called with the name of each axis before its turn.

    Returns
    -------
    RecordingFit
        Axis by axis what was identified; an axis that cannot be, such as one that did not move,
        stands in `refused`, with the reason.

    Raises
    ------
    DataError
        No axis can be identified.
    UsageError
        `evaluate_on` has several axes and none of the same name, or an option is out of range.
    """
    options = options or FitOptions()
    held_out = options.held_out_segments or _described(recording, "held_out")
    options = options.with_changes(
        fit_segments=options.fit_segments or _described(recording, "fit"),
        held_out_segments=None if evaluate_on is not None else held_out,
    )
    fits: dict[str, AxisFit] = {}
    refused: dict[str, DataError] = {}
    for name, model in models.items():
        if progress is not None:
            progress(name)
        other = None
        if evaluate_on is not None:
            other = with_others(evaluate_on, counterpart(evaluate_on, name))
        try:
            fits[name] = fit_axis(with_others(recording, name), model, options, other)
        except DataError as error:
            refused[name] = error
    if not fits:
        raise DataError("\n".join(str(error) for error in refused.values()))
    return RecordingFit(
        recording.source,
        recording.sample_rate_hz,
        recording.duration_s,
        fits,
        {name: str(error) for name, error in refused.items()},
        recording.notes,
    )


def fit_axis(
    data: Measured,
    model: EffectList,
    options: FitOptions | None = None,
    evaluate_on: Measured | None = None,
) -> AxisFit:
    """Identify `model` from one axis.

    Parameters
    ----------
    data
        What was measured of the axis, in its own units.
    model
        The effects whose parameters are estimated.
    options
        Choices of the identification; what they leave open is chosen from `data`.
    evaluate_on
        The axis in another recording, which gives the held-out error.

    Returns
    -------
    AxisFit
        Parameters with standard errors in the model's order, the error and the residual.

    Raises
    ------
    DataError
        The data cannot tell anything: too short, no motion, a constant or saturated command,
        columns that seem exchanged or of opposite sign.
    """
    check_usable(data)
    data, stale = without_stale_start(data)
    check_columns(data, model)
    everything = prepare(data, model, options or FitOptions())
    options = everything.options
    columns = _chosen(everything, options.fit_segments)
    bandwidth = math.ceil(SHORTEST_CORRELATION_S / columns.row_period_s)
    found = by_least_squares(columns, bandwidth)
    check_direction(data, everything.model, found.problem, found.solution, bandwidth)
    instruments = by_instruments(columns, found.estimate, bandwidth)
    estimator = _preferred(columns, found.estimate, instruments)
    estimate = found.estimate
    if estimator == "instruments" and instruments is not None:
        estimate = instruments
    residual, error = _error(columns, estimate)
    check_exchanged(data, error, options)
    held_out = None
    if evaluate_on is not None:
        held_out = _evaluate(evaluate_on, everything, estimate)
    elif options.held_out_segments:
        rest = _chosen(everything, options.held_out_segments)
        held_out = _error(rest, estimate)[1]
    fit = AxisFit(
        data=data,
        model=everything.model,
        options=options,
        columns=columns,
        estimator=estimator,
        least_squares=found.estimate,
        instruments=instruments,
        error=error,
        held_out=held_out,
        residual=residual,
        condition=found.solution.condition,
        notes=() if stale is None else (stale,),
    )
    return judge(fit, found)


def _described(recording: Recording, part: Part) -> tuple[Segment, ...] | None:
    return (recording.segments[part],) if part in recording.segments else None


def _chosen(columns: RegressionData, segments: tuple[Segment, ...] | None) -> RegressionData:
    chosen = columns.within(segments) if segments else columns
    needed = ROWS_PER_PARAMETER * len(columns.model)
    if len(chosen.time_s) < needed:
        spans = ", ".join(f"{begin:g} to {end:g} s" for begin, end in segments or ())
        raise TooFewRowsError(
            f"{columns.data.place}: {len(chosen.time_s)} rows are left after filtering and "
            "decimation"
            + (f" in {spans}" if spans else "")
            + f"; {len(columns.model)} parameters need at least {needed}: record longer"
        )
    return chosen


def _preferred(
    columns: RegressionData, ordinary: FitEstimate, instruments: FitEstimate | None
) -> Estimator:
    wanted = columns.options.estimator
    if wanted == "least_squares" or (wanted == "auto" and columns.options.left == "command"):
        return "least_squares"
    if wanted == "instruments":
        if instruments is None:
            raise DataError(
                f"{columns.data.place}: instruments need a reference that excites every parameter; "
                "choose estimator: least_squares"
            )
        return wanted
    if instruments is None or instruments.weaker_than(ordinary).any():
        return "least_squares"
    bounds = physical_bounds(columns.model, columns.data)
    return "instruments" if within(instruments.theta, *bounds) else "least_squares"


def _error(columns: RegressionData, estimate: FitEstimate) -> tuple[Array, FitError]:
    psi, command = columns.at(estimate.delay_s)
    residual = command - psi @ estimate.theta
    size = float(np.linalg.norm(command))
    rows = len(residual)
    return residual, FitError(
        rms=float(np.linalg.norm(residual)) / math.sqrt(rows),
        relative=float(np.linalg.norm(residual)) / size if size else math.inf,
        source=columns.data.source,
        duration_s=rows * columns.row_period_s,
    )


def _evaluate(other: Measured, like: RegressionData, estimate: FitEstimate) -> FitError:
    check_usable(other)
    options = like.options.with_changes(fit_segments=None, held_out_segments=None)
    columns = _chosen(prepare(other, like.model, options), None)
    return _error(columns, estimate)[1]
