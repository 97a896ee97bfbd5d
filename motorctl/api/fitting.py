"""Identify the declared model from a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from motorctl.api.recordings import AnyRecording, read_for_analysis

if TYPE_CHECKING:
    from motorctl.identify.fit.result import RecordingFit


def fit(
    recording: AnyRecording,
    *,
    model: str | None = None,
    axis: str | None = None,
    evaluate: AnyRecording | None = None,
    settings: str | Mapping[str, object] | None = None,
    whole_run: bool = False,
    allow_code: Sequence[str] = (),
    progress: Callable[[str], None] | None = None,
) -> RecordingFit:
    """Identify the declared model: parameters, standard errors, input delay and error.

    Parameters
    ----------
    recording
        A `Log`, a path, or the paths of several logs of one run.
    model
        C1, C2 or a configuration; None: what the log declares, or C1.
    axis
        This axis only; None: all.
    evaluate
        A second recording, for the held-out error.
    settings
        How it is filtered and regressed: the name of settings that come with motorctl (default,
        janot2019), a YAML file, or some of their keys as a mapping.
    whole_run
        A log stands for all logs of its run in its folder.
    allow_code
        Modules that may be imported where the log's configuration names effects in them.
    progress
        Told what is being done.

    Returns
    -------
    RecordingFit
        In `axes` the fit of each axis: `theta` and `std_error`, arrays (n,) in units of the
        command; `value(name)`; `delay_s`; `error`. `to_pandas()`, `to_dict()`.

    Raises
    ------
    DataError
        With file, place and value, where the recording cannot be used or tells nothing.
    UsageError
        Where an axis, the settings or the model are not there.
    """
    from motorctl.config.chosen_code import allowed_by
    from motorctl.identify.fit.declared_models import declared_models
    from motorctl.identify.fit.recording import fit_recording
    from motorctl.identify.fit.settings import FitOptions, load_settings

    may_run = allowed_by(allow_code)
    if isinstance(settings, Mapping):
        options: FitOptions | None = FitOptions().with_changes(**settings)
    else:
        options = None if settings is None else load_settings(settings)
    read = read_for_analysis(recording, whole_run)
    other = None if evaluate is None else read_for_analysis(evaluate)
    models = declared_models(read, model, axis, may_run)
    tell = None if progress is None else (lambda name: progress(f"fitting axis {name}"))
    return fit_recording(read, models, options, other, tell)
