"""A following error that the law itself always trips in the axis' program, however good its model.

What friction makes of it in slow motion is in `slow_motion_rules`.
"""

from __future__ import annotations

from collections.abc import Mapping

from motorctl.config.axis_parts import AxisParts
from motorctl.config.following_motion import LawError
from motorctl.config.loop_rules import parameter_range
from motorctl.config.programs import followed_program
from motorctl.errors import Problem
from motorctl.located_yaml import Document
from motorctl.motion import Program


def check_following(
    document: Document, parts: AxisParts, programs: Mapping[str, Program], rate_hz: float | None
) -> list[Problem]:
    """Check that an axis whose model is exact can follow its program within its following error.

    Parameters
    ----------
    document
        The configuration.
    parts
        What could be read of the axis.
    programs
        Those that could be read.
    rate_hz
        The axis' own, None where it cannot be read [Hz].

    Returns
    -------
    list of Problem
        One at most.
    """
    program = followed_program(document, parts.name, programs)
    limits, gains, encoder = parts.limits, parts.gains, parts.encoder
    if program is None or limits is None or gains is None or encoder is None:
        return []
    if parts.model is None or rate_hz is None:
        return []
    inertia = parameter_range(parts.model, parts.estimates, "acceleration")[0]
    if not inertia > 0.0 or gains.command_filter is not None:
        return []
    error, period_s = limits.following_error, 1.0 / rate_hz
    own = LawError(gains, inertia, program, parts.name, period_s, error.minimum_m)
    if not own.trips(error, encoder.resolution_m, period_s):
        return []
    message = (
        f"found {error.minimum_m:g}, guards.following_error would always trip in program "
        f"'{program.name}', however good the model is: gains.velocity published takes half a "
        "period of its acceleration for lacking speed, which by k1 "
        f"{gains.k1_1_s:g} 1/s leaves the axis up to {own.most_m:.3g} m behind; "
        "should be above that, or gains.velocity be matched"
    )
    where = ("limits", "following_error", "minimum_m")
    return parts.problems(document, [(where, message)])
