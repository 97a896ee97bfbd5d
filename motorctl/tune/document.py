"""A tuning as the JSON document of ``tune --json``."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from motorctl.json_values import plain
from motorctl.tune.tuning import Tuning


def tuning_document(tuning: Tuning) -> dict[str, Any]:
    """Return the document: gains, margins, errors and curves, with units in the keys."""
    loop, told = tuning.loop, tuning.chosen.prediction
    document: dict[str, Any] = plain(
        {
            "source": loop.source,
            "axis": loop.axis,
            "wanted": asdict(tuning.wanted),
            "plant": asdict(loop.plant),
            "position_noise_rms_m": loop.noise_rms_m,
            "before": {
                "gains": asdict(tuning.before),
                "margins": asdict(tuning.before_margins),
                "eF_m": loop.eF_m,
                "eF_predicted_m": tuning.before_prediction.eF_m,
                "command_noise_v": tuning.before_prediction.command_noise_v,
            },
            "after": {
                "gains": asdict(tuning.gains),
                "margins": asdict(tuning.margins),
                "eF_predicted_m": told.eF_m,
                "L2_predicted_m": told.L2_m,
                "command_noise_v": told.command_noise_v,
                "d0_hat_predicted_v": told.d0_hat_v,
                "eF_tried_out_m": None if tuning.tried_out is None else tuning.tried_out.eF_m,
            },
            "without_filter": None
            if tuning.without_filter is None
            else {
                "gains": asdict(tuning.without_filter.gains),
                "eF_predicted_m": tuning.without_filter.prediction.eF_m,
            },
            "filters_tried": tuning.filters_tried,
            "bound_by": tuning.bound_by,
            "notes": list(loop.notes),
            "trade_off": {
                "phase_margin_deg": tuning.curves.phase_deg.tolist(),
                "eF_at_phase_margin_m": tuning.curves.at_phase_m.tolist(),
                "command_noise_v": tuning.curves.noise_v.tolist(),
                "eF_at_command_noise_m": tuning.curves.at_noise_m.tolist(),
            },
        }
    )
    return document
