"""Recordings that cannot be what they are said to be: told plainly, before anything is named."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.identify.columns.measured import Measured, check_usable
from motorctl.identify.columns.signals import Signals, make_signals
from motorctl.identify.diagnose.search.held_out_blocks import make_blocks
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.verdict.driven_motion import (
    BAND_STEP,
    NARROWEST_HZ,
    above_noise,
    command_changes,
    moved_by,
    noise_sse,
    waves_explain,
)
from motorctl.identify.diagnose.verdict.position_faults import (
    drowned_in_steps,
    jumps_told,
    swings,
)
from motorctl.model import EffectList

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
EXPLAINS_ENOUGH = 0.5
"""Share of the squared acceleration that is left, above the noise, up to which the command drives
the position. Larger lets wrong columns pass, smaller asks more of good ones. Chosen by hand."""
EXPLAINS_NOTHING = 0.9
"""Share of the squared acceleration that is left beyond which the command has nothing to do with
the motion. Larger lets wrong columns pass, smaller refuses machines with large unknown forces.
Chosen by hand."""
MOVED_ENOUGH = 0.2
"""Part of the command, on rows held out, that acceleration, friction and a force of the place must
explain where the command explains little of the acceleration. Larger refuses loaded joints, smaller
lets wrong columns pass. Chosen by hand: joints of real arms have 0.28 to 0.99, the command of
another joint less than 0."""
NARROWER_ENOUGH = 0.5
"""The same in a narrower band, where nothing is explained in the one in which the motion outweighs
the encoder's noise. Larger refuses machines that shake, smaller lets wrong columns pass, as slow
motions are more alike. Chosen by hand: a pendulum whose frame shook had 0.05 below 50 Hz and 0.99
below 8 Hz."""
NEARLY_ALL = 0.95
"""Part of what the best of these bands explains that the widest one taken must. Larger narrows it
for nothing, smaller keeps the shaking. Chosen by hand."""
FEWEST_SWINGS = 8
"""Swings of the command, in such a band, from one side of its mean to the other. Larger refuses
short motions, smaller takes two slow motions that have nothing to do with each other for cause and
effect. Chosen by hand: of commands that were made up with 6 swings, 7 of 24 explained a half."""
BEYOND_RESONANCE = 2.0
"""Such a band over a resonance through which the command may drive the position instead, at least.
Larger takes a pendulum's own swing for one, smaller drops springs that are there. Chosen by hand:
beyond a spring's resonance the far side hardly answers."""
WAVES_ENOUGH = 0.5
"""The same that waves over position must explain beside these, where nothing else does: a motor's
cogging in slow motion. Larger refuses weak cogging, smaller lets wrong columns pass: six waves have
much freedom. Chosen by hand: bare motors have 0.7 to 0.9."""
OF_ITS_SIZE = 0.5
"""Part of a magnitude's own variance that the motion must explain once it has a direction. Larger
misses magnitudes that are mostly dry friction, smaller takes any positive column for one: its sign
alone is then explained. Chosen by hand: a real torque that drives nothing has 0.3, a real
duty cycle without a sign 0.97."""
SLOWEST_HZ = 0.5
"""Narrowest band in which a motion that its noise drowns is asked for its sign [Hz]. Larger calls
slow sweeps noise whose sign is reversed, smaller leaves no rows. Chosen by hand."""
DRIVES = 0.9
"""Part of another axis' command that this axis' motion must explain, for the two columns to be
called exchanged. Larger misses exchanged columns of loaded axes, smaller accuses axes that merely
move in time with each other. Chosen by hand: a real arm's joints reach 0.75 so, and 0.98 with the
right command."""
OWN_DRIVES = 0.5
"""Part of its own command from which an axis is not suspected of that. Larger suspects loaded axes,
smaller misses exchanged columns. Chosen by hand."""


