"""A measured response as the rows of a table, and what it rests on in words."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from motorctl.response.measured_margins import MeasuredMargins
from motorctl.response.measurement import Measurement

NONE = "–"


def rows(measurement: Measurement) -> Iterator[tuple[str, ...]]:
    """Yield the rows: what it is, at the measured lines, with the fitted plant, of the model."""
    three = (measurement.margins, measurement.fitted_margins, measurement.model_margins)
    yield "crossover [Hz]", *(_number(m.crossover_hz) for m in three)
    yield "phase margin", *(_degrees(m.phase_margin_deg) for m in three)
    yield "gain may grow by", *(_db(m.gain_margin) for m in three)
    yield "largest |S|", *(_largest(m) for m in three)


def words(measurement: Measurement) -> Iterator[str]:
    """Yield what was found of the plant, and what a reader should know."""
    plant, response = measurement.fitted, measurement.response
    errors = plant.errors
    inertia = f"inertia {plant.theta1:.4g} ± {errors[0]:.1g} V*s^2/m"
    units = measurement.machine.axes[response.axis].units
    yield (
        f"plant fitted to it: {units.words(inertia)}, delay "
        f"{plant.delay_s * 1e3:.3g} ± {errors[2] * 1e3:.1g} ms, lag {plant.lag_s * 1e3:.3g} ± "
        f"{errors[3] * 1e3:.1g} ms; it leaves {plant.error_db:.2g} dB"
    )
    for part in plant.parts:
        yield part.words
    if not plant.parts:
        yield "no part of the mass rings in this band"
    if len(response.not_linear_v):
        share = float(np.median(response.not_linear_v)) / response.line_v
        yield (
            f"at lines that were left out comes back {share:.1%} of a line: by what is not linear, "
            "or by noise"
        )
    yield from measurement.notes


def _number(value: float | None) -> str:
    return NONE if value is None else f"{value:.3g}"


def _degrees(value: float | None) -> str:
    return NONE if value is None else f"{value:.1f} deg"


def _db(factor: float | None) -> str:
    return "beyond the band" if factor is None else f"{20.0 * math.log10(factor):.1f} dB"


def _largest(margins: MeasuredMargins) -> str:
    return f"{margins.largest_sensitivity:.2f} at {margins.largest_at_hz:.3g} Hz"
