"""Diagnose a recording: align, search, judge, and say what follows."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from motorctl.errors import DataError, UsageError
from motorctl.identify.columns.frozen_position import without_stale_start
from motorctl.identify.columns.held_samples import without_held
from motorctl.identify.columns.measured import (
    Measured,
    check_usable,
    counterpart,
    with_others,
    within,
)
from motorctl.identify.columns.pieces import shortened, without
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.columns.usual_mistakes import check_columns, check_signs
from motorctl.identify.diagnose.freed_memory import give_freed_memory_back
from motorctl.identify.diagnose.result import AxisDiagnosis, RecordingDiagnosis
from motorctl.identify.diagnose.search.both_sides import searched
from motorctl.identify.diagnose.search.hypothesis import Catalogue
from motorctl.identify.diagnose.search.motion_band import motion_band_hz
from motorctl.identify.diagnose.search.search import LONGEST_SEARCH_S, nothing_sought, over_all
from motorctl.identify.diagnose.search.undetermined import (
    with_determined,
    without_one_way_offset,
    without_undetermined,
)
from motorctl.identify.diagnose.search.whole_model import inertia_of
from motorctl.identify.diagnose.verdict.assemble import assemble
from motorctl.identify.diagnose.verdict.driven_motion import too_plain
from motorctl.identify.diagnose.verdict.far_spring import far_spring, load_on_spring
from motorctl.identify.diagnose.verdict.late_command import (
    late_beside,
    late_command,
    read_between,
)
from motorctl.identify.diagnose.verdict.position_faults import without_stuck
from motorctl.identify.diagnose.verdict.recording_mistakes import (
    UnexplainedMotionError,
    check_explains,
    check_magnitude,
    check_motion,
    explained_below,
)
from motorctl.identify.diagnose.verdict.set_point import check_no_set_point, like_a_set_point
from motorctl.identify.diagnose.verdict.speed_command import speed_told
from motorctl.identify.diagnose.verdict.testable import tested_apart
from motorctl.log import Recording
from motorctl.log.recording import Part
from motorctl.model import Effect, EffectList, known_effects
from motorctl.model.sign_function import sign_of, slope_of

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]


def diagnose_recording(
    recording: Recording,
    models: Mapping[str, EffectList],
    progress: Progress | None = None,
    evaluate_on: Recording | None = None,
    further: Sequence[type[Effect]] = (),
    inertia: Mapping[str, tuple[float, float]] | None = None,
) -> RecordingDiagnosis:
    """Diagnose each axis that `models` names; all other axes count as possible causes.

    Parameters
    ----------
    recording
        What is diagnosed.
    models
        The declared list of effects of each axis to be diagnosed.
    progress
        Called as progress(what, share) with what is being done and the share done, 0 to 1.
    evaluate_on
        A second recording of the same machine, on which the errors before and after are measured;
        without it, a part of this one is held out.
    further
        Effects to be tried beside those that are built in, installed, or declared for any axis.
    inertia
        Between what values that of an axis is known to lie, by its name, in units of the command;
        an effect with which it would be far from there is refuted.

    Returns
    -------
    RecordingDiagnosis
        Axis by axis what was found; an axis that cannot be diagnosed stands in `refused`, with the
        reason.

    Raises
    ------
    DataError
        No axis can be diagnosed.
    """
    catalogue = dict(known_effects())
    catalogue |= {type(e).name: type(e) for model in models.values() for e in model.effects}
    catalogue |= {cls.name: cls for cls in further}
    axes: dict[str, AxisDiagnosis] = {}
    refused: dict[str, str] = {}
    for k, (name, model) in enumerate(models.items()):

        def tell(what: str, name: str = name, k: int = k) -> None:
            if progress is not None:
                progress(f"axis {name}: {what}", k / len(models))

        try:
            test = None
            if evaluate_on is not None:
                test = with_others(evaluate_on, counterpart(evaluate_on, name))
            data = replace(with_others(recording, name), inertia=(inertia or {}).get(name))
            # Threads wait longer than small matrices take, and round by their number.
            with threadpool_limits(1, "blas"):
                axes[name] = diagnose_axis(data, model, tell, recording.segments, test, catalogue)
        except (DataError, UsageError) as error:
            refused[name] = str(error)
        give_freed_memory_back()
    if not axes:
        raise DataError("\n".join(refused.values()))
    if progress is not None:
        progress("done", 1.0)
    return RecordingDiagnosis(
        recording.source,
        recording.sample_rate_hz,
        recording.duration_s,
        axes,
        refused,
        recording.notes,
    )


def diagnose_axis(
    data: Measured,
    declared: EffectList,
    tell: Callable[[str], None] | None = None,
    segments: Mapping[Part, tuple[float, float]] | None = None,
    test: Measured | None = None,
    catalogue: Catalogue | None = None,
) -> AxisDiagnosis:
    """Diagnose one axis.

    Parameters
    ----------
    data
        What was measured of the axis, in its own units; the others beside it are possible causes.
    declared
        The effects that its model has.
    tell
        Called with what is being done.
    segments
        Begin and end [s] of the parts to fit and to hold out; the held-out part stays out of the
        search.
    test
        The axis in another recording, to measure errors on.
    catalogue
        The effects that are tried, by name; every known one by default.

    Returns
    -------
    AxisDiagnosis
        Verdict, effects with parameters and standard errors, and the errors before and after.

    Raises
    ------
    DataError
        The data cannot tell anything, and the message says why.
    """
    began = time.monotonic()
    tell = tell or (lambda _: None)
    parts = {str(part): span for part, span in (segments or {}).items()}
    if "fit" in parts:
        data = within(data, list(parts.values()))
    check_usable(data)
    check_signs(data)  # before means are taken over the rows of a slow sensor
    data, held = without_held(data)
    if test is not None:
        test, _ = without_held(test)
    data, stale = without_stale_start(data)
    check_columns(data, declared)
    check_magnitude(data)
    data, stuck = without_stuck(data)
    tell("reading its motion")
    slope = slope_of(declared.effects)
    signals = make_signals(data, slope_s_m=slope)
    check_motion(data, signals)
    pieces = shortened(signals, LONGEST_SEARCH_S)
    model, dropped = without_undetermined(pieces, declared)
    plain = too_plain(signals)
    far, below, held_back = None, None, False
    try:
        heard = check_explains(data, pieces, model, bool(plain), data.others)
    except UnexplainedMotionError as unexplained:
        far = far_spring(unexplained.plain)
        held_back = far is None and load_on_spring(unexplained.plain)
        if not held_back:
            below = explained_below(
                data, unexplained.plain, model, far.frequency_hz if far else 0.0
            )
        if below is not None:
            far = None
        elif far is None and not held_back:
            raise
        try:
            if far is not None:
                signals = pieces = make_signals(data, far.together_hz, slope)
            if below is not None:
                make_signals(data, below.regressors.signals.band_hz, slope)
        except DataError:  # too slow for so short a recording: what is said is the rest
            raise unexplained from None
        heard = below or check_explains(data, pieces, model, bool(plain) or held_back, data.others)
    if not plain:
        plain = check_no_set_point(heard.regressors.signals, declared)
    band_hz = motion_band_hz(heard, signals.band_hz)
    if below is not None:
        band_hz = min(band_hz, below.regressors.signals.band_hz)
    late = at_first = None if far else late_command(heard, band_hz)
    data, read = read_between(data, heard, late)
    if band_hz < signals.band_hz or read:
        signals = make_signals(data, band_hz, slope)
        model, one_way = without_one_way_offset(shortened(signals, LONGEST_SEARCH_S), model)
        dropped |= one_way
    if plain:
        found = nothing_sought(signals, model)
    else:
        tried = tested_apart(known_effects() if catalogue is None else catalogue, data, signals)
        tried = {name: cls for name, cls in tried.items() if name not in dropped}
        rows = without(signals, *parts["held_out"]) if "held_out" in parts else signals
        found = searched(rows, model, sign_of(declared.effects), tell, tried)
        whole = with_determined(
            shortened(rows, LONGEST_SEARCH_S), model, declared, found.final.added
        )
        if whole is not model:
            model = whole
            dropped = {name: why for name, why in dropped.items() if name not in model.names}
            found = searched(rows, model, sign_of(declared.effects), tell, tried)
        if not far and (late or not inertia_of(found.final) > 0.0):
            late = late_beside(heard, found.final.added, band_hz, late)
        found = over_all(found, signals, tried)
    tell("judging what was found")
    axis = assemble(data, found, model, dropped, parts, test, began, plain)
    if held_back and not any("resonance" in e.effect.groups for e in axis.effects):
        raise DataError(
            f"{data.place}: the command drives this position, but a load on a spring holds the "
            "motor back, and this motion does not tell which: record a longer one, with more steps "
            "or at a higher rate"
        )
    sent = like_a_set_point(axis, heard.regressors.signals)
    if not axis.effects:  # nothing that was found is sure enough to explain it
        late = late or at_first
    hint = far.told() if far else late.told() if late else None
    notes = filter(None, (held, stale, stuck, hint, read, sent, speed_told(axis)))
    return replace(axis, notes=(*axis.notes, *notes))
