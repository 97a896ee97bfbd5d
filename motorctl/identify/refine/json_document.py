"""A refinement as the JSON document of ``refine --json``."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from motorctl.config.machine import Machine
from motorctl.identify.diagnose.report.json_document import axis_document
from motorctl.identify.diagnose.result import RecordingDiagnosis
from motorctl.identify.refine.axis import AxisRefinement, current_model
from motorctl.identify.refine.refinement import Refinement
from motorctl.json_values import finite


def refinement_document(refinement: Refinement) -> dict[str, Any]:
    """Return the document of ``refine --json``, without the files of a report."""
    diagnosis, before = refinement.diagnosis, refinement.before
    return {
        "source": diagnosis.source,
        "config": str(refinement.source),
        "out": str(refinement.out),
        "changed": refinement.changed,
        "axes": {name: _axis(diagnosis, axis, before) for name, axis in refinement.axes.items()},
        "refused": dict(diagnosis.refused),
        "diff": refinement.diff,
    }


def _axis(diagnosis: RecordingDiagnosis, axis: AxisRefinement, before: Machine) -> dict[str, Any]:
    told = axis_document(diagnosis.axes[axis.axis])
    known = {
        part.effect.full_name(parameter): asdict(estimate)
        for part in current_model(before, axis.axis)
        for parameter, estimate in zip(part.effect.parameters, part.estimates, strict=True)
    }
    return {
        "verdict": axis.verdict,
        "changed": axis.changed,
        "effects_added": list(axis.added),
        "done": list(axis.done),
        "effects": told["effects"],
        "error": told["error"]
        | {
            "start_values_before_rms": finite(axis.start_error_v),
            "start_values_after_rms": finite(axis.refined_error_v),
        },
        "parameters": {
            name: {"before": known.get(name), "after": asdict(estimate)}
            for name, estimate in axis.estimates().items()
        },
    }
