"""What a diagnosis gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.left_side import Side
from motorctl.identify.columns.measured import Measured
from motorctl.identify.diagnose.read_stretches import ReadStretches
from motorctl.model import Effect, EffectList
from motorctl.model.knowledge import Family

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
Verdict = Literal["complete", "effect", "unknown_structure", "insufficient_data"]


@dataclass(frozen=True)
class Alternative:
    """An explanation that was tried and not taken."""

    name: str
    why_not: str
    share: float
    """Its score over that of the effect that was taken."""


@dataclass(frozen=True)
class FoundEffect:
    """An effect that the model lacked; p linear parameters in units of the command."""

    effect: Effect
    """With its nonlinear options as found."""
    theta: Array
    """(p,); empty for what acts on the command or the measurement."""
    std_error: Array
    """(p,)"""
    option_errors: Mapping[str, float]
    """Standard errors of the nonlinear options that were fitted."""
    confidence: float
    """0 to 1: of the answers given with 0.9, nine in ten are right."""
    family_confidence: float
    """The same that the effect is of this family, whichever member it is."""
    explained_fraction: float
    """The part of the explainable held-out error that this effect alone takes away."""
    score: float
    """Gain in held-out log-likelihood."""
    evidence: tuple[str, ...]
    indistinguishable_from: tuple[str, ...]
    alternatives: tuple[Alternative, ...]
    grounds: Mapping[str, float] = field(default_factory=dict)
    """The figures that its confidence rests on (see `Evidence`)."""

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name


@dataclass(frozen=True)
class UnknownStructure:
    """Structure that no known effect explains."""

    depends_on: tuple[str, ...]
    """Of position, velocity, command, time, history; empty where it depends on none of them."""
    sentence: str
    compensation: Effect | None
    """A spline in these variables, where there is one that a controller can use."""
    family: Family | None
    """The kind of physics that it is, where the spline explains most; None where it is not told."""
    theta: Array
    """(p,) of the compensation."""
    std_error: Array
    explained_fraction: float


@dataclass(frozen=True)
class MendedTerm:
    """A declared effect whose own form was a little wrong: its options are found anew."""

    name: str
    options: Mapping[str, object]
    """Those that changed, as found."""
    declared: Mapping[str, object]
    """The same as they were declared."""
    sentence: str


@dataclass(frozen=True)
class MissingMotion:
    """What this recording cannot show, and the motion that would."""

    effects: tuple[str, ...]
    """Effects that cannot be tested, or cannot be told apart."""
    why: str
    motion: str
    """In words."""
    program: Mapping[str, object] | None
    """As the keys of a program file, without limits that only the machine knows broken."""


@dataclass(frozen=True)
class ModelError:
    """What the model leaves of the command in the band that was fitted, on held-out rows."""

    unit: str
    held_out_before_rms: float
    held_out_after_rms: float
    noise_floor_rms: float
    explained_fraction: float
    command_rms: float
    """Of the same rows in the same band."""
    simulated_position_before_rms: float | None = None
    """Over windows, each begun at the measured state; in units of the position."""
    simulated_position_after_rms: float | None = None
    window_s: float | None = None


@dataclass(frozen=True)
class Estimator:
    """The method by which parameters were found, and how errors in the regressors were met."""

    left: Side
    """Which signal stood on the left, where its errors bias nothing."""
    method: Literal["least_squares", "instruments"]
    """Instruments are columns formed from the reference."""
    sentence: str


@dataclass(frozen=True)
class WholeModel:
    """What physics says of a whole model, beside each of its effects."""

    inertia: float
    """With all that was found; infinite where no command acted in motion."""
    unit: str
    """Of all inertias here: the command's by that of acceleration."""
    seen_inertia: tuple[float, float] | None
    """Between what values it lies by an estimate that knows no effects; None if it fails."""
    declared_inertia: tuple[float, float] | None
    """Between what values it is declared to lie; None where that is not known."""
    friction_gives: float
    """Energy that friction surely gives at some speed, over what passes from command to motion."""


