"""Which names stand once nothing speaks against any of them, beside the others that stand."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from motorctl.identify.diagnose.search.refutation import without_refuted
from motorctl.identify.diagnose.search.search import Found, declared_alone, rival_gains
from motorctl.identify.diagnose.verdict.clean_twin import clean_twin, no_further_than_twin
from motorctl.identify.diagnose.verdict.confidence import TOLD, Support, confidence, support_of
from motorctl.identify.diagnose.verdict.encoder_alone import encoder_alone
from motorctl.identify.diagnose.verdict.errors import Split, alternatives
from motorctl.identify.diagnose.verdict.evidence import Evidence, evidence_of
from motorctl.identify.diagnose.verdict.undetermined_model import over_command
from motorctl.identify.diagnose.verdict.verdict import FAINT, Judged, judge, leftover

NOISY = 0.008
"""Noise of the measurement over the command, both rms, from which a clean twin is asked: with less
noise the twin's own smoothing is what it leaves. Larger calls the feedback of an encoder's counts
structure, smaller takes weak structure for it. Chosen by hand: coarse encoders have 0.03 to 0.09,
fine ones 0.003."""
LITTLE = 0.03
"""What is left over the command, both rms, up to which the twin turns round as sharply as friction
makes it, and is asked whatever the noise. Larger hides structure of machines whose inertia is
hardly known, smaller calls the turns of dry friction structure. Chosen by hand: clean machines of
dry friction leave 0.003 to 0.017, instruments whose spring was hidden 0.2 to 0.4."""
OF_ENCODER = 0.75
"""Part of the squared rest that the encoder leaves by itself, from which the rest is the encoder's.
Larger calls lines of rounding structure, smaller calls structure rounding: at three quarters it is
weaker than rounding by half. Chosen by hand: a clean machine at a steady speed has 1.2, what lacks
something 0.0001 to 0.1."""
LIKE_TWIN = 0.5
"""Part of the rest that the clean twin must leave as well for the rest to be the measurement's.
Larger calls the feedback of an encoder's counts structure, smaller calls structure noise. Chosen by
hand: machines that lack nothing have 0.6 to 3.6, those that lack something 0.04 to 0.26, real ones
with a weight that was missed 0.09 and 0.17."""

REFUTED_TAKES = 0.25
"""Part of what is left that refuted effects took away together, from which the model is not called
complete without them: something is there, though not they. Larger calls machines complete that lack
something of another form, smaller doubts machines for what was found in noise. Chosen by hand: a
motor whose speed came 10 ms late had 0.3 to 0.5."""


@dataclass(frozen=True)
class Standing:
    """What is left of a search's outcome."""

    found: Found
    judged: Judged
    supports: Mapping[str, Support]
    """What each name that stands rests on."""
    refuted: tuple[str, ...]
    """Why effects were refuted."""
    doubted: Mapping[str, Evidence]
    """Effects that are hardly ever right."""
    unkept: Mapping[str, Evidence]
    """Effects that a function without physics describes as well."""


def standing(found: Found, split: Split, too_plain: bool = False) -> Standing:
    """Take effects out until those that are left are neither refuted nor all doubted.

    Each is judged in a model of those that are told: what an effect takes beside another is not
    what it takes without it, and the form of friction that was found meanwhile moves, too.

    Parameters
    ----------
    found
        The outcome of a search.
    split
        The rows held out.
    too_plain
        Whether the motion is too plain to tell anything: then no name stands.
    """
    refuted: tuple[str, ...] = ()
    doubted: dict[str, Evidence] = {}
    unkept: dict[str, Evidence] = {}
    while True:
        found, reasons = without_refuted(found, split.held_out)
        refuted += reasons
        judged = _beside_twin(found, judge(found))
        if too_plain:
            judged = replace(judged, verdict="complete", kept=(), rival=None)
        dropped = {
            effect.name: evidence_of(found, effect, alternatives(found, effect.name))
            for effect in found.final.added
            if effect.name not in judged.kept
        }
        unkept |= dropped
        found = _reduced(found, dropped)
        supports = {effect.name: support_of(found, effect) for effect in found.final.added}
        # the family of what is left says more than a name that is hardly ever right
        weak = {n: s.grounds for n, s in supports.items() if confidence(s.grounds) < TOLD}
        if len(weak) < len(supports):
            weak = {}  # beside a sure one, a name keeps what it had before others went
        rest = _reduced(found, weak)
        rest, reasons = without_refuted(rest, split.held_out) if dropped else (rest, ())
        if not weak and not reasons:
            if not too_plain:
                judged = _incomplete(found, judged)
            return Standing(found, judged, supports, refuted, doubted, unkept)
        doubted |= weak
        refuted += reasons
        found = replace(rest, rival_gains=rival_gains(rest.final))


def _incomplete(found: Found, judged: Judged) -> Judged:
    """Return the verdict where refuted effects took much of what is left.

    What a clean twin leaves as well, or drives and bearings make, is still the machine's own noise.
    """
    own = judged.as_twin or judged.faint or over_command(found, found.final.held_out) < FAINT
    if judged.verdict != "complete" or own or 1.0 - found.refuted_left < REFUTED_TAKES:
        return judged
    return replace(judged, verdict="unknown_structure")


def _reduced(found: Found, names: Iterable[str]) -> Found:
    """Return a search's outcome without some effects."""
    final = found.final
    for name in names:
        final = final.without(name)
    # a form of friction that shows only beside missing effects goes with them
    return replace(found, final=(final if final.added else found.base).refreshed())


def _beside_twin(found: Found, judged: Judged) -> Judged:
    """Take structure without a name back where the machine's clean twin leaves the like."""
    if judged.verdict != "unknown_structure" or judged.kept:
        return judged
    alone = declared_alone(found) if found.final.added else found
    if encoder_alone(alone) > OF_ENCODER * alone.final.held_out:
        return replace(judged, verdict="complete", rival=None, as_twin=True)
    left = over_command(alone, alone.final.held_out)
    little = left < LITTLE
    noisy = over_command(alone, alone.final.noise_sse(alone.force_noise)) > NOISY
    twin = clean_twin(alone, corners=little) if little or noisy else None
    if twin is None:
        return judged
    if over_command(twin, twin.final.held_out) < LIKE_TWIN * left:
        return judged
    again = judge(alone, leftover(twin))
    if again.verdict == "complete" or no_further_than_twin(alone, twin):
        return replace(judged, verdict="complete", rival=None, as_twin=True)
    return judged
