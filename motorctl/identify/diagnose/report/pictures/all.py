"""Every picture of a diagnosis, as PNG files: each effect as an engineer would draw it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from motorctl.errors import UsageError
from motorctl.identify.diagnose.report.pictures.axis_signals import Subject
from motorctl.identify.diagnose.report.pictures.command import (
    plot_dead_zone,
    plot_flexible_mode,
    plot_lag,
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

Drawer = Callable[[Subject, FoundEffect, Path], Path]
FEWEST_ROWS = 16


@dataclass(frozen=True)
class Picture:
    """One picture of an axis, and what is seen in it."""

    path: Path
    axis: str
    about: str
    """Name of the effect that it shows; `residual`, `spectrum` or `unknown`."""
    caption: str


DRAWERS: Mapping[str, tuple[Drawer, str]] = {
    "cogging": (
        plot_cogging,
        "Force on the carriage that everything else leaves, against position, folded over one "
        "pitch, and the residual's spectrum along the way.",
    ),
    "force_ripple": (
        plot_force_ripple,
        "Thrust for a command, against position: what everything else leaves, over the command.",
    ),
    "position_force": (
        plot_position_force,
        "Command that works against a force of position alone; below, the residual.",
    ),
    "position_dependent_friction": (
        plot_friction_by_place,
        "Level of friction without its viscous part, against position.",
    ),
    "encoder_error": (
        plot_encoder_error,
        "Error of the measured position over one period of the scale, as the acceleration tells.",
    ),
    "stribeck": (plot_friction, "Friction against velocity: data and models."),
    "asymmetric_friction": (plot_friction, "Friction against velocity: data and models."),
    "quadratic_drag": (plot_friction, "Friction against velocity: data and models."),
    "presliding": (
        plot_presliding,
        "Friction against the way after each reversal, in the direction of the new motion, and "
        "against velocity.",
    ),
    "input_lag": (
        plot_lag,
        "Gain and phase from the command that was given to the one that the motion shows.",
    ),
    "input_delay": (
        plot_lag,
        "Gain and phase from the command that was given to the one that the motion shows.",
    ),
    "flexible_mode": (plot_flexible_mode, "Gain and phase from force to acceleration."),
    "dead_zone": (plot_dead_zone, "Command that acts against command that is given, near zero."),
    "gain_drift": (plot_gain_drift, "Thrust for a command, against time."),
    "payload_change": (plot_payload, "Moving mass against time."),
    "periodic_disturbance": (
        plot_periodic,
        "Disturbance that everything else leaves, over time and folded over its period.",
    ),
    "cross_axis": (plot_cross_axis, "Pull of the other axis against its acceleration."),
}
"""How each effect is drawn; an effect that is not here is drawn over time."""


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
                pictures += _axis_pictures(Subject(name, axis, axis.traces, others), folder)
    except OSError as error:
        raise UsageError(f"{folder}: pictures cannot be written: {error.strerror}") from error
    return pictures


def _axis_pictures(subject: Subject, folder: Path) -> list[Picture]:
    def place(what: str) -> Path:
        return folder / f"{subject.name}_{what}.png"

    pictures = []
    for found in subject.axis.effects:
        draw, caption = DRAWERS.get(
            found.name, (plot_contribution, "What it adds to the command, over time.")
        )
        path = draw(subject, found, place(found.name))
        pictures.append(Picture(path, subject.name, found.name, caption))
    if (unknown := subject.axis.unknown) is not None:
        path = plot_unknown(subject, unknown, place("unknown"))
        caption = "Residual against what it may depend on."
        pictures.append(Picture(path, subject.name, "unknown", caption))
    caption = "What the model leaves of the command, over time."
    path = plot_residual(subject, place("residual"))
    pictures.append(Picture(path, subject.name, "residual", caption))
    caption = "Spectra of the residual: over time, beside the noise expected, and along the way."
    path = plot_spectra(subject, place("spectrum"))
    pictures.append(Picture(path, subject.name, "spectrum", caption))
    return pictures
