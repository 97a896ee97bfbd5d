"""Whether a command drives the motion beside it, and the motion shows enough to tell by what."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from motorctl.errors import DataError
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.position_noise import acceleration_noise_rms
from motorctl.identify.columns.signals import Signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.diagnose.search.forms import all_lines
from motorctl.identify.diagnose.search.held_out_blocks import (
    BlockedRegression,
    blocks_out_of_step,
    held_out_sse,
    make_problem,
    solve,
    with_columns,
)
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.smooth_functions import SmoothFunctions
from motorctl.identify.diagnose.search.undetermined import without_undetermined
from motorctl.identify.diagnose.verdict.position_faults import rounding_sse, steps_told
from motorctl.model import EffectList, basic_effects
from motorctl.model.knowledge import WAVE_OF_FORCE

Array = NDArray[np.float64]

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
REVERSED = 0.47
"""The part that acceleration and friction must explain for their signs to be called reversed.
Larger misses reversed commands of loaded axes, smaller accuses motion that the command hardly
drives. Chosen by hand: reversed real ones have 0.49 to 0.79, a link that others drag 0.26, a joint
of an arm whose joints all move in step 0.44, the angle that a servo is sent to 0.26; single moves
of a real arm 0.5 to 0.98."""
BELIEVED = 0.4
"""The part that acceleration and friction must explain to count without a force of the place, which
knows nothing of places that held-out rows alone pass. Larger refuses single moves of an arm,
smaller takes motion that others drive for the command's. Chosen by hand: a link that others drag
has 0.26, a real joint's third move of its own 0.4 to 0.5."""
INERTIA_SEEN = 0.1
"""Part of the command that inertia must ask for, for its sign to count. Larger judges by friction
alone, smaller by an inertia that unknown forces make. Chosen by hand."""
ACTS = (5.0, 95.0)
"""Percentiles of the command between which its way is asked. Further apart a few damaged values
hide a load, closer together a rare reversal is overlooked. Chosen by hand."""
CHANGES = 0.1
"""Changes of the command, over its rms, from which it may be called reversed: a torque that is held
tells nothing of a sign. Larger misses reversed commands of loaded axes, smaller judges noise.
Chosen by hand."""
OUTWEIGHS = 3.0
"""Power of the acceleration over that of its noise, at least. Larger refuses gentle motion behind
coarse encoders, smaller reads noise as motion. Chosen by hand."""
CLEARLY_OUTWEIGHS = 30.0
"""The same, at which no narrower band is looked for: below it, much of the command answers to the
noise. Larger hides fast effects, smaller lets noise judge. Chosen by hand."""
NARROWEST_HZ = 4.0
"""Narrowest band in which motion is looked for [Hz]. Larger refuses gentle motion behind coarse
encoders, smaller leaves no rows. Chosen by hand."""
BAND_STEP = 0.7
"""Factor from one band that is tried to the next. Nearer to 1 takes time, smaller narrows more than
is needed. Chosen by hand: half an octave."""


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
    told = {
        0: "never speeds up or slows down",
        1: "speeds up or slows down only once",
        2: "speeds up or slows down only twice",
    }.get(changes, f"speeds up or slows down only {changes} times")
    return (
        f"the axis {told}, and at least {FEWEST_CHANGES} times are needed to tell inertia, "
        "friction and what the model lacks from each other: record moves there and back at more "
        "than one speed and acceleration"
    )


def one_move(signals: Signals) -> str | None:
    """Return that a motion is one step, and small swings or rest beside it, or None.

    As `too_plain`, but small motion counts as rest: the usual speed is that of the squared speed's
    half.
    """
    velocities = [s.v[:: signals.decimation] for s in signals.stretches]
    changes = _changes_of_speed(velocities, signals.row_period_s, of_energy=True)
    if changes >= FEWEST_CHANGES:
        return None
    return (
        f"nearly all of its motion is one move: it speeds up or slows down only {changes} times, "
        f"and at least {FEWEST_CHANGES} times are needed to tell inertia, friction and what the "
        "model lacks from each other: record moves there and back at more than one speed and "
        "acceleration"
    )


def _changes_of_speed(velocities: list[Array], period_s: float, of_energy: bool = False) -> int:
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
    if of_energy:
        ordered = np.sort(every)
        energy = np.cumsum(ordered**2)
        usual = float(ordered[np.searchsorted(energy, 0.5 * energy[-1])])
    changes = 0
    for v in velocities:
        place = np.where(v > QUICK * usual, 1, np.where(v < -QUICK * usual, -1, 0))
        place = place[(place != 0) | (np.abs(v) < SLOW * usual)]
        changes += int(np.sum(np.abs(np.diff(place))))
    return changes


