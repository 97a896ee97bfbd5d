"""Recordings that cannot be what they are said to be: told plainly, before anything is named."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from motorctl.errors import DataError
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.position_noise import acceleration_noise_rms
from motorctl.identify.columns.signals import Signals, make_signals, spans_of
from motorctl.identify.diagnose.search.forms import all_lines
from motorctl.identify.diagnose.search.held_out_blocks import (
    BlockedRegression,
    held_out_sse,
    make_blocks,
    make_problem,
    solve,
    with_columns,
)
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.smooth_functions import SmoothFunctions
from motorctl.identify.diagnose.search.undetermined import without_undetermined
from motorctl.identify.diagnose.verdict.position_faults import (
    drowned_in_steps,
    jumps_told,
    rounding_sse,
    steps_told,
)
from motorctl.identify.fit.judgement import (
    ForceOfPlaceError,
    NothingExplainedError,
    ReversedSignError,
)
from motorctl.identify.fit.recording import fit_axis
from motorctl.identify.fit.regression_data import TooFewRowsError
from motorctl.model import EffectList, basic_effects

Array = NDArray[np.float64]

FASTEST = {"m": 50.0, "rad": 20_000.0}
"""Speeds [unit/s] beyond those of any machine of the kind: a position in a wrong unit. Larger
overlooks millimetres taken for metres, smaller refuses fast machines. Chosen by hand."""
HARDEST = {"m": 3_000.0, "rad": 1e7}
"""Accelerations [unit/s^2] beyond those of any machine of the kind. Larger overlooks wrong units,
smaller refuses hard machines. Chosen by hand."""
SMALLEST = {"m": 2e-6, "rad": 2e-6}
"""Travel [unit] that no motion can be told from. Larger refuses fine stages, smaller takes noise
for motion. Chosen by hand."""
LARGEST = 1e9
"""Magnitude of any number in a recording, in its own unit, beyond which it is that of no machine.
Larger lets damaged files pass, smaller refuses encoders in counts. Chosen by hand."""
SHORTEST_S = 1.0
"""Shortest motion that is diagnosed [s]. Smaller leaves no blocks to hold out, larger refuses short
tests. Chosen by hand."""
HELD = 0.003
"""Spread of the command over its mean, below which it does not drive the motion. Larger refuses
lifts that carry much and move slowly, smaller takes a held torque for a drive. Chosen by hand."""
FEWEST_CHANGES = 4
"""Changes of speed, between rest and half of the usual speed: one move there and back has four
(start, stop, start, stop). Arithmetic. Fewer tell inertia from friction by chance, more refuses a
plain test."""
SLOW, QUICK = 0.25, 0.5
"""Parts of the usual speed below and above which an axis is at rest and in motion, for counting its
changes of speed. Closer together they count noise, further apart they miss gentle moves. Chosen by
hand."""
LASTS_S = 0.05
"""Time that a speed of a motion one way lasts at least [s]. Larger misses quick changes, smaller
counts ripple. Chosen by hand: the ripple of a geared joint is a fifth of that."""
EXPLAINS_ENOUGH = 0.5
"""Share of the squared acceleration that is left, above the noise, up to which the command drives
the position. Larger lets wrong columns pass, smaller asks `fit` about good ones. Chosen by hand."""
MOVED_ENOUGH = 0.2
"""Part of the command, on rows held out, that acceleration, friction and a force of the place must
explain where the command explains little of the acceleration. Larger refuses loaded joints, smaller
lets wrong columns pass. Chosen by hand: joints of real arms have 0.28 to 0.99, the command of
another joint less than 0."""
WAVES_ENOUGH = 0.5
"""The same that waves over position must explain beside these, where nothing else does: a motor's
cogging in slow motion. Larger refuses weak cogging, smaller lets wrong columns pass: six waves have
much freedom. Chosen by hand: bare motors have 0.7 to 0.9."""
REVERSED = 0.4
"""The part that acceleration and friction must explain for their signs to be called reversed, or to
count without a force of the place. Larger misses reversed commands of loaded axes, smaller accuses
motion that the command hardly drives. Chosen by hand: reversed real ones have 0.65 to 0.79, a link
that others drag 0.26, the angle that a servo is sent to 0.26; single moves of a real arm 0.5 to
0.98."""
DRIVES = 0.9
"""Part of another axis' command that this axis' motion must explain, for the two columns to be
called exchanged. Larger misses exchanged columns of loaded axes, smaller accuses axes that merely
move in time with each other. Chosen by hand: a real arm's joints reach 0.75 so, and 0.98 with the
right command."""
OWN_DRIVES = 0.5
"""Part of its own command from which an axis is not suspected of that. Larger suspects loaded axes,
smaller misses exchanged columns. Chosen by hand."""
INERTIA_SEEN = 0.1
"""Part of the command that inertia must ask for, for its sign to count. Larger judges by friction
alone, smaller by an inertia that unknown forces make. Chosen by hand."""
CHANGES = 0.1
"""Changes of the command, over its rms, from which it may be called reversed: a torque that is held
tells nothing of a sign. Larger misses reversed commands of loaded axes, smaller judges noise.
Chosen by hand."""
CLEARLY_OUTWEIGHS = 30.0
"""The same, at which no narrower band is looked for: below it, much of the command answers to the
noise. Larger hides fast effects, smaller lets noise judge. Chosen by hand."""
OUTWEIGHS = 3.0
"""Power of the acceleration over that of its noise, at least. Larger refuses gentle motion behind
coarse encoders, smaller reads noise as motion. Chosen by hand."""
NARROWEST_HZ = 4.0
"""Narrowest band in which motion is looked for [Hz]. Larger refuses gentle motion behind coarse
encoders, smaller leaves no rows. Chosen by hand."""
BAND_STEP = 0.7
"""Factor from one band that is tried to the next. Nearer to 1 takes time, smaller narrows more than
is needed. Chosen by hand: half an octave."""
EXPLAINS_NOTHING = 0.9
"""Share of the squared acceleration that is left beyond which the command has nothing to do with
the motion. Larger lets wrong columns pass, smaller refuses machines with large unknown forces.
Chosen by hand."""


def check_magnitude(data: Measured) -> None:
    """Raise DataError where a column has values that no machine has in any unit."""
    columns = {"position": data.position, "command": data.command}
    if data.reference is not None:
        columns["reference"] = data.reference
    for name, column in columns.items():
        largest = float(np.nanmax(np.abs(column[data.usable])))
        if largest > LARGEST:
            raise DataError(
                f"{data.place}: {name} reaches {largest:.3g}; no machine exceeds {LARGEST:g} in "
                "any unit: check the column and its scale"
            )


def check_motion(data: Measured, signals: Signals) -> None:
    """Raise DataError where travel, speed or acceleration is that of no machine."""
    unit = data.position_unit
    x = np.concatenate([s.x for s in signals.stretches])
    v = np.concatenate([s.v for s in signals.stretches])
    speed = float(np.percentile(np.abs(v), 99.0))
    change = np.gradient(v, signals.period_s)
    acceleration = float(np.percentile(np.abs(change), 99.0))
    duration = sum(len(s.x) for s in signals.stretches) * signals.period_s
    if duration < SHORTEST_S:
        raise DataError(
            f"{data.place}: {duration:.3g} s of motion; at least {SHORTEST_S:g} s are needed to "
            "hold a part of it out and test on it: record a longer motion"
        )
    if speed > FASTEST[unit] or (acceleration > HARDEST[unit] and not drowned_in_steps(signals)):
        raise DataError(
            f"{data.place}: it moves at {speed:.3g} {unit}/s and {acceleration:.3g} {unit}/s^2, "
            f"beyond {FASTEST[unit]:g} {unit}/s or {HARDEST[unit]:g} {unit}/s^2: is the position "
            f"in {unit}, and the sample rate {data.sample_rate_hz:g} Hz?"
        )
    if float(np.ptp(x)) < SMALLEST[unit]:
        raise DataError(
            f"{data.place}: it moves over only {float(np.ptp(x)):.3g} {unit}; at least "
            f"{SMALLEST[unit]:g} {unit} are needed: is the position in {unit}?"
        )


def too_plain(signals: Signals) -> str | None:
    """Return why a motion cannot tell inertia, friction and missing effects apart, or None."""
    command = np.concatenate([s.command for s in signals.stretches])
    level, spread = abs(float(np.mean(command))), float(np.std(command))
    if spread < HELD * level:
        return (
            f"the command stays at {level:.3g} {signals.data.command_unit} but for "
            f"{100.0 * spread / level:.2g} %: something else moves the axis; at least "
            f"{100.0 * HELD:g} % are needed: record moves that its own motor drives"
        )
    changes = _changes_of_speed(
        [s.v[:: signals.decimation] for s in signals.stretches], signals.row_period_s
    )
    if changes >= FEWEST_CHANGES:
        return None
    return (
        f"the axis speeds up or slows down only {changes} times, and at least {FEWEST_CHANGES} are "
        "needed to tell inertia, friction and what the model lacks from each other: record moves "
        "there and back at more than one speed and acceleration"
    )


def _changes_of_speed(velocities: list[Array], period_s: float) -> int:
    """Count the changes between rest and motion; a reversal is two.

    Of a motion one way, which need not rest, also those between slower and faster: speeds that
    last, as those of ripple do not.
    """
    low, high = np.percentile(np.concatenate(velocities), (5.0, 95.0))
    if low * high > 0.0:
        size = max(1, round(LASTS_S / period_s))
        speeds = [np.abs(uniform_filter1d(v, size, mode="nearest")) for v in velocities]
        slower, faster = np.percentile(np.concatenate(speeds), (5.0, 95.0))
        if faster - slower > SLOW * faster:
            velocities = [np.maximum(speed - slower, 0.0) for speed in speeds]
        else:
            velocities = speeds
    every = np.abs(np.concatenate(velocities))
    usual = float(np.median(every[every > 0.05 * every.max()]))
    changes = 0
    for v in velocities:
        place = np.where(v > QUICK * usual, 1, np.where(v < -QUICK * usual, -1, 0))
        place = place[(place != 0) | (np.abs(v) < SLOW * usual)]
        changes += int(np.sum(np.abs(np.diff(place))))
    return changes


def check_explains(
    data: Measured,
    signals: Signals,
    model: EffectList,
    lenient: bool = False,
    others: Mapping[str, Measured] | None = None,
) -> Hypothesis:
    """Raise DataError where the command does not drive the position, or not in this direction.

    Parameters
    ----------
    data, signals
        The axis, as measured and as rows.
    model
        The declared effects.
    lenient
        Of a motion too plain to tell, no more is asked than that nothing speaks of a usual mistake.
    others
        Axes that were recorded beside it and may load it: then no more is asked either.

    Returns
    -------
    Hypothesis
        The declared model over the widest band in which the acceleration stands clear of the
        encoder's noise.

    Raises
    ------
    DataError
        Naming the mistake, or what to record.
    """
    plain = _above_noise(data, signals)
    hypothesis, left, total = _declared_in(plain, model)
    if left < EXPLAINS_ENOUGH * total and hypothesis.b[0] > 0.0:
        return hypothesis
    coarse: DataError | None = None
    try:
        clear = _above_noise(data, signals, steps=True)
    except DataError as error:
        clear, coarse = plain, error
    if clear.band_hz < plain.band_hz:
        plain = clear
        hypothesis, left, total = _declared_in(plain, model)
        if left < EXPLAINS_ENOUGH * total and hypothesis.b[0] > 0.0:
            return hypothesis
    share, backwards = _moved_by(plain)
    if backwards:  # said of a selection, it must hold of the whole recording
        _, backwards = _moved_by(_above_noise(data, make_signals(data)))
    if share < OWN_DRIVES:
        _check_own_command(data, others or {})
        _check_direction_of(data)
    if share > MOVED_ENOUGH and not backwards:
        return hypothesis
    if backwards:
        raise DataError(
            f"{data.place}: with this command friction would give energy, and inertia be negative "
            "or too small to be seen: the sign of one of the two is reversed; reverse it in the "
            "recording"
        )
    lenient = lenient or bool(others)
    nothing = left > EXPLAINS_NOTHING * total
    try:
        fit_axis(data, model)  # knows the usual mistakes, such as exchanged columns
    except ForceOfPlaceError:
        pass  # that is what diagnosis is asked for
    except ReversedSignError:
        pass  # said of inertia alone, which may explain next to nothing
    except TooFewRowsError:
        pass  # its own filters need more of them than there are: it says nothing of this axis
    except NothingExplainedError:
        nothing = True
    if nothing and not lenient and _waves_explain(plain) < WAVES_ENOUGH:
        if jumps := jumps_told(data):
            raise DataError(
                f"{data.place}: the command explains none of the acceleration: {jumps}. If it "
                "explains none then either, it is not what drives this axis"
            )
        if coarse is not None:
            raise coarse
        raise DataError(
            f"{data.place}: the command explains none of the acceleration, and the motion "
            f"{100.0 * max(share, 0.0):.0f} % of the command (at least "
            f"{100.0 * MOVED_ENOUGH:.0f} % are needed): are these the position and the command "
            "of the same axis, in time with each other? Where other axes load this one, as in an "
            "arm, record them beside it"
        )
    return hypothesis


def _check_own_command(data: Measured, others: Mapping[str, Measured]) -> None:
    """Raise DataError where another axis' command is the one that drives this position."""
    for name, other in others.items():
        exchanged = replace(data, command=other.command)
        share, backwards = _moved_by(_above_noise(data, make_signals(exchanged)))
        if share > DRIVES and not backwards:
            raise DataError(
                f"{data.place}: its own command does not drive it, but that of axis {name} does: "
                f"the motion explains {100.0 * share:.0f} % of it; exchange the two columns"
            )


