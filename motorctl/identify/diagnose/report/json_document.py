"""A diagnosis as the JSON document of ``diagnose --json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from motorctl.identify.columns.measured import Measured
from motorctl.identify.diagnose.read_stretches import ReadStretches
from motorctl.identify.diagnose.report.parameter_text import (
    Value,
    compensation_values,
    declared_alone_values,
    force_values,
    found_values,
    option_document,
    whole_model_values,
)
from motorctl.identify.diagnose.result import (
    AxisDiagnosis,
    FoundEffect,
    MissingMotion,
    RecordingDiagnosis,
    UnknownStructure,
)
from motorctl.json_values import plain


def diagnosis_document(diagnosis: RecordingDiagnosis) -> dict[str, Any]:
    """Return the document of ``diagnose --json``; numbers that are not finite are None."""
    return {
        "source": diagnosis.source,
        "sample_rate_hz": diagnosis.sample_rate_hz,
        "duration_s": diagnosis.duration_s,
        "axes": {name: axis_document(axis) for name, axis in diagnosis.axes.items()},
        "refused": dict(diagnosis.refused),
        "notes": list(diagnosis.notes),
    }


def axis_document(axis: AxisDiagnosis) -> dict[str, Any]:
    """Return what the document says of one axis.

    `parameters` are those of the declared effects, fitted together with what was found;
    `parameters_declared_alone` are those that the declared model takes where it stands alone.
    """
    declared = set(axis.declared.parameter_names)
    together = whole_model_values(axis)
    document: dict[str, Any] = {
        "declared": list(axis.declared.names),
        "parameters": _documents({k: v for k, v in together.items() if k in declared}),
        "parameters_declared_alone": _documents(declared_alone_values(axis)),
        "parameters_force": _documents(force_values(axis)),
        "verdict": axis.verdict,
        "sentence": axis.sentence,
        "mended": [asdict(mended) for mended in axis.mended],
        "effects": [_effect_document(axis.data, found) for found in axis.effects],
        "doubted": {name: dict(grounds) for name, grounds in axis.doubted.items()},
        "unknown": None if axis.unknown is None else _unknown_document(axis.data, axis.unknown),
        "missing": [_missing_document(missing) for missing in axis.missing],
        "error": _error_document(axis),
        "estimator": None if axis.estimator is None else asdict(axis.estimator),
        "whole_model": None if axis.whole is None else asdict(axis.whole),
        "read": None if axis.read is None else _read_document(axis.read),
        "dropped": dict(axis.dropped),
        "notes": list(axis.notes),
        "seconds": axis.seconds,
    }
    return {key: plain(part) for key, part in document.items()}


def _read_document(read: ReadStretches) -> dict[str, Any]:
    return {**asdict(read), "rows": read.rows, "sentence": read.sentence}


def _effect_document(data: Measured, found: FoundEffect) -> dict[str, Any]:
    return {
        "name": found.name,
        "title": found.effect.title,
        "formula": found.effect.formula,
        "family": found.effect.family(),
        "confidence": found.confidence,
        "family_confidence": found.family_confidence,
        "explained_fraction": found.explained_fraction,
        "score": found.score,
        "parameters": _documents(found_values(data, found)),
        "options": option_document(found.effect),
        "grounds": dict(found.grounds),
        "evidence": list(found.evidence),
        "indistinguishable_from": list(found.indistinguishable_from),
        "alternatives": [asdict(alternative) for alternative in found.alternatives],
    }


def _unknown_document(data: Measured, unknown: UnknownStructure) -> dict[str, Any]:
    compensation = unknown.compensation
    return {
        "depends_on": list(unknown.depends_on),
        "family": unknown.family,
        "sentence": unknown.sentence,
        "explained_fraction": unknown.explained_fraction,
        "compensation": None
        if compensation is None
        else {
            "name": compensation.name,
            "title": compensation.title,
            "parameters": _documents(compensation_values(data, unknown)),
            "options": option_document(compensation),
        },
    }


def _missing_document(missing: MissingMotion) -> dict[str, Any]:
    return {
        "effects": list(missing.effects),
        "why": missing.why,
        "motion": missing.motion,
        "program": missing.program,
    }


def _error_document(axis: AxisDiagnosis) -> dict[str, Any]:
    error = axis.error
    return {
        "unit": error.unit,
        "held_out_before_rms": error.held_out_before_rms,
        "held_out_after_rms": error.held_out_after_rms,
        "noise_floor_rms": error.noise_floor_rms,
        "explained_fraction": error.explained_fraction,
        "command_rms": error.command_rms,
        "simulated_position_before_rms_m": error.simulated_position_before_rms,
        "simulated_position_after_rms_m": error.simulated_position_after_rms,
        "simulated_position_unit": axis.data.position_unit,
        "window_s": error.window_s,
    }


def _documents(values: Mapping[str, Value]) -> dict[str, dict[str, Any]]:
    return {name: value.document() for name, value in values.items()}
