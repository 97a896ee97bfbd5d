"""The verdict: complete, effect, unknown structure, or insufficient data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from motorctl.identify.columns.left_side import Side
from motorctl.identify.diagnose.result import Verdict
from motorctl.identify.diagnose.search.acceptance import NOISE_LIKE, relevant_part
from motorctl.identify.diagnose.search.held_out_blocks import held_out_sse, residual, with_columns
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.search import (
    DOWN_TO_NOISE,
    Found,
    explained_share,
    on_pieces,
    rival_gains,
)
from motorctl.identify.diagnose.search.smooth_functions import VARIABLES, SmoothFunctions
from motorctl.identify.diagnose.search.whitening import spectrum

Array = NDArray[np.float64]

MATTERS = 4.0
"""Multiples of what matters at all, in squares, that structure without a name must reach: twice as
much in rms. Larger misses weak unknowns, smaller calls remainders unknown. Chosen by hand on the
simulated campaign."""
STRUCTURE = 0.08
"""Part of the squared residual that a smooth function must take away to count. Larger misses
unknown structure, smaller finds it in noise. Chosen by hand."""
RIVAL_SHARE: dict[Side, float] = {"acceleration": 0.12, "command": 0.35}
"""Part of the explainable error that the named effects may leave to a smooth function, by the left
side: more where a machine is not down to its noise anyway. Larger keeps wrong names, smaller drops
right ones. Chosen by hand; the command's on recordings of real machines."""
SMOOTH_LEFT = 0.5
"""Part of what the named effects leave: where a smooth function takes so much, they have not
described what they were named for, with the command on the left. Larger keeps wrong names, smaller
drops right ones. Chosen by hand."""
SURE_BESIDE = 0.3
"""Part of the explainable error that named effects must take to be told beside unknown structure.
Larger hides right names, smaller tells wrong ones. Chosen by hand."""
PROMINENT = 0.6
"""Part of the explainable error that one effect must take alone to be told beside what is left in
bursts or at low frequencies. Larger hides right names, smaller tells wrong ones. Chosen by hand."""
NAMED_ENOUGH: dict[Side, float] = {"acceleration": 0.88, "command": 0.75}
"""Part of the explainable error that named effects must take to be the answer, by the left side.
Larger calls named machines unknown, smaller the reverse. Chosen by hand on the simulated
campaign."""
BARELY_NAMED = 0.7
"""Less than this part of the explainable error, and names are not the answer, however near to the
noise the rest may be. Larger calls weak effects unknown, smaller keeps names that explain little.
Chosen by hand."""
LEFT_OVER: dict[Side, float] = {"acceleration": 0.1, "command": 0.3}
"""Part of the explainable error that named effects may leave coloured in time, by the left side:
more where a machine is not down to its noise anyway. Larger keeps wrong names, smaller drops right
ones. Chosen by hand."""
KEPT = 0.3
"""Part of its share that an effect must keep beside a smooth function: with less it was the
function's shadow. Larger drops right names, smaller keeps shadows. Chosen by hand."""
COLOURED = 3.0
"""Low-frequency residual over what the noise model expects, in power, from which it has structure
in time. Larger misses structure, smaller finds it in noise. Chosen by hand."""
MORE_THAN_NOISE = 3.0
"""Squared residual over that of noise alone, beyond which a model without any structure that can be
told is not complete all the same. Larger calls real machines complete, smaller doubts models whose
noise was estimated too small. Chosen by hand."""
FAINT = 0.02
"""Rms of what is left over the command's, up to which it counts as the machine's own noise where it
depends on nothing and is merely coloured. Larger calls weak unknowns noise,
smaller calls noise an unknown. Chosen by hand: drives and bearings make a hundredth or two."""
FAINT_BURSTS = 0.003
"""The same where it comes in bursts: what friction's corners leave. Larger calls weak impacts
noise, smaller calls corners impacts. Chosen by hand."""
LOW_HZ = 20.0
"""Frequencies that count as low there [Hz]. Larger mixes the measurement's noise in, smaller
averages fewer bins. Chosen by hand."""
BURSTS = 0.45
"""Part of the slow residual's energy that may come in bursts; quantisation alone gives up to a
third. Larger misses impacts and slips, smaller calls quantisation one. Chosen by hand on the
simulated campaign."""
BURST_HZ = 30.0
"""Highest frequency of the slow residual [Hz]: the noise of the measurement has little power there.
Larger adds noise, smaller blurs bursts. Chosen by hand on the simulated campaign."""
BURST_S = 0.05
"""Windows over which the power is averaged [s]. Larger dilutes bursts, smaller makes chance ones.
Chosen by hand on the simulated campaign."""
USUAL_POWER = 6.0
"""Multiples of the median window's power that white noise does not reach. Larger misses bursts,
smaller finds them in noise. Chosen by hand on the simulated campaign."""
TWICE = 2.0
"""Structure over that of the clean twin, from which it is the machine's. Larger misses weak
unknowns, smaller calls the measurement's own traces structure. Chosen by hand."""
MORE_BURSTS = 0.15
"""Part of the energy in bursts beyond the clean twin's, from which they are the machine's. Larger
misses impacts, smaller calls the corners that smoothing rounds off one. Chosen by hand."""
CLEAR_LEAD = 1.15
"""A rival of more variables must gain this many times what one of fewer does. Larger blames too
simple a variable, smaller takes the richer one for its freedom alone. Chosen by hand."""