def _check_direction_of(data: Measured) -> None:
    """Raise DataError where the command is a magnitude, whose direction is another column."""
    used = data.command[data.usable]
    if float(used.min()) < 0.0 < float(used.max()) or not _changes(data):
        return
    stretches = make_signals(data).stretches
    time_s = np.concatenate([s.time_s for s in stretches])
    velocity = np.concatenate([s.v for s in stretches])
    way = np.sign(np.interp(data.time_s, time_s, velocity))
    directed = replace(data, command=data.command * way)
    share, backwards = _moved_by(_above_noise(directed, make_signals(directed)))
    if share > DRIVES and not backwards:
        raise DataError(
            f"{data.place}: the command never changes its sign, though the axis moves both ways; "
            f"with the sign of its velocity the motion explains {100.0 * share:.0f} % of it: it is "
            "a magnitude, and its direction stands in another column; give it that sign"
        )


def _declared_in(plain: Signals, model: EffectList) -> tuple[Hypothesis, float, float]:
    """Return the declared model, the squared acceleration that it leaves, and all, above noise."""
    blocks = make_blocks(plain.rows, plain.row_period_s)
    hypothesis = Hypothesis(Regressors(plain, model, blocks))
    total = float(hypothesis.regressors.left @ hypothesis.regressors.left)
    noise = _noise_sse(plain)
    return hypothesis, hypothesis.solution.sse - noise, total - noise