def above_noise(
    data: Measured, signals: Signals, steps: bool = False, narrowest_hz: float = NARROWEST_HZ
) -> Signals:
    """Return the signals in the widest band in which motion outweighs the encoder's noise.

    Where that is not the whole one: the noise of the acceleration grows with the fifth power of the
    band, and a coarse encoder drowns fast motion alone. The steps of one whose counts come seldom
    are no white noise; they are asked where nothing is explained without.
    """
    band_hz = signals.band_hz
    enough: Signals | None = None
    clearest = 0.0
    while band_hz >= min(narrowest_hz, signals.band_hz):
        plain = signals.plain(band_hz)
        left = plain.acceleration()
        noise = noise_sse(plain)
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
        "faster motion, or at a higher rate"
    )


def noise_sse(plain: Signals) -> float:
    """Return the squared acceleration that the position's noise alone would have in the rows."""
    return acceleration_noise_rms(plain.position_noise, plain.band_hz) ** 2 * plain.rows


def moved_by(signals: Signals) -> tuple[float, bool]:
    """Return what the motion explains of the command on rows held out, and whether it is reversed.

    Inertia, friction and any force of the place, such as gravity, may each outweigh the others. A
    force of the place knows nothing of places that held-out rows alone pass, so inertia and
    friction are asked without one, too, and believed where they explain as much as a sign needs.
    Reversed is a command whose friction would give energy and whose inertia, where it is seen,
    would be negative, if these two explain a good part of it that no force of the place explains,
    and a good part of what it and a constant one leave together.
    """
    every = EffectList([cls() for cls in basic_effects().values()])
    model, dropped = without_undetermined(signals, every)
    motion, command, whole = _of_command(signals, model)
    blocks = motion.regressors.blocks
    constant = np.ones((1, signals.rows))  # a force of the place acts around one, as friction does
    best, share, of_place, around = motion.problem, -np.inf, 0.0, 0.0
    for columns, soft in _forces_of_place(signals):
        beside = with_columns(motion.problem, columns, soft=soft)
        explained = 1.0 - float(held_out_sse(beside).sum()) / whole
        alone = make_problem(blocks, beside.joined(signals.rows)[len(motion.names) : -1], command)
        of_place = max(of_place, 1.0 - float(held_out_sse(alone).sum()) / whole)
        held = with_columns(make_problem(blocks, constant, command), columns, soft=soft)
        around = max(around, 1.0 - float(held_out_sse(held).sum()) / whole)
        if explained > share:
            best, share = beside, explained
    one_way = bool(dropped)
    told = share - of_place > REVERSED and share - around > REVERSED * (1.0 - around)
    backwards = told and _drives_back(signals, motion, best, one_way)
    of_motion = 1.0 - float(held_out_sse(motion.problem).sum()) / whole
    believed = of_motion > max(share, BELIEVED)
    if believed and not _drives_back(signals, motion, motion.problem, one_way):
        share = of_motion
    return share, backwards and command_changes(signals.data)


def _drives_back(
    signals: Signals, motion: Hypothesis, problem: BlockedRegression, one_way: bool
) -> bool:
    """Return whether friction gives energy and inertia, where it is seen, is negative.

    Of a motion one way inertia alone tells it: friction is a constant force there. Where the
    command always acts the same way friction alone does not: it carries a load, and what it
    carries on the way there and back may differ by more than friction.
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
    if one_way:
        return bool(b[0] < 0.0 and seen)
    return bool(power < 0.0 and (b[0] < 0.0 if seen else not _carries(signals)))


def _carries(signals: Signals) -> bool:
    """Return whether the command always acts the same way."""
    ends = np.percentile(np.concatenate([s.command for s in signals.stretches]), ACTS)
    return bool(ends[0] * ends[1] > 0.0)


def _of_command(signals: Signals, model: EffectList) -> tuple[Hypothesis, Array, float]:
    """Return a model with the command on the left, the command at the rows, and its energy.

    The energy is that beside its mean, which no motion has to explain.
    """
    blocks = blocks_out_of_step(signals.picked(lambda s: s.v), signals.row_period_s)
    motion = Hypothesis(Regressors(signals, model, blocks, "command")).refreshed()
    command = motion.problem.joined(signals.rows)[-1]
    return motion, command, max(float(np.sum((command - command.mean()) ** 2)), 1e-300)


def command_changes(data: Measured) -> bool:
    """Return whether the command does more than hold."""
    used = data.command[data.usable]
    return float(np.std(used)) > CHANGES * float(np.sqrt(np.mean(used**2)))


def waves_explain(signals: Signals) -> float:
    """Return the part of the command, on rows held out, that friction and waves explain together.

    A wave is known from one pass over a part of the travel, where a spline knows nothing of the
    places that it has not seen.
    """
    model = EffectList([cls() for cls in basic_effects().values()])
    motion, _, whole = _of_command(signals, model)
    waves = (
        all_lines(motion, cls, spans_of(signals))
        for cls in motion.regressors.catalogue.values()
        if cls.groups >= WAVE_OF_FORCE
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