class UnexplainedMotionError(DataError):
    """The command explains none of the acceleration; `plain` are the signals that show it."""

    def __init__(self, message: str, plain: Signals) -> None:
        super().__init__(message)
        self.plain = plain


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
    UnexplainedMotionError
        The command explains none of the acceleration, and no mistake that is known says why.
    DataError
        Naming the mistake, or what to record.
    """
    try:
        plain = above_noise(data, signals)
    except DataError:
        _check_sign_of_slow(data)
        raise
    hypothesis, left, total = _declared_in(plain, model)
    if left < EXPLAINS_ENOUGH * total and hypothesis.b[0] > 0.0:
        return hypothesis
    coarse: DataError | None = None
    try:
        clear = above_noise(data, signals, steps=True)
    except DataError as error:
        clear, coarse = plain, error
    if clear.band_hz < plain.band_hz:
        plain = clear
        hypothesis, left, total = _declared_in(plain, model)
        if left < EXPLAINS_ENOUGH * total and hypothesis.b[0] > 0.0:
            return hypothesis
    share, backwards = moved_by(plain)
    if backwards:  # said of a selection, it must hold of the whole recording
        _, backwards = moved_by(above_noise(data, make_signals(data)))
    if share < OWN_DRIVES:
        _check_own_command(data, others or {})
        _check_direction_of(data)
    if share > MOVED_ENOUGH and not backwards:
        return hypothesis
    if backwards:
        raise DataError(_reversed(data))
    _check_exchanged(data)
    nothing = left > EXPLAINS_NOTHING * total
    lenient = lenient or bool(others)
    if nothing and not lenient and waves_explain(plain) < WAVES_ENOUGH:
        if jumps := jumps_told(data):
            raise DataError(
                f"{data.place}: the command explains none of the acceleration: {jumps}. If it "
                "explains none then either, it is not what drives this axis"
            )
        if coarse is not None:
            raise coarse
        raise UnexplainedMotionError(
            f"{data.place}: the command explains none of the acceleration, and the motion "
            f"{math.floor(100.0 * max(share, 0.0))} % of the command (at least "
            f"{100.0 * MOVED_ENOUGH:.0f} % are needed): are these the position and the command "
            "of the same axis, in time with each other? Where other axes load this one, as in an "
            "arm, record them beside it",
            plain,
        )
    return hypothesis


def explained_below(
    data: Measured, plain: Signals, model: EffectList, resonance_hz: float
) -> Hypothesis | None:
    """Return the declared model in a narrower band in which the command drives the motion, or None.

    What shakes a machine, or noise that its encoder does not tell, may hide in a wide band that it
    does: the acceleration's noise grows faster with the band than anything else.

    Parameters
    ----------
    data
        The axis, as measured.
    plain
        Its rows in the band in which nothing was explained.
    model
        The declared effects.
    resonance_hz
        Through which the command may drive it instead, 0 where none: no band is asked that does not
        reach beyond, as below it such a machine moves as one.

    Raises
    ------
    DataError
        The command drives it in the other direction.
    """
    tried = []
    band_hz = BAND_STEP * plain.band_hz
    while band_hz >= max(NARROWEST_HZ, BEYOND_RESONANCE * resonance_hz):
        narrower = plain.plain(band_hz)
        tried.append((*moved_by(narrower), narrower))
        band_hz *= BAND_STEP
    best = max((share for share, *_ in tried), default=0.0)
    if best < NARROWER_ENOUGH:
        return None
    _, backwards, narrower = next(each for each in tried if each[0] >= NEARLY_ALL * best)
    (command,) = narrower.filtered([s.command[None] for s in narrower.stretches])
    if swings(command, narrower.row_period_s) < FEWEST_SWINGS:
        return None
    if backwards:  # said of a selection, it must hold of the whole recording
        _, backwards = moved_by(make_signals(data).plain(narrower.band_hz))
        if not backwards:
            return None
        raise DataError(_reversed(data))
    return _declared_in(narrower, model)[0]


def _check_sign_of_slow(data: Measured) -> None:
    """Raise DataError where a motion too slow for its noise shows a reversed sign all the same.

    Asked of the whole recording: what drowns in noise needs every row.
    """
    try:
        _, backwards = moved_by(above_noise(data, make_signals(data), narrowest_hz=SLOWEST_HZ))
    except DataError:
        return
    if backwards:
        raise DataError(_reversed(data))


def _reversed(data: Measured) -> str:
    return (
        f"{data.place}: with this command friction would give energy, and inertia be negative "
        "or too small to be seen: the sign of one of the two is reversed; reverse it in the "
        "recording"
    )


def _declared_in(plain: Signals, model: EffectList) -> tuple[Hypothesis, float, float]:
    """Return the declared model, the squared acceleration that it leaves, and all, above noise."""
    blocks = make_blocks(plain.rows, plain.row_period_s)
    hypothesis = Hypothesis(Regressors(plain, model, blocks))
    total = float(hypothesis.regressors.left @ hypothesis.regressors.left)
    noise = noise_sse(plain)
    return hypothesis, hypothesis.solution.sse - noise, total - noise


def _check_own_command(data: Measured, others: Mapping[str, Measured]) -> None:
    """Raise DataError where another axis' command is the one that drives this position."""
    for name, other in others.items():
        share = _driven_by(replace(data, command=other.command))
        if share > DRIVES:
            raise DataError(
                f"{data.place}: its own command does not drive it, but that of axis {name} does: "
                f"the motion explains {100.0 * share:.0f} % of it; exchange the two columns"
            )


def _check_direction_of(data: Measured) -> None:
    """Raise DataError where the command is a magnitude, whose direction is another column."""
    used = data.command[data.usable]
    if float(used.min()) < 0.0 < float(used.max()) or not command_changes(data):
        return
    stretches = make_signals(data).stretches
    time_s = np.concatenate([s.time_s for s in stretches])
    velocity = np.concatenate([s.v for s in stretches])
    way = np.sign(np.interp(data.time_s, time_s, velocity))
    signed = data.command * way
    share = _driven_by(replace(data, command=signed))
    of_size = 1.0 - (1.0 - share) * float(np.var(signed[data.usable]) / np.var(used))
    if share > DRIVES and of_size > OF_ITS_SIZE:
        raise DataError(
            f"{data.place}: the command never changes its sign, though the axis moves both ways; "
            f"with the sign of its velocity the motion explains {100.0 * share:.0f} % of it: it is "
            "a magnitude, and its direction stands in another column; give it that sign"
        )


def _check_exchanged(data: Measured) -> None:
    """Raise DataError where position and command make sense only the other way round."""
    other = replace(
        data, position=data.command, command=data.position, reference=None,
        reference_velocity=None, saturated=None, resolution=None,
    )  # fmt: skip
    try:
        check_usable(other)
        share = _driven_by(other)
    except DataError:
        return
    if share > DRIVES:
        raise DataError(
            f"{data.place}: position and command seem to be exchanged: the other way round the "
            f"motion explains {100.0 * share:.0f} % of the command; exchange the two columns"
        )


def _driven_by(data: Measured) -> float:
    """Return the part of the command that the motion explains; nothing of one that is reversed."""
    share, backwards = moved_by(above_noise(data, make_signals(data)))
    return 0.0 if backwards else share
