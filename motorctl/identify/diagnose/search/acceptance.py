"""Whether a form of an effect may be taken: it takes enough away, and is no other one's shadow."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from motorctl.identify.columns.left_side import Side
from motorctl.identify.diagnose.search.forms import is_corner
from motorctl.identify.diagnose.search.held_out_blocks import residual
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.measured_forms import Form
from motorctl.identify.diagnose.search.option_ranges import at_bound
from motorctl.identify.diagnose.search.whitening import spectrum
from motorctl.model import Effect, Spans
from motorctl.model.knowledge import Group

LEAST_GAIN = 60.0
"""Gain in log-likelihood of held-out rows that a name needs. Larger misses weak effects, smaller
names chance. Chosen by hand; the noise twins guard what lies just above it."""
RELEVANT = 6e-4
"""Part of the command's rms (of an encoder's error: of what the declared model misses) that an
effect must take: less does not matter to any axis, and no declared form is exact to such a degree.
Larger misses weak effects, smaller names what is left of a wrong shape. Chosen by hand on the
simulated campaign."""
RELEVANT_NEAR_REST = 1.2e-3
"""The same of a friction that shows near rest: what turns over there is never quite of the declared
form, mended or not, and what that leaves looks like such a friction. Larger misses weak effects,
smaller names what a form leaves. Chosen by hand: twice as much in rms, as structure without a name
must have; on a clean machine of another author it is half of it."""
LEAST_SHARE: dict[Side, float] = {"acceleration": 0.08, "command": 0.03}
"""Part of the squared residual left so far that an effect must take, by the left side. Larger
misses weak effects, smaller names what is left of others. Chosen by hand."""
NOISE_LIKE = 1.7
"""Squared residual over that of noise alone, below which it counts as noise when the search is
judged. Larger calls structure noise, smaller calls noise structure. Chosen by hand on the simulated
campaign."""
BAND_END = 0.85
"""Part of the band beyond which a line lies at its end, where noise looks like one. Larger lets
noise be named, smaller asks more of true lines. Chosen by hand."""
AT_END_SHARE = 0.3
"""Part of what is left that an effect there must take. Larger misses true ones, smaller names
noise. Chosen by hand."""
SHADOW_SHARE = 0.5
"""Part of what is left that an effect must take which may be another one's shadow. Larger misses a
true second line, smaller names what a wrong shape leaves. Chosen by hand on the simulated
campaign."""
SAME_SHARE = 0.9
"""The same for a second force over position, and for one over time in step with the move, where one
move is repeated. Larger misses true pairs, smaller names one cause twice. Chosen by hand on the
simulated campaign."""
IN_STEP = 0.05
"""Distance of a disturbance from a whole number of cycles in a move's period, in cycles, up to
which the two cannot be told apart. Larger doubts true ones, smaller names the move's own harmonics.
Chosen by hand on the simulated campaign."""
SMALL_PART = 0.005
"""Fraction of the declared model's residual that a slightly wrong shape leaves: an effect that
takes less needs `SMALL_SHARE`. Larger misses weak effects, smaller names remainders. Chosen by hand
on the simulated campaign."""
SMALL_SHARE = 0.35
"""Part of what is left that an effect must take which takes no more than that small part. Larger
misses weak effects, smaller names remainders. Chosen by hand on the simulated campaign."""
IMPACT_SHARE = 0.3
"""The same for impacts: their forms bend to what others leave at reversals, and where there are
impacts they are no small thing. Larger misses weak ones, smaller names remainders. Chosen by hand
on machines of other authors."""
REPEATED_SHARE = 0.5
"""The same for a second effect where one move is repeated: all that is left there repeats too, and
functions of place, time and speed can each draw a part of it. Larger misses true ones, smaller
names a wrong one. Chosen by hand on the simulated campaign."""
SAME_PHASE = 1.0
"""Phase [rad] by which a wave over time leaves one over position where the speed is not quite
steady, rms, up to which they are one. Larger doubts true disturbances, smaller names a motor's
second cogging a disturbance over time. Arithmetic: a radian apart, they are hardly alike."""
NEAR_MODE = 0.1
"""Distance of a line from a resonance, as a part of its frequency, that may be its ringing. Larger
doubts true lines, smaller names ringing. Chosen by hand on the simulated campaign."""
CLEARLY = 30.0
"""Density of the motion over that of the measurement's noise, from which the axis moves at a
frequency. Larger doubts true resonances, smaller names the feedback of noise. Chosen by hand."""
LEAST_EXCESS: dict[Side, float] = {"acceleration": 0.15, "command": 0.03}
"""Part of what is left above the noise that an effect must take, by the left side; less where a
machine is not down to its noise anyway. Larger misses weak effects, smaller names remainders.
Chosen by hand."""

LEAVES_AT_MOST = 0.7
"""Squared residual over that without it which an effect of no friction leaves that matters little
and is taken all the same, for noise alone is left. Larger names what a slightly wrong shape leaves,
smaller misses weak effects. Chosen by hand on the simulated campaign: weak resonances leave 0.4 to
0.5, and the next best effect 0.97."""

AS_WELL = 1.05
"""Squared residual of one effect over that of two up to which the one is no worse. Larger drops
true second effects, smaller keeps a spline beside the wave it is a part of. Chosen by hand on the
simulated campaign."""
OVER_PLACE: frozenset[Group] = frozenset({"wave_over_position", "wave_of_measurement"})
"""Groups of effects that repeat over the travel: a large wave of one leaves some of the other."""


def gain(before: Hypothesis, held_out: float) -> float:
    """Return the gain in log-likelihood of held-out rows, the noise's variance being unknown."""
    rows = before.regressors.signals.rows
    return float(0.5 * rows * np.log(max(before.held_out, 1e-300) / max(held_out, 1e-300)))


