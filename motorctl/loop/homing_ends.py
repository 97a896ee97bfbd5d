"""Homing of a beam: both ends find their own switch or mark, and the beam is squared by them.

The ends move together while they search, as they do in any motion, so that nothing is racked: the
axis' sequence (`motorctl.loop.homing`) sees a switch that closes once both ends' have, and opens
once both have. Meanwhile each end latches its own edge or mark.
"""

from __future__ import annotations

from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.loop.axis_records import SHARP_TICKS
from motorctl.loop.guards.device import HOME_SWITCH, INDEX_LATCHED
from motorctl.loop.guards.homing import check_apart
from motorctl.loop.homing import LATCH_EDGE, LATCH_INDEX, RETREAT, SEARCH, SETTLE
from motorctl.loop.missed_samples import counter_step
from motorctl.loop.states import State

NO_PHASE = -1


@inner_kernel
def _find_edge(axis: Any, end: Any, phase: int, leaves: bool) -> None:
    """Note whether an end is through with what this phase looks for, and where that was.

    An edge that passed while no sample came is blurred.
    """
    if end.pressed:
        end.met = 1
    if end.done:
        return
    if phase == SEARCH or (phase == LATCH_EDGE and not leaves):
        end.done = 1 if end.pressed else 0
    elif end.met and not end.pressed:
        end.done = 1
    if end.done:
        end.latched_m = end.position_m
        if end.step_ticks > SHARP_TICKS:
            axis.blurred = 1


@inner_kernel
def begin_phase(axis: Any, dual: Any) -> None:
    """Let both ends look for what is new in the phase that homing is in now."""
    if dual.phase == axis.phase:
        return
    dual.phase, axis.blurred = axis.phase, 0
    if axis.phase != SETTLE:
        dual.first.met, dual.first.done = 0, 0
        dual.second.met, dual.second.done = 0, 0


@inner_kernel
def _find_mark(settings: Any, end: Any, raw_index: int, status: int) -> None:
    """Note an end's first index mark of this phase, and where it is."""
    if status & INDEX_LATCHED and not end.done:
        end.done = 1
        back = counter_step(settings, end.raw_counts, raw_index)
        end.latched_m = settings.metres_per_count * (end.counts + back) + settings.offset_m


@inner_kernel
def find_marks(
    settings: Any,
    axis: Any,
    dual: Any,
    raw_index: int,
    second_raw_index: int,
    status: int,
    second_status: int,
) -> None:
    """Note the first mark of each end, also in a tick without a sample: a mark is told once."""
    if axis.state != State.HOMING or axis.phase != LATCH_INDEX:
        return
    begin_phase(axis, dual)
    first, second = dual.first, dual.second
    if first.have_counts:
        _find_mark(settings.first, first, raw_index, status)
    if second.have_counts:
        _find_mark(settings.second, second, second_raw_index, second_status)


@inner_kernel
def joined_marks(
    axis_settings: Any,
    settings: Any,
    axis: Any,
    dual: Any,
    raw_index: int,
    second_raw_index: int,
    status: int,
    second_status: int,
    t: float,
) -> int:
    """Return the bits of home switch and index mark as the axis' homing shall see them.

    An axis that is not homing has the switch of either end, and no mark.
    """
    first, second = dual.first, dual.second
    either = HOME_SWITCH if first.pressed or second.pressed else 0
    if axis.state != State.HOMING:
        dual.phase = NO_PHASE
        return either
    phase = axis.phase
    begin_phase(axis, dual)
    if phase == LATCH_INDEX:
        find_marks(settings, axis, dual, raw_index, second_raw_index, status, second_status)
        check_apart(settings, axis, dual, True, t)
        both = first.done and second.done
        # What the axis takes for its mark's count lies half way between the two.
        mark_m = 0.5 * (first.latched_m + second.latched_m) - axis_settings.offset_m
        dual.raw_index_counts = round(mark_m / axis_settings.metres_per_count) if both else 0
        return either | (INDEX_LATCHED if both else 0)
    if phase not in (SEARCH, RETREAT, LATCH_EDGE):
        return either
    leaves = axis_settings.search_velocity_m_s * axis_settings.latch_velocity_m_s < 0.0
    _find_edge(axis, first, phase, leaves)
    _find_edge(axis, second, phase, leaves)
    check_apart(settings, axis, dual, phase == LATCH_EDGE and not axis.blurred, t)
    both = first.done and second.done
    if phase == SEARCH or (phase == LATCH_EDGE and not leaves):
        return HOME_SWITCH if both else 0
    return 0 if both else HOME_SWITCH


@inner_kernel
def settle_ends(settings: Any, axis: Any, dual: Any) -> None:
    """Hand the axis the place half way between the ends' edges; square the beam once it is homed.

    After the axis' own step of homing. From here on the skew counts from square, and the skew loop
    leads the ends there.
    """
    if axis.state == State.HOMING:
        dual.squared = 0
        if axis.phase == SETTLE and dual.phase == LATCH_EDGE:
            axis.latched_m = 0.5 * (dual.first.latched_m + dual.second.latched_m) + axis.shift_m
    elif axis.homed and not dual.squared:
        dual.squared = 1
        # The skew that the ends had between their edges is that of a square beam, and the offset.
        zero_m = settings.square_offset_m - (dual.first.latched_m - dual.second.latched_m)
        moved = zero_m - dual.shift_m
        dual.shift_m = zero_m
        dual.skew_m += moved
        dual.reference_m += moved
    elif not axis.homed:
        dual.squared = 0
