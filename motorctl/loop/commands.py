"""Commands from the mailbox: what each asks besides the table of states, and what it begins."""

from __future__ import annotations

from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.loop.excitation import begin_excitation
from motorctl.loop.fences import load_acquire
from motorctl.loop.guards.command import has_lost_its_numbers, is_hot
from motorctl.loop.guards.encoder import begin_watching, trembles
from motorctl.loop.guards.motion import is_too_fast, set_soft_limits
from motorctl.loop.guards.reactions import emergency_stop, stop
from motorctl.loop.guards.readiness import check_readiness, has_power, is_unwell
from motorctl.loop.guards.supervision import still_overruns
from motorctl.loop.homing import begin_homing
from motorctl.loop.layout import MAILBOX_SIZE
from motorctl.loop.reference import hold_where_it_is
from motorctl.loop.states import allows, is_off, take
from motorctl.loop.vocabulary import Reply, Verb

BEGINNINGS = (Verb.START, Verb.HOME, Verb.FOLLOW, Verb.EXCITE)
AT_START_M = 1e-6
"""How near the reference must be to a program's start."""


@inner_kernel
def take_commands(
    watch: Any,
    status: Any,
    mailbox: Any,
    replies: Any,
    settings: Any,
    axes: Any,
    laws: Any,
    segments: Any,
    excitations: Any,
    tick: int,
    t: float,
) -> None:
    """Take the commands that came. Once the loop shuts down, none begins any motion.

    The replies are announced when the tick is published.
    """
    first, last = status[0].mail_taken, load_acquire(status[0], "mail_head")
    for number in range(first, last):
        command = mailbox[number % MAILBOX_SIZE]
        if command.verb == Verb.SHUTDOWN:
            watch.shutdown = 1
            for i in range(axes.size):
                stop(axes[i])
            answer = Reply.OK
        elif command.verb == Verb.ESTOP:
            for i in range(axes.size):
                emergency_stop(axes[i], t)
            answer = Reply.OK
        elif not 0 <= command.axis < axes.size or (watch.shutdown and command.verb in BEGINNINGS):
            answer = Reply.WRONG_STATE
        else:
            i = command.axis
            if command.verb == Verb.EXCITE:
                answer = begin_excitation(axes[i], excitations[i])
            else:
                answer = _obey(command, watch, settings[i], axes[i], laws[i], segments[i], tick)
        replies[number % MAILBOX_SIZE] = answer
    status[0].mail_taken = last


@inner_kernel
def _obey(
    command: Any, watch: Any, settings: Any, axis: Any, law: Any, segments: Any, tick: int
) -> Reply:
    """Carry out what the table of states allows, and answer.

    A verb has the number of its event in the table.
    """
    verb = command.verb
    if verb == Verb.STOP:
        return Reply.OK if stop(axis) else Reply.WRONG_STATE
    if verb == Verb.HOME and settings.absolute:
        return Reply.NO_HOMING
    if verb in (Verb.START, Verb.HOME):
        answer = check_readiness(settings, axis)
        if answer != Reply.OK:
            return answer
    if verb not in (Verb.START, Verb.HOME, Verb.FOLLOW, Verb.RESET) or not allows(axis, verb):
        return Reply.WRONG_STATE
    if verb in (Verb.HOME, Verb.FOLLOW) and not has_power(axis):
        return Reply.NOT_POWERED
    if verb == Verb.RESET:
        if is_unwell(settings, axis):
            return Reply.STILL_FAULTY
        if is_hot(settings, axis) or is_too_fast(settings, axis) or trembles(settings, axis):
            return Reply.CAUSE_LASTS
        if has_lost_its_numbers(axis, law) or still_overruns(watch, axis):
            return Reply.CAUSE_LASTS
        axis.fault = 0
    elif verb == Verb.FOLLOW:
        answer = _begin_program(command, axis, segments, tick)
        if answer != Reply.OK:
            return answer
    else:
        if is_off(axis):
            _switch_on(settings, axis)
        if verb == Verb.HOME:
            begin_homing(settings, axis)
    take(axis, verb)
    return Reply.OK


@inner_kernel
def _begin_program(command: Any, axis: Any, segments: Any, tick: int) -> Reply:
    if not 0 <= command.slot < len(segments):
        return Reply.WRONG_STATE
    if not axis.homed:
        return Reply.NOT_HOMED
    if 0 < command.tick < tick:
        return Reply.LATE
    first = segments[command.slot][0].c[0]
    if abs(first - axis.reference_m) > AT_START_M:
        return Reply.NOT_AT_START
    axis.slot, axis.start_tick = command.slot, max(command.tick, tick)
    axis.segment, axis.segment_time_s = 0, 0.0
    axis.program = command.program
    return Reply.OK


@inner_kernel
def _switch_on(settings: Any, axis: Any) -> None:
    """Prepare an axis for its first tick with power: it will hold where it is."""
    axis.fresh, axis.excitation_ticks = 1, 0
    axis.error_count, axis.fast_count, axis.saturated_ticks = 0, 0, 0
    hold_where_it_is(axis)
    # What wrong counts made of the speed while it was off is nothing to expect samples by.
    fastest = settings.max_velocity_m_s
    axis.drift_m_s = min(max(axis.velocity_m_s, -fastest), fastest)
    begin_watching(axis)
    set_soft_limits(settings, axis)