def _above_noise(data: Measured, signals: Signals, steps: bool = False) -> Signals:
    """Return the signals in the widest band in which motion outweighs the encoder's noise.

    Where that is not the whole one: the noise of the acceleration grows with the fifth power of the
    band, and a coarse encoder drowns fast motion alone. The steps of one whose counts come seldom
    are no white noise; they are asked where nothing is explained without.
    """
    band_hz = signals.band_hz
    enough: Signals | None = None
    clearest = 0.0
    while band_hz >= min(NARROWEST_HZ, signals.band_hz):
        plain = signals.plain(band_hz)
        left = plain.acceleration()
        noise = _noise_sse(plain)
        if steps:
            noise = max(noise, rounding_sse(plain))
        ratio = float(left @ left) / noise
        clearest = max(clearest, ratio)
        if ratio >= CLEARLY_OUTWEIGHS:
            return plain
        if enough is None and ratio >= OUTWEIGHS:
            enough = plain
        band_hz *= BAND_STEP
    if enough is not None:
        return enough
    by_steps = steps_told(data, clearest, OUTWEIGHS) if steps else ""
    raise DataError(
        f"{data.place}: only noise: the acceleration below {band_hz / BAND_STEP:.3g} Hz does not "
        f"reach {OUTWEIGHS:g} times the power of the position's own noise{by_steps}: record a "
        "faster motion"
    )


