"""A measured response as the JSON document of ``response --json``."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.json_values import plain
from motorctl.response.fitted_plant import FittedPlant
from motorctl.response.measurement import Measurement

ComplexArray = NDArray[np.complex128]


def response_document(measurement: Measurement) -> dict[str, Any]:
    """Return the document: curves as size and phase, margins, parameters, with units in keys."""
    response, model = measurement.response, measurement.model
    document: dict[str, Any] = plain(
        {
            "source": response.source,
            "axis": response.axis,
            "period_s": response.period_s,
            "windows": response.windows,
            "speed_m_s": response.speed_m_s,
            "line_v": response.line_v,
            "frequency_hz": response.frequency_hz,
            "coherence": response.coherence,
            "coherent": response.coherent,
            "plant_m_v": _polar(response.plant)
            | {
                "std_error_relative": response.plant_error,
                "std_error_phase_deg": np.degrees(response.plant_error),
            },
            "sensitivity": _polar(response.sensitivity) | {"std_error": response.sensitivity_error},
            "complementary_sensitivity": _polar(response.complementary),
            "loop": _polar(response.loop),
            "model": {
                "plant_m_v": _polar(model.plant),
                "loop": _polar(model.loop),
                "sensitivity": _polar(model.sensitivity),
            },
            "margins": asdict(measurement.margins),
            "model_margins": asdict(measurement.model_margins),
            "fitted_margins": asdict(measurement.fitted_margins),
            "not_linear": {
                "frequency_hz": response.not_linear_hz,
                "at_input_v": response.not_linear_v,
            },
            "fitted": _fitted(measurement.fitted),
            "notes": list(measurement.notes),
        }
    )
    return document


def _polar(values: ComplexArray) -> dict[str, Any]:
    return {"size": np.abs(values), "phase_deg": np.degrees(np.angle(values))}


def _fitted(plant: FittedPlant) -> dict[str, Any]:
    keys = ("theta1_v_s2_m", "theta2_v_s_m", "delay_s", "lag_s")
    values = (plant.theta1, plant.theta2, plant.delay_s, plant.lag_s)
    return {
        "parameters": {
            key: {"value": value, "std_error": error}
            for key, value, error in zip(keys, values, plant.errors, strict=True)
        },
        "left_db_rms": plant.error_db,
        "resonances": [
            {
                "effect": part.effect.name,
                "options": part.effect.options.model_dump(),
                "std_errors": part.option_errors,
                "share_of_mass": part.share,
                "resonance_hz": part.resonance_hz,
            }
            for part in plant.parts
        ],
    }