@dataclass(frozen=True)
class Judged:
    """The verdict, and what it rests on."""

    verdict: Verdict
    kept: tuple[str, ...]
    """Names that stand."""
    rival: str | None
    """The smooth function that says what unknown structure depends on."""
    explainable: float
    """Squared residual of the declared model above the noise."""
    rival_share: float
    coloured: float
    bursts: float
    """Part of the slow residual's energy that comes in bursts."""
    faint: bool = False
    """Whether what is left is coloured, but small and without any structure."""
    as_twin: bool = False
    """Whether what is left is no more than what the machine's clean twin leaves."""


@dataclass(frozen=True)
class Leftover:
    """What a model leaves, beside what noise would."""

    ratio: float
    """Squared residual over that of noise alone."""
    coloured: float
    """Power at low frequencies over what the noise model expects."""
    bursts: float
    """Part of the slow residual's energy that comes in bursts."""
    structure: float
    """Part of the squared residual that the best smooth function takes away."""


NONE_LEFT = Leftover(1.0, 1.0, 0.0, 0.0)
"""What is left where noise alone is."""


def leftover(found: Found) -> Leftover:
    """Return what the final model leaves."""
    _, gain = _strongest(found.rival_gains)
    final = max(found.final.held_out, 1e-300)
    noise = max(found.final.noise_sse(found.force_noise), 1e-300)
    return Leftover(
        final / noise, low_frequency_excess(found), bursts(found), max(gain, 0.0) / final
    )


def judge(found: Found, clean: Leftover = NONE_LEFT) -> Judged:
    """Weigh the named effects against smooth functions that assume no physics.

    Parameters
    ----------
    found
        The outcome of a search.
    clean
        What is left over where nothing is missing, as on the machine's clean twin.

    Returns
    -------
    Judged
        The verdict, and what it rests on.
    """
    more = max(clean.ratio, 1.0)
    most_coloured = COLOURED * max(clean.coloured, 1.0)
    most_bursts = max(BURSTS, clean.bursts + MORE_BURSTS)
    least_structure = max(STRUCTURE, TWICE * clean.structure)
    noise = found.final.noise_sse(found.force_noise)
    base, final = found.base.held_out, found.final.held_out
    floor = min(noise, final)
    explainable = max(base - floor, 1e-300)
    rival, gain = _strongest(found.rival_gains)
    coloured = low_frequency_excess(found)
    bursting = bursts(found)
    names = tuple(effect.name for effect in found.final.added)
    named_share = explained_share(found) if names else 0.0
    rival_share = max(gain, 0.0) / explainable
    side = found.final.regressors.side
    noisy = final <= NOISE_LIKE * noise * more
    relevant = final - noise > MATTERS * relevant_part(found.final.regressors)
    least = max(least_structure * final, MATTERS * relevant_part(found.final.regressors))
    structured = gain > least and not noisy and relevant

    def judged(verdict: Verdict, kept: tuple[str, ...], by: str | None) -> Judged:
        share = rival_share
        if verdict == "unknown_structure" and names and not kept:
            by, gained = _strongest(rival_gains(found.base))
            share = max(gained, 0.0) / explainable
            by = by if share > STRUCTURE else None
            alone = replace(found, final=found.base)
            colour, lumps = low_frequency_excess(alone), bursts(alone)
            return Judged(verdict, kept, by, explainable, share, colour, lumps)
        return Judged(verdict, kept, by, explainable, share, coloured, bursting)

    if not names:
        if structured:
            return judged("unknown_structure", (), rival)
        lumpy = bursting > most_bursts
        shaped = lumpy or coloured > most_coloured
        if relevant and (shaped or final > MORE_THAN_NOISE * noise * more):
            most = FAINT_BURSTS if lumpy else FAINT
            faint = final < most**2 * found.final.regressors.command_energy
            if not faint or gain > STRUCTURE * final:
                return judged("unknown_structure", (), None)
            return replace(judged("complete", (), None), faint=True)
        return judged("complete", (), None)
    smooth_left = side == "command" and gain > SMOOTH_LEFT * final
    rough = _rough(found, explainable)

    def beside(by: str | None) -> Judged:
        return judged("unknown_structure", rough or _prominent(found, explainable), by)

    if structured and (rival_share > RIVAL_SHARE[side] or smooth_left):
        standing = {*_standing(found, rival, names), *rough}
        kept = tuple(name for name in names if name in standing)
        share = _share_of(found, kept, explainable)
        if share < NAMED_ENOUGH[side]:
            return judged("unknown_structure", kept if share > SURE_BESIDE else (), rival)
        return judged("effect", kept, rival)
    shaped = structured or coloured > most_coloured or bursting > most_bursts
    if named_share < NAMED_ENOUGH[side] and shaped and not noisy:
        return beside(rival if structured else None)
    if named_share < BARELY_NAMED and final > DOWN_TO_NOISE * noise * more:
        return beside(None)
    if 1.0 - named_share > LEFT_OVER[side] and coloured > most_coloured and not noisy:
        return beside(None)
    return judged("effect", names, None)