def acceptable(
    before: Hypothesis, form: Form, noise: float, spans: Spans, least_gain: float = LEAST_GAIN
) -> bool:
    """Return whether a form takes enough away, and not in one place alone."""
    floor = before.noise_sse(noise)
    excess = max(before.held_out - floor, 0.0)
    taken = before.held_out - form.held_out
    over_time = "line_over_time" in form.effect.groups
    frequency = form.effect.lines[0] if over_time else 0.0
    signals, least = before.regressors.signals, LEAST_SHARE[before.regressors.side]
    if "resonance" in form.effect.groups:
        # the feedback of the encoder's own noise looks like a resonance where little else moves
        faint = frequency > BAND_END * signals.band_hz
        if faint or not _moves_at(before, frequency):
            least = 1.0 if faint and before.held_out < NOISE_LIKE * floor else AT_END_SHARE
    elif "wave_over_time" in form.effect.groups and frequency > BAND_END * signals.band_hz:
        least = AT_END_SHARE
    if shadows(before.added, form.effect, spans):
        least = SHADOW_SHARE
    if form.effect.leaves_bursts:
        least = max(least, IMPACT_SHARE)
    if taken < SMALL_PART * before.regressors.declared_held_out:
        least = max(least, SMALL_SHARE)
    if before.added and _repeats_with(before, form.effect):
        least = SAME_SHARE
    elif before.added and signals.repeats_s and before.regressors.side == "acceleration":
        least = REPEATED_SHARE
    return bool(
        gain(before, form.held_out) > least_gain
        and (
            taken > _least_part(before.regressors, form.effect)
            or _leaves_noise(before, form, noise)
        )
        and taken > least * before.held_out
        and not at_bound(form.effect, spans)
        and taken > LEAST_EXCESS[before.regressors.side] * excess
        and not (form.effect.only_corner_is_left and is_corner(before, form))
    )


def _least_part(regressors: Regressors, effect: Effect) -> float:
    """Return the squared residual that an effect must take to matter.

    An error of the encoder may be far below the command and still spoil a following error: it is
    measured by what the declared model misses.
    """
    if effect.kind == "measurement":
        return RELEVANT**2 * regressors.declared_held_out
    if "friction" in effect.groups and "slow_reversals" in effect.revealed_by:
        return RELEVANT_NEAR_REST**2 * regressors.command_energy
    return relevant_part(regressors)