@dataclass(frozen=True)
class Traces:
    """Signals in the fitted band for pictures; arrays of shape (m,), rows in order of time."""

    time_s: Array
    position: Array
    velocity: Array
    acceleration: Array
    command: Array
    residual_before: Array
    """Command minus the declared model alone, fitted alone."""
    residual_after: Array
    """Command minus the whole model."""
    contributions: Mapping[str, Array]
    """What each found effect adds to the command (theta psi), by its name."""
    friction: Array
    """What the declared friction terms add to the command in the whole model."""
    held_out: NDArray[np.bool_]
    band_hz: float
    noise_floor_rms: float
    frequency_hz: Array
    """(f,) of the two spectra."""
    spectrum_before: Array
    """(f,) power density of residual_before [unit^2/Hz]."""
    spectrum_after: Array
    spectrum_noise: Array
    """(f,) what the noise model expects."""


@dataclass(frozen=True)
class AxisDiagnosis:
    """The diagnosis of one axis; n parameters of the whole model."""

    data: Measured
    declared: EffectList
    """As it was used: without what was dropped."""
    dropped: Mapping[str, str]
    """Declared effects that this recording cannot carry, and why."""
    verdict: Verdict
    sentence: str
    """The verdict in one sentence."""
    declared_theta: Array
    """Parameters of `declared`, fitted alone; never inject these while an effect is missing."""
    declared_std_error: Array
    effects: tuple[FoundEffect, ...]
    """Most important first."""
    unknown: UnknownStructure | None
    missing: tuple[MissingMotion, ...]
    model: EffectList
    """`declared`, then the found effects, then the compensation of unknown structure."""
    theta: Array
    """(n,) of `model`, fitted together, in units of the command."""
    std_error: Array
    error: ModelError
    traces: Traces | None
    """None where nothing could be fitted."""
    mended: tuple[MendedTerm, ...] = ()
    """Declared effects that have other options in `declared` than the model that was given."""
    doubted: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Effects that lower the error and are not named, each with the figures that speak against."""
    notes: tuple[str, ...] = ()
    estimator: Estimator | None = None
    """By what method the parameters were found."""
    whole: WholeModel | None = None
    """What physics says of the model with all that was found."""
    read: ReadStretches | None = None
    """What of a long log was read; None: all of the recording."""
    seconds: float = 0.0


@dataclass(frozen=True)
class RecordingDiagnosis:
    """The diagnosed axes of a recording."""

    source: str
    sample_rate_hz: float
    duration_s: float
    axes: Mapping[str, AxisDiagnosis]
    refused: Mapping[str, str] = field(default_factory=dict)
    """Why the other axes could not be diagnosed."""
    notes: tuple[str, ...] = ()

    # What words and pictures need is imported when somebody asks for them.

    def to_dict(self) -> dict[str, Any]:
        """Return the document of ``diagnose --json``, without its files."""
        from motorctl.identify.diagnose.report.json_document import diagnosis_document

        return diagnosis_document(self)

    def to_pandas(self) -> pd.DataFrame:
        """Return a row for each parameter of each found effect; one of an axis without any.

        Columns: axis, verdict, effect, confidence, explained_fraction, parameter, value,
        std_error, unit. Raises UsageError where pandas is not installed.
        """
        from motorctl.identify.diagnose.report.notebook import diagnosis_frame

        return diagnosis_frame(self)

    def __repr__(self) -> str:
        parts = [f"{name}: {axis.sentence}" for name, axis in self.axes.items()]
        return f"<RecordingDiagnosis {self.source}: {' '.join(parts)}>"

    def _repr_html_(self) -> str:
        from motorctl.identify.diagnose.report.notebook import diagnosis_html

        return diagnosis_html(self)

    def write_report(self, folder: Path, config: str | None = None) -> list[Path]:
        """Write what ``diagnose --out`` writes: the page, its pictures, program files of motions.

        Parameters
        ----------
        folder
            Where they go.
        config
            The configuration to be refined, where it is known: the page then tells how.

        Returns
        -------
        list of Path
            The files, the page first.

        Raises
        ------
        UsageError
            Where they cannot be written.
        """
        from motorctl.identify.diagnose.report.written import write_diagnosis

        return write_diagnosis(self, folder, config)[1]