def low_hz(found: Found) -> float:
    """Return below what frequency the residual's power is told: slow recordings end before."""
    return min(LOW_HZ, found.final.regressors.signals.band_hz)


def burst_hz(found: Found) -> float:
    """Return below what frequency bursts are looked for: half of the band of slow recordings."""
    return min(BURST_HZ, 0.5 * found.final.regressors.signals.band_hz)


def low_frequency_excess(found: Found) -> float:
    """Return the residual's power at low frequencies over what the noise model expects."""
    hypothesis = found.final
    rows = residual(hypothesis.problem, hypothesis.solution.b)[: hypothesis.regressors.signals.rows]
    frequency, density = spectrum(rows, hypothesis.regressors.signals.row_period_s)
    low = (frequency > 0.0) & (frequency < LOW_HZ)
    if hypothesis.regressors.side == "command":
        density = density * float(hypothesis.b[0]) ** 2
    return float(np.mean(density[low]) / found.force_noise)


def bursts(found: Found) -> float:
    """Return the part of the slow residual's energy that comes in bursts.

    What no noise of the machine does, and what the counts of an encoder can not: at a steady speed
    their rounding may fall into the band, but with no more power than rounding has.
    """
    hypothesis = found.final
    signals = hypothesis.regressors.signals
    rows = residual(hypothesis.problem, hypothesis.solution.b)[: signals.rows]
    if hypothesis.regressors.side == "command":
        rows = rows * float(hypothesis.b[0])
    top = burst_hz(found)
    slow = signal.sosfiltfilt(
        signal.butter(4, top, fs=1.0 / signals.row_period_s, output="sos"), rows
    )
    window = max(2, round(BURST_S / signals.row_period_s))
    count = len(slow) // window
    power = np.mean(slow[: count * window].reshape(count, window) ** 2, axis=1)
    rounding = (2.0 * np.pi * top) ** 4 * 0.5 * signals.position_noise * signals.data.sample_rate_hz
    over = np.maximum(power - rounding - USUAL_POWER * float(np.median(power)), 0.0)
    return float(over.sum() / max(float(power.sum()), 1e-300))


def depends_on(rival: str | None) -> tuple[str, ...]:
    """Return the variables that a smooth function depends on."""
    return () if rival is None else VARIABLES[rival]


def _strongest(gains: Mapping[str, float]) -> tuple[str | None, float]:
    """Return the rival that gains most; one of fewer variables where it gains nearly as much."""
    best: str | None = None
    for name in sorted(gains, key=lambda n: len(VARIABLES[n])):
        gain = gains[name]
        wider = best is not None and len(VARIABLES[name]) > len(VARIABLES[best])
        if best is None or gain > gains[best] * (CLEAR_LEAD if wider else 1.0):
            best = name
    return best, 0.0 if best is None else gains[best]


def _standing(found: Found, rival: str | None, names: tuple[str, ...]) -> tuple[str, ...]:
    """Keep the names that still explain what they explained once the smooth function is there."""
    if rival is None:
        return names
    final = on_pieces(found.final)
    columns = SmoothFunctions(final.regressors.signals).columns(rival)

    def left(hypothesis: Hypothesis, beside: bool) -> float:
        if not beside:
            return hypothesis.held_out
        return float(held_out_sse(with_columns(hypothesis.problem, columns, soft=True)).sum())

    kept = []
    for name in names:
        rest = final.without(name)
        alone = left(rest, False) - left(final, False)
        beside = left(rest, True) - left(final, True)
        if beside > KEPT * alone:
            kept.append(name)
    return tuple(kept)


def _rough(found: Found, explainable: float) -> tuple[str, ...]:
    """Return the names whose own form leaves much, where they take enough to be told all the same.

    What is left then speaks against a complete model, but not against them.
    """
    rough = tuple(effect.name for effect in found.final.added if effect.leaves_bursts)
    return rough if rough and _share_of(found, rough, explainable) > SURE_BESIDE else ()


def _prominent(found: Found, explainable: float) -> tuple[str, ...]:
    """Return the name that alone takes most of the explainable error; nothing where none does.

    No function of position, velocity or command is what is left; so it is beside it, not instead.
    """
    names = (effect.name for effect in found.final.added)
    return tuple(name for name in names if _share_of(found, (name,), explainable) > PROMINENT)


def _share_of(found: Found, kept: tuple[str, ...], explainable: float) -> float:
    hypothesis = found.final
    for effect in found.final.added:
        if effect.name not in kept:
            hypothesis = hypothesis.without(effect.name)
    return (found.base.held_out - hypothesis.held_out) / explainable
