"""Every picture of a diagnosis, as PNG files: each effect as an engineer would draw it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from motorctl.errors import UsageError
from motorctl.identify.diagnose.report.pictures.axis_signals import AxisSignals
from motorctl.identify.diagnose.report.pictures.command import (
    plot_acting_command,
    plot_flexible_mode,
    plot_lag,
    plot_limit,
)
from motorctl.identify.diagnose.report.pictures.friction import plot_friction, plot_presliding
from motorctl.identify.diagnose.report.pictures.position import (
    plot_cogging,
    plot_encoder_error,
    plot_force_ripple,
    plot_friction_by_place,
    plot_position_force,
)
from motorctl.identify.diagnose.report.pictures.residual import plot_residual, plot_spectra
from motorctl.identify.diagnose.report.pictures.time import (
    plot_contribution,
    plot_cross_axis,
    plot_gain_drift,
    plot_payload,
    plot_periodic,
)
from motorctl.identify.diagnose.report.pictures.unknown import plot_unknown
from motorctl.identify.diagnose.result import FoundEffect, RecordingDiagnosis
from motorctl.model.knowledge import PictureKind

Drawer = Callable[[AxisSignals, FoundEffect, Path], Path]
FEWEST_ROWS = 16
"""Fewest rows of which pictures are drawn. Fewer fill no bin of a panel, more would leave short
recordings without any. Chosen by hand."""


@dataclass(frozen=True)
class Picture:
    """One picture of an axis, and what is seen in it."""

    path: Path
    axis: str
    about: str
    """Name of the effect that it shows; `residual`, `spectrum` or `unknown`."""
    caption: str


DRAWERS: Mapping[PictureKind, Drawer] = {
    "over_time": plot_contribution,
    "folded_over_pitch": plot_cogging,
    "thrust_over_position": plot_force_ripple,
    "force_over_position": plot_position_force,
    "friction_over_position": plot_friction_by_place,
    "error_over_period": plot_encoder_error,
    "friction_over_velocity": plot_friction,
    "friction_after_reversal": plot_presliding,
    "command_response": plot_lag,
    "force_response": plot_flexible_mode,
    "acting_command": plot_acting_command,
    "limit_over_speed": plot_limit,
    "gain_over_time": plot_gain_drift,
    "mass_over_time": plot_payload,
    "folded_over_time": plot_periodic,
    "other_axis": plot_cross_axis,
}


def plot_diagnosis(diagnosis: RecordingDiagnosis, folder: Path) -> list[Picture]:
    """Draw every picture of a diagnosis into `folder` as ``<axis>_<what>.png``.

    Raises UsageError where they cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        pictures = []
        for name, axis in diagnosis.axes.items():
            others = {
                other: found.traces
                for other, found in diagnosis.axes.items()
                if other != name and found.traces is not None
            }
            if axis.traces is not None and len(axis.traces.time_s) >= FEWEST_ROWS:
                pictures += _axis_pictures(AxisSignals(name, axis, axis.traces, others), folder)
    except OSError as error:
        raise UsageError(f"{folder}: pictures cannot be written: {error.strerror}") from error
    return pictures


def _axis_pictures(axis: AxisSignals, folder: Path) -> list[Picture]:
    def place(what: str) -> Path:
        return folder / f"{axis.name}_{what}.png"

    pictures = []
    for found in axis.diagnosis.effects:
        how = found.effect.picture
        path = DRAWERS[how.kind](axis, found, place(found.name))
        pictures.append(Picture(path, axis.name, found.name, how.caption))
    if (unknown := axis.diagnosis.unknown) is not None:
        path = plot_unknown(axis, unknown, place("unknown"))
        caption = "Residual against what it may depend on."
        pictures.append(Picture(path, axis.name, "unknown", caption))
    caption = "What the model leaves of the command, over time."
    path = plot_residual(axis, place("residual"))
    pictures.append(Picture(path, axis.name, "residual", caption))
    caption = "Spectra of the residual: over time, beside the noise expected, and along the way."
    path = plot_spectra(axis, place("spectrum"))
    pictures.append(Picture(path, axis.name, "spectrum", caption))
    return pictures