def _noise_sse(plain: Signals) -> float:
    """Return the squared acceleration that the position's noise alone would have in the rows."""
    return acceleration_noise_rms(plain.position_noise, plain.band_hz) ** 2 * plain.rows


def _moved_by(signals: Signals) -> tuple[float, bool]:
    """Return what the motion explains of the command on rows held out, and whether it is reversed.

    Inertia, friction and any force of the place, such as gravity, may each outweigh the others. A
    force of the place knows nothing of places that held-out rows alone pass, so inertia and
    friction are asked without one, too, and believed where they explain as much as a sign needs.
    Reversed is a command whose friction would give energy and whose inertia, where it is seen,
    would be negative, if these two explain a good part of it that no force of the place explains.
    """
    every = EffectList([cls() for cls in basic_effects().values()])
    model, dropped = without_undetermined(signals, every)
    motion, command, whole = _of_command(signals, model)
    blocks = motion.regressors.blocks
    best, share, of_place = motion.problem, -np.inf, 0.0
    for columns, soft in _forces_of_place(signals):
        beside = with_columns(motion.problem, columns, soft=soft)
        explained = 1.0 - float(held_out_sse(beside).sum()) / whole
        alone = make_problem(blocks, beside.joined(signals.rows)[len(motion.names) : -1], command)
        of_place = max(of_place, 1.0 - float(held_out_sse(alone).sum()) / whole)
        if explained > share:
            best, share = beside, explained
    one_way = bool(dropped)
    backwards = share - of_place > REVERSED and _drives_back(signals, motion, best, one_way)
    of_motion = 1.0 - float(held_out_sse(motion.problem).sum()) / whole
    believed = of_motion > max(share, REVERSED)
    if believed and not _drives_back(signals, motion, motion.problem, one_way):
        share = of_motion
    return share, backwards and _changes(signals.data)


