"""Effects that are the corner of any friction once its own shape has been fitted.

Where friction turns over within a band of speeds, what decays within that band as well is no effect
of its own: it is the shape of the corner. So is friction that would bend, where bending by next to
nothing explains as much. That is asked before an effect is taken, and once more beside the friction
that was mended for what was taken later.
"""

from __future__ import annotations

from motorctl.identify.diagnose.search.forms import AS_A_CORNER, corner_takes
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.measured_forms import Form
from motorctl.model import Effect


def corner_of_friction(final: Hypothesis) -> tuple[Effect, str] | None:
    """Return an added effect that is hardly more than the corner of friction, and what to say."""
    for effect in final.added:
        if effect.corner() is None or not effect.only_corner_is_left:
            continue
        form = Form(effect, final.solution.sse, final.held_out)
        share = corner_takes(final.without(effect.name).refreshed(), form)
        if share > AS_A_CORNER:
            return effect, (
                f"{effect.name} is refuted: its corner at rest explains {100.0 * share:.0f} % of "
                f"what it does (limit {100.0 * AS_A_CORNER:g} %): {effect.corner_is}"
            )
    return None
