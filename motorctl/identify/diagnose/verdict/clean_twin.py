"""The clean twin of a machine: what the declared model leaves where nothing is missing.

The twin moves as the machine did, smoothed, or but for the corners that its friction gives the
motion; its command is what the model asks for that motion, and its encoder rounds and is noisy as
the machine's. What is left over there comes from the measurement alone: from coarse counts,
friction's corners that smoothing rounds off, a clock's holes. Only what goes beyond that is
structure of the machine.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import gmean

from motorctl.errors import DataError
from motorctl.identify.columns.filters import second_difference
from motorctl.identify.columns.signals import Signals, make_signals
from motorctl.identify.columns.stretches import Stretch, command_for, smoothed
from motorctl.identify.diagnose.search.held_out_blocks import make_blocks
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.parameters import FittedModel, theta_of, values_of
from motorctl.identify.diagnose.search.search import BLOCK_S, Found, rival_gains
from motorctl.identify.diagnose.search.simulated_position import ratios_of, simulated_position
from motorctl.identify.diagnose.verdict.position_faults import step_of
from motorctl.model import Effect, EffectList
from motorctl.model.sign_function import slope_of

Array = NDArray[np.float64]

SEED = 7
"""Seed of the twin's noise, always the same: the same recording gets the same answer. Any other
would do as well. Convention."""
TURNED = 3
"""Times that friction's corners are put where the motion with them turns round. More takes time,
fewer leave corners beside the turns. Chosen by hand."""
NEXT_TO_TWIN = 1.6
"""What a model misses of the position over the shortest windows, over what it misses of the twin's,
up to which nothing is missing. Larger hides structure, smaller calls the feedback of an encoder's
counts structure. Chosen by hand: clean machines of another author have 1.1 to 1.5, machines that
lack something 2.6 to 7."""
NEAR_TWIN = 2.4
"""The same as the geometric mean over all windows. Larger hides structure, smaller calls the
feedback of an encoder's counts structure. Chosen by hand as above: clean machines have 0.9 to 2.3,
those that lack something 1.5 to 9."""


def clean_twin(found: Found, *, corners: bool = False) -> Found | None:
    """Return the same model on the clean twin of its machine.

    Parameters
    ----------
    found
        The outcome of a search; of its final model the twin is made.
    corners
        Whether its motion turns round as sharply as its friction makes it: the inertia has to be
        known well.

    Returns
    -------
    Found or None
        Its `final` is the model fitted to the twin; None where no twin can be made, as of a machine
        whose inertia was not found.
    """
    final = found.final
    real = final.regressors.signals
    values = values_of(final)
    if not (np.all(np.isfinite(values.theta)) and float(final.b[0]) > 0.0):
        return None
    draw = np.random.default_rng(SEED)
    position = real.data.position.copy()
    command = real.data.command.copy()
    usable = np.zeros(len(position), dtype=np.bool_)
    for s in real.stretches:
        first = int(np.searchsorted(real.data.time_s, s.time_s[0] - 0.5 * real.period_s))
        rows = slice(first, first + len(s.x))
        x = smoothed(s.position, real.band_hz, real.period_s)
        if corners:
            x = _with_corners(values, s, x, real)
        command[rows] = _command(values, s, x, real.period_s)
        position[rows] = as_measured(x, real, draw)
        usable[rows] = True
    data = replace(real.data, position=position, command=command, usable=usable, others={})
    declared = final.regressors.declared
    try:
        signals = make_signals(data, real.band_hz, slope_of(declared.effects))
    except DataError:
        return None
    signals = _with_others(signals.with_response(real.response), real)
    side = final.regressors.side
    blocks = make_blocks(signals.rows, signals.row_period_s, BLOCK_S[side])
    regressors = Regressors(signals, declared, blocks, side, final.regressors.catalogue)
    twin = Hypothesis(regressors, tuple(filter(_is_of_force, final.added))).refreshed()
    if not np.isfinite(twin.held_out):
        return None
    return replace(found, base=twin, final=twin, rival_gains=rival_gains(twin))


def no_further_than_twin(found: Found, twin: Found) -> bool:
    """Return whether a model predicts the machine's position nearly as well as its twin's.

    The command answers to the encoder's noise too, and moves the machine so: an equation error sees
    that as structure, a simulation along the recorded command does not.
    """
    real, clean = simulated_position(found.final), simulated_position(twin.final)
    ratios = list(ratios_of(clean, real, instead=False).values())
    return bool(ratios) and ratios[0] < NEXT_TO_TWIN and float(gmean(ratios)) < NEAR_TWIN


def _is_of_force(effect: Effect) -> bool:
    """Return whether the twin has an effect: lags and errors of measurement are left out there."""
    return effect.kind in ("state", "input")


def _with_corners(values: FittedModel, s: Stretch, smooth: Array, real: Signals) -> Array:
    """Return a smoothed motion in which friction turns over as quickly as in the model.

    Where dry friction turns over, the acceleration jumps, and that moves the smoothed speed's zero:
    a motion that is smooth there hides what the measurement makes of it. So what smoothing takes
    away of the motion that friction alone would make is put back.
    """
    period_s = real.period_s
    place = values.model.index_of("acceleration")
    if place is None:
        return smooth
    own = [e for e in values.model.effects if e.kind == "state" and "friction" in e.groups]
    theta = np.concatenate([np.zeros(0), *(theta_of(values, effect)[0] for effect in own)])
    x, still = smooth, np.zeros_like(smooth)
    for _ in range(TURNED):
        v = np.gradient(x, period_s)
        motion = replace(s, x=x, v=v, quiet=v)
        friction = command_for(motion, EffectList(own), theta, still) / -float(values.theta[place])
        alone = np.cumsum(np.cumsum(friction - friction.mean())) * period_s**2
        x = smooth + alone - smoothed(alone, real.band_hz, period_s)
    return x


def _command(values: FittedModel, s: Stretch, x: Array, period_s: float) -> Array:
    """Return the command that the model asks for a motion."""
    v, a = np.gradient(x, period_s), second_difference(x, period_s)
    motion = replace(s, x=x, v=v, quiet=v)
    return command_for(motion, values.model, values.theta, a)


def as_measured(x: Array, real: Signals, draw: np.random.Generator) -> Array:
    """Return a motion as the machine's encoder would show it."""
    count = step_of(real.data)
    white = real.position_noise_rms**2 - count**2 / 12.0
    noisy = x + math.sqrt(max(white, 0.0)) * draw.standard_normal(len(x))
    return np.asarray(np.round(noisy / count) * count) if count > 0.0 else noisy


def _with_others(signals: Signals, real: Signals) -> Signals:
    """Let other axes move beside the twin as they did beside the machine."""
    by_time = {float(s.time_s[0]): s.others for s in real.stretches}
    stretches = tuple(
        replace(s, others=by_time.get(float(s.time_s[0]), {})) for s in signals.stretches
    )
    return signals.with_stretches(stretches)
