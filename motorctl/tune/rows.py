"""A tuning as the rows of a table, and what it rests on in words."""

from __future__ import annotations

import math
from collections.abc import Iterator

from motorctl.config.analysis import LoopGains, LoopMargins
from motorctl.config.filter_words import filter_words as words_of
from motorctl.tune.tuning import Tuning

NONE = "–"


def rows(tuning: Tuning) -> Iterator[tuple[str, ...]]:
    """Yield the rows: what it is, before, tuned."""
    words = tuning.loop.units.words
    loop, before, after = tuning.loop, tuning.before, tuning.gains
    told, tried = tuning.chosen.prediction, tuning.tried_out
    yield "k1 [1/s]", f"{before.k1_1_s:.4g}", f"{after.k1_1_s:.4g}"
    yield words("ks [V s/m]"), f"{before.ks_v_s_m:.4g}", f"{after.ks_v_s_m:.4g}"
    yield words("gamma_d [V/m]"), f"{before.gamma_d:.4g}", f"{after.gamma_d:.4g}"
    if before.command_filter or after.command_filter:
        yield "filter of the command", *(filter_words(gains) for gains in (before, after))
    pair = (tuning.before_margins, tuning.margins)
    yield "phase margin", *map(_phase, pair)
    yield "gain may grow by", *(_db(margins.gain_margin) for margins in pair)
    yield "gain may shrink by", *(_db(_inverse(margins.gain_reduction)) for margins in pair)
    noise = (tuning.before_prediction.command_noise_v, told.command_noise_v)
    yield "noise of the command [V rms]", *(f"{value:.3g}" for value in noise)
    predicted = (tuning.before_prediction.eF_m, told.eF_m)
    yield words("eF predicted [µm]"), *(f"{value * 1e6:.3g}" for value in predicted)
    measured = NONE if tried is None else f"{tried.eF_m * 1e6:.3g}"
    yield words("eF measured [µm]"), f"{loop.eF_m * 1e6:.3g}", measured


def footnotes(tuning: Tuning) -> Iterator[str]:
    """Yield what the figures rest on, and which limit binds."""
    loop, plant = tuning.loop, tuning.loop.plant
    friction = f"{plant.theta1:.4g} V*s^2/m, viscous friction {plant.theta2:.3g} V*s/m"
    yield (
        f"loop from {loop.source}: inertia {loop.units.words(friction)}, delay "
        f"{plant.delay_s * 1e3:.3g} ms"
        + (f", lag {plant.lag_s * 1e3:.3g} ms" if plant.lag_s else "")
    )
    yield f"what keeps the gains from going further: {tuning.bound_by}"
    yield from _of_filters(tuning)
    if tuning.error_for_margin:
        yield "the gains before do not keep the margins that were asked for: those cost error"
    if tuning.before.gamma_d == 0.0:
        yield "the fast adaptation was off in this log (gamma_d 0); the tuned gains switch it on"
    yield from loop.notes
    if tuning.before_prediction.d0_hat_v >= loop.d_hat_max_v:
        yield (
            f"d0_hat reached its bound, {loop.d_hat_max_v:g} V, in this log: the prediction is "
            "rough; a larger d_hat_max_v leaves the fast adaptation more to take"
        )


def filter_words(gains: LoopGains) -> str:
    """Return a filter in a few words."""
    own = gains.command_filter
    if own is None:
        return "none"
    return words_of(own.kind, own.frequency_hz, own.damping, own.depth)


def _of_filters(tuning: Tuning) -> Iterator[str]:
    """Yield what was found with filters of the command, where any was tried."""
    if not tuning.filters_tried:
        return
    tried = f"{tuning.filters_tried} filters of the command tried"
    without = tuning.without_filter
    if tuning.gains.command_filter is None:
        yield f"{tried}: none leaves clearly less error at these margins"
    elif without is None:
        yield f"{tried}: without one no gains keep what was asked"
    else:
        yield (
            f"{tried}; without one at the same margins: k1 {without.gains.k1_1_s:.4g}, ks "
            f"{without.gains.ks_v_s_m:.4g}, gamma_d {without.gains.gamma_d:.4g}, eF predicted "
            + tuning.loop.units.words(f"{without.prediction.eF_m * 1e6:.3g} µm")
        )


def _phase(margins: LoopMargins) -> str:
    if not margins.stable:
        return "unstable"
    return NONE if margins.phase_margin_deg is None else f"{margins.phase_margin_deg:.1f} deg"


def _db(factor: float | None) -> str:
    return "any" if factor is None else f"{20.0 * math.log10(factor):.1f} dB"


def _inverse(factor: float | None) -> float | None:
    return None if factor is None else 1.0 / factor
