"""A wave too long for the travel, told apart into a shorter wave and a slow force beside it.

A magnet's pitch and a spring of the cable chain are forces of position both. The search takes the
one form first that describes most, and a wave of a long pitch has orders for both. As it stands it
would be refuted, and all that it holds with it.
"""

from __future__ import annotations

from dataclasses import dataclass

from motorctl.identify.diagnose.search.acceptance import AS_WELL, SHADOW_SHARE
from motorctl.identify.diagnose.search.forms import WAVES, best_form, candidates, refined
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.measured_forms import Form, measure
from motorctl.identify.diagnose.search.option_ranges import ends_reached
from motorctl.model import Effect, Spans
from motorctl.model.knowledge import WAVE_OF_FORCE
from motorctl.model.pitch import PitchOptions
from motorctl.model.sign_function import Sign


@dataclass(frozen=True)
class Parted:
    """A shorter wave and a slow force."""

    before: Hypothesis
    """With the shorter wave alone."""
    slow: Form
    """The slow force beside it."""


def parted(hypothesis: Hypothesis, spans: Spans, sign: Sign | None) -> Parted | None:
    """Return a shorter wave and a slow force that may stand in the place of a long wave.

    Where both describe as much as the long wave, and the shorter wave most of what the slow force
    leaves: a slow force that is no wave has orders of any pitch.

    Parameters
    ----------
    hypothesis
        The declared model and what was found.
    spans
        What the recording spans.
    sign
        How friction turns over at rest.
    """
    for effect in filter(lambda each: _too_long(each, spans), hypothesis.added):
        rest = hypothesis.without(effect.name)
        alone = _slow_force(rest, spans, sign)
        if alone is None:
            continue
        for wave in _shorter(effect, spans):
            beside = rest.plus(wave)
            slow = None if measure(rest, wave) is None else _slow_force(beside, spans, sign)
            if slow is None or slow.held_out > AS_WELL * hypothesis.held_out:
                continue
            if slow.held_out < (1.0 - SHADOW_SHARE) * alone.held_out:
                return Parted(beside, slow)
    return None


def _too_long(effect: Effect, spans: Spans) -> bool:
    """Return whether an effect is a wave over position, of a pitch that is refuted at the end."""
    waves = effect.groups >= WAVE_OF_FORCE
    return waves and any(reached.refutes for reached in ends_reached(effect, spans))


def _shorter(effect: Effect, spans: Spans) -> list[Effect]:
    """Return waves of the orders that are multiples of some number, the shortest pitch first."""
    options = effect.options
    assert isinstance(options, PitchOptions)
    found = []
    for divisor in range(max(options.orders), 1, -1):
        orders = tuple(k // divisor for k in options.orders if k % divisor == 0)
        if not orders:
            continue
        wave = effect.with_options(pitch_m=effect.repeats_every / divisor, orders=orders)
        if not _too_long(wave, spans):
            found.append(wave)
    return found


def _slow_force(hypothesis: Hypothesis, spans: Spans, sign: Sign | None) -> Form | None:
    """Return the best force of position that does not repeat, beside a hypothesis."""
    classes = [
        cls
        for cls in candidates(hypothesis, spans)
        if "force_of_position" in cls.groups and not cls.groups & WAVES
    ]
    forms = filter(None, (best_form(hypothesis, cls, spans, sign) for cls in classes))
    return min(
        (refined(hypothesis, form, spans) for form in forms),
        key=lambda form: form.held_out,
        default=None,
    )
