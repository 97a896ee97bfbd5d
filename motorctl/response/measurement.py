"""From the log of an excited axis to all that is told of its response."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motorctl.config import Machine
from motorctl.errors import UsageError
from motorctl.identify.fit.declared_models import machine_of
from motorctl.log import Recording, read_recording
from motorctl.response.estimate import Response, estimate_response, require_coherence
from motorctl.response.fitted_plant import FittedPlant, fit_plant
from motorctl.response.measured_margins import MeasuredMargins, measured_margins
from motorctl.response.model import ModelResponse, model_response
from motorctl.response.windows import excited_windows

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

DENSE = 4000
"""Frequencies of the fitted loop. Fewer step over sharp resonances, more takes time."""
SIGNALS = (
    "reference_m",
    "reference_velocity_m_s",
    "excitation_v",
    "state",
    "fault",
    "flags",
)
"""What is read of a log besides position and command."""


@dataclass(frozen=True)
class Measurement:
    """A measured response beside that of the axis' own model."""

    machine: Machine
    """As the log's own configuration describes it."""
    response: Response
    model: ModelResponse
    """Of the configuration, at the same lines."""
    margins: MeasuredMargins
    model_margins: MeasuredMargins
    """Of the model's loop at the same lines, by the same way."""
    fitted: FittedPlant
    fitted_loop: tuple[Array, ComplexArray]
    """Frequencies [Hz], finer than the lines, and the law around the fitted plant at them."""
    fitted_margins: MeasuredMargins
    """Of that: what rings between two lines shows here."""
    notes: tuple[str, ...]


def measure_response(logs: Sequence[Path], name: str, *, whole_run: bool = False) -> Measurement:
    """Return the response that a log of an excited axis tells.

    Parameters
    ----------
    logs
        The log; several of one run are one.
    whole_run
        The one log stands for all of its run.
    name
        The axis.

    Raises
    ------
    UsageError
        Where it is no log of motorctl's.
    DataError
        Where the axis was not excited, or too little of it is coherent.
    """
    recording = read_recording(list(logs), gaps="keep", whole_run=whole_run, signals=SIGNALS)
    machine = _machine(recording, name)
    axis, period_s = machine.axes[name], machine.period_of(name)
    windows = excited_windows(recording, name, axis.divisor)
    response = estimate_response(windows, name, recording.source)
    peak_v = float(np.abs(windows.excitation).max())
    require_coherence(response, axis.limits.max_excitation_v, peak_v)
    good = response.coherent
    lines = response.frequency_hz
    model = model_response(axis, period_s, lines)
    fitted = fit_plant(response)
    dense_hz = np.geomspace(lines[good][0], lines[good][-1], DENSE)
    dense = model_response(axis, period_s, dense_hz)
    fitted_loop: ComplexArray = fitted.response(dense_hz, period_s) * dense.loop / dense.plant
    return Measurement(
        machine=machine,
        response=response,
        model=model,
        margins=measured_margins(lines[good], response.loop[good]),
        model_margins=measured_margins(lines[good], model.loop[good]),
        fitted=fitted,
        fitted_loop=(dense_hz, fitted_loop),
        fitted_margins=measured_margins(dense_hz, fitted_loop),
        notes=(*recording.notes, *_notes(response)),
    )


def _machine(recording: Recording, name: str) -> Machine:
    machine: Machine | None = machine_of(recording)
    if machine is None or name not in machine.axes:
        known = ", ".join(recording.axes)
        raise UsageError(
            f"{recording.source}: its configuration does not tell of an axis '{name}': a response "
            f"needs a log that motorctl wrote; there are: {known}"
        )
    return machine


def _notes(response: Response) -> list[str]:
    notes = []
    good, hz = response.coherent, response.frequency_hz
    if not np.all(good):
        kept = hz[good]
        places = {
            f"below {kept[0]:.3g} Hz": hz < kept[0],
            f"above {kept[-1]:.3g} Hz": hz > kept[-1],
            "between": ~good & (hz > kept[0]) & (hz < kept[-1]),
        }
        told = [f"{np.count_nonzero(bad)} {where}" for where, bad in places.items() if np.any(bad)]
        notes.append(
            f"{np.count_nonzero(~good)} of {len(good)} lines are not coherent and count for "
            f"nothing: {', '.join(told)}"
        )
    if response.speed_m_s == 0.0:
        notes.append("the axis stood: friction that sticks counts as a spring")
    return notes
