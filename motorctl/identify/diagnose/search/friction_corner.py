"""Effects that are the corner of any friction once its own shape has been fitted.

Where friction turns over within a band of speeds, what decays within that band as well is no effect
of its own: it is the shape of the corner. So is friction that would bend, where bending by next to
nothing explains as much. That is asked before an effect is taken, and once more beside the friction
that was mended for what was taken later.
"""

from __future__ import annotations

from motorctl.identify.diagnose.search.forms import is_corner
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.measured_forms import Form
from motorctl.model import Effect


def corner_of_friction(final: Hypothesis) -> tuple[Effect, str] | None:
    """Return an added effect that is hardly more than the corner of friction, and what to say."""
    for effect in final.added:
        if effect.corner() is None:
            continue
        form = Form(effect, final.solution.sse, final.held_out)
        if is_corner(final.without(effect.name).refreshed(), form):
            return effect, f"{effect.name} is refuted: {effect.corner_is}"
    return None