def _leaves_noise(before: Hypothesis, form: Form, noise: float) -> bool:
    """Return whether an effect takes a good part of what is left and leaves noise alone.

    What is left of a wrong shape is never quite described, so that this is none, however small.
    Friction has other shapes, which its own remainder may fit as well.
    """
    if "friction" in form.effect.groups or before.regressors.side == "command":
        return False
    least = min(LEAVES_AT_MOST * before.held_out, NOISE_LIKE * before.noise_sse(noise))
    return form.held_out < least


def relevant_part(regressors: Regressors) -> float:
    """Return the squared residual below which nothing matters."""
    return RELEVANT**2 * regressors.command_energy


def shadows(added: tuple[Effect, ...], effect: Effect, spans: Spans) -> bool:
    """Return whether an effect has a line of one that is there already.

    Then it may be what that one leaves where its own form is not quite the machine's.
    """
    for other in added:
        if other.name == effect.name:
            continue
        apart = np.abs(np.subtract.outer(other.lines, effect.lines))
        over_place = other.groups & OVER_PLACE and effect.groups & OVER_PLACE
        if over_place and apart.min() < 1.0 / spans.travel_m:
            return True
        over_time = "line_over_time" in other.groups & effect.groups
        if over_time and apart.min() < NEAR_MODE * other.lines[0]:
            return True
    return False


def _repeats_with(before: Hypothesis, effect: Effect) -> bool:
    """Return whether an effect repeats with the one move as what is there already does."""
    over_place = len(forces_of_position((effect, *before.added))) > 1
    repeats = before.regressors.signals.repeats_s > 0.0
    if over_place and repeats and before.regressors.side == "acceleration":
        return True
    return in_step(before, effect)


def in_step(before: Hypothesis, effect: Effect) -> bool:
    """Return whether an effect is a wave over time that repeats with the one move that is made.

    So does every wave at one steady speed, beside one over position.
    """
    if "wave_over_time" not in effect.groups:
        return False
    over_position = any("wave_over_position" in other.groups for other in before.added)
    if over_position and _as_over_position(before, effect.lines[0]):
        return True
    if not before.regressors.signals.repeats_s:
        return False
    cycles = effect.lines[0] * before.regressors.signals.repeats_s
    return abs(cycles - round(cycles)) < IN_STEP


def _as_over_position(before: Hypothesis, frequency_hz: float) -> bool:
    """Return whether a wave over time is one over position too, the speed being nearly steady."""
    signals = before.regressors.signals
    time, place = signals.time_s, signals.picked(lambda s: s.x)
    speed, start = np.polyfit(time, place, 1)
    apart = float(np.std(place - start - speed * time))
    return bool(2.0 * np.pi * frequency_hz * apart < SAME_PHASE * abs(speed))


def forces_of_position(effects: Iterable[Effect]) -> list[Effect]:
    """Return the effects that are forces of position alone."""
    return [effect for effect in effects if "force_of_position" in effect.groups]


def _moves_at(hypothesis: Hypothesis, frequency_hz: float) -> bool:
    """Return whether the motion at a frequency stands well above the noise of the measurement."""
    signals = hypothesis.regressors.signals
    left = hypothesis.problem.columns[:, -1].ravel()[: signals.rows]
    rest = residual(hypothesis.problem, hypothesis.solution.b)[: signals.rows]
    frequency, density = spectrum(left - rest, signals.row_period_s)
    place = int(np.argmin(np.abs(frequency - frequency_hz)))
    noise = (2.0 * np.pi * frequency_hz) ** 4 * signals.position_noise
    noise *= float(signals.response(np.array([frequency_hz]))[0]) ** 2
    near = density[max(place - 3, 0) : place + 4]
    return bool(np.median(near) > CLEARLY * noise)
