"""Gaps that show by the motion's ripple alone: the acceleration explained by itself.

A load beyond a gap is let go where the motion turns its push round, and what it does then follows
from the motion. Formed on a measured motion, it follows from that motion's noise as well: at a
steady speed the ripple crosses the gap to and fro, and takes the measured acceleration away by
itself wherever the load is said to be free. So a gap has to show, too, where it is formed on a
motion without its fastest ripple.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from motorctl.identify.columns.stretches import Stretch, smoothed
from motorctl.identify.diagnose.search.held_out_blocks import held_out_sse, with_columns
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.model import Effect

BELOW = 0.5
"""Part of the band up to which the motion is kept. Larger leaves ripple in, smaller blurs when the
load is let go and caught. Chosen by hand: an octave."""
KEEPS = 0.1
"""Part of its gain that a gap must keep there. Larger doubts true gaps that are passed quickly,
smaller names ripple. Chosen by hand: gaps of machines of other hands keep from 0.23 on, a recorded
motor without one 0.002."""


def gap_in_ripple(final: Hypothesis) -> tuple[Effect, str] | None:
    """Return an effect of a load that is let go, which the motion's ripple alone shows, and why."""
    band_hz = BELOW * final.regressors.signals.band_hz
    for effect in final.added:
        if not effect.leaves_bursts:
            continue
        rest = final.without(effect.name)
        whole = math.log(rest.held_out / final.held_out)
        kept = math.log(rest.held_out / _left_without_ripple(rest, effect, band_hz))
        if whole > 0.0 and kept < KEEPS * whole:
            part = 100.0 * max(kept / whole, 0.0)
            return effect, (
                f"{effect.name} is refuted: formed on the motion below {band_hz:.3g} Hz it keeps "
                f"{part:.2g} % of what it gains (limit {100.0 * KEEPS:g} %): it answers to the "
                "ripple of the measured motion, not to where the axis speeds up or turns round"
            )
    return None


def _left_without_ripple(rest: Hypothesis, effect: Effect, band_hz: float) -> float:
    """Return what is left on held-out rows with an effect that sees the motion without ripple."""
    old = rest.regressors
    signals = old.signals

    def without_ripple(stretch: Stretch) -> Stretch:
        x = smoothed(stretch.x, band_hz, signals.period_s)
        return replace(stretch, x=x, v=np.gradient(x, signals.period_s))

    calm = signals.with_stretches(tuple(map(without_ripple, signals.stretches)))
    regressors = Regressors(calm, old.declared, old.blocks, old.side, old.catalogue)
    columns = regressors.state(effect, rest.acceleration, rest.undone)
    return float(held_out_sse(with_columns(rest.problem, columns)).sum())