def _drives_back(
    signals: Signals, motion: Hypothesis, problem: BlockedRegression, one_way: bool
) -> bool:
    """Return whether friction gives energy and inertia, where it is seen, is negative.

    Of a motion one way inertia alone tells it: friction is a constant force there.
    """
    basic = basic_effects()
    b = solve(problem).b
    velocity = signals.picked(lambda s: s.v)
    rows = problem.joined(signals.rows)
    friction = [
        k for k, name in enumerate(motion.names)
        if name in (basic["velocity"].name, basic["direction"].name)
    ]  # fmt: skip
    power = float(velocity @ (b[friction] @ rows[friction]))
    inertia = abs(float(b[0])) * float(np.std(rows[0])) / float(np.std(rows[-1]))
    seen = inertia >= INERTIA_SEEN
    return bool(b[0] < 0.0 and seen if one_way else power < 0.0 and (b[0] < 0.0 or not seen))


def _of_command(signals: Signals, model: EffectList) -> tuple[Hypothesis, Array, float]:
    """Return a model with the command on the left, the command at the rows, and its energy.

    The energy is that beside its mean, which no motion has to explain.
    """
    blocks = make_blocks(signals.rows, signals.row_period_s)
    motion = Hypothesis(Regressors(signals, model, blocks, "command")).refreshed()
    command = motion.problem.joined(signals.rows)[-1]
    return motion, command, max(float(np.sum((command - command.mean()) ** 2)), 1e-300)


def _changes(data: Measured) -> bool:
    """Return whether the command does more than hold."""
    used = data.command[data.usable]
    return float(np.std(used)) > CHANGES * float(np.sqrt(np.mean(used**2)))


def _waves_explain(signals: Signals) -> float:
    """Return the part of the command, on rows held out, that friction and waves explain together.

    A wave is known from one pass over a part of the travel, where a spline knows nothing of the
    places that it has not seen.
    """
    model = EffectList([cls() for cls in basic_effects().values()])
    motion, _, whole = _of_command(signals, model)
    waves = (
        all_lines(motion, cls, spans_of(signals))
        for cls in motion.regressors.catalogue.values()
        if {"wave_over_position", "force_of_position"} <= cls.groups
    )
    return 1.0 - min(waves, default=whole) / whole


def _forces_of_place(signals: Signals) -> Iterator[tuple[Array, bool]]:
    """Yield columns of forces of the place, stiff ones first, and whether they need holding.

    A spline of many knots says nothing of places that held-out rows alone pass.
    """
    low, high = (float(f(signals.picked(lambda s: s.x))) for f in (np.min, np.max))
    d = signals.decimation

    def columns(of: Callable[[Array], Sequence[Array]]) -> Array:
        place = [2.0 * (s.x[::d] - low) / max(high - low, 1e-300) - 1.0 for s in signals.stretches]
        return signals.filtered([np.stack(of(x)) for x in place], d)

    yield columns(lambda x: [x, x**2, x**3]), False
    if signals.data.position_unit == "rad":
        turned = [np.stack([np.sin(s.x[::d]), np.cos(s.x[::d])]) for s in signals.stretches]
        yield signals.filtered(turned, d), False
    yield SmoothFunctions(signals).columns("position"), True
