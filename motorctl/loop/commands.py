"""Commands from the mailbox: what each asks besides the table of states, and what it begins."""

from __future__ import annotations

from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.loop.fences import load_acquire
from motorctl.loop.guards.command import is_hot
from motorctl.loop.guards.encoder import begin_watching
from motorctl.loop.guards.motion import is_too_fast, set_soft_limits
from motorctl.loop.guards.reactions import emergency_stop, stop
from motorctl.loop.guards.readiness import check_readiness, has_power, is_unwell
from motorctl.loop.homing import begin_homing
from motorctl.loop.reference import hold_where_it_is
from motorctl.loop.shared import MAILBOX_SIZE
from motorctl.loop.states import allows, is_off, take
from motorctl.loop.vocabulary import Reply, Verb

START = int(Verb.START)
STOP = int(Verb.STOP)
HOME = int(Verb.HOME)
FOLLOW = int(Verb.FOLLOW)
RESET = int(Verb.RESET)
ESTOP = int(Verb.ESTOP)
SHUTDOWN = int(Verb.SHUTDOWN)

BEGINNINGS = (START, HOME, FOLLOW)

OK = int(Reply.OK)
WRONG_STATE = int(Reply.WRONG_STATE)
NOT_HOMED = int(Reply.NOT_HOMED)
NOT_AT_START = int(Reply.NOT_AT_START)
STILL_FAULTY = int(Reply.STILL_FAULTY)
NOT_POWERED = int(Reply.NOT_POWERED)
NO_HOMING = int(Reply.NO_HOMING)
LATE = int(Reply.LATE)
CAUSE_LASTS = int(Reply.CAUSE_LASTS)

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
    segments: Any,
    tick: int,
    t: float,
) -> None:
    """Take the commands that came. Once the loop shuts down, none begins any motion.

    The replies are announced when the tick is published.
    """
    first, last = status[0].mail_taken, load_acquire(status[0], "mail_head")
    for number in range(first, last):
        command = mailbox[number % MAILBOX_SIZE]
        if command.verb == SHUTDOWN:
            watch.shutdown = 1
            for i in range(axes.size):
                stop(axes[i])
            answer = OK
        elif command.verb == ESTOP:
            for i in range(axes.size):
                emergency_stop(axes[i], t)
            answer = OK
        elif not 0 <= command.axis < axes.size or (watch.shutdown and command.verb in BEGINNINGS):
            answer = WRONG_STATE
        else:
            i = command.axis
            answer = _obey(command, settings[i], axes[i], segments[i], tick, t)
        replies[number % MAILBOX_SIZE] = answer
    status[0].mail_taken = last


@inner_kernel
def _obey(command: Any, settings: Any, axis: Any, segments: Any, tick: int, t: float) -> int:
    """Carry out what the table of states allows, and answer.

    A verb has the number of its event in the table.
    """
    verb = command.verb
    if verb == STOP:
        return OK if stop(axis) else WRONG_STATE
    if verb == HOME and settings.absolute:
        return NO_HOMING
    if verb in (START, HOME):
        answer = check_readiness(settings, axis)
        if answer != OK:
            return answer
    if verb not in (START, HOME, FOLLOW, RESET) or not allows(axis, verb):
        return WRONG_STATE
    if verb in (HOME, FOLLOW) and not has_power(axis):
        return NOT_POWERED
    if verb == RESET:
        if is_unwell(settings, axis):
            return STILL_FAULTY
        if is_hot(settings, axis) or is_too_fast(settings, axis):
            return CAUSE_LASTS
        axis.fault = 0
    elif verb == FOLLOW:
        answer = _begin_program(command, axis, segments, tick)
        if answer != OK:
            return answer
    else:
        if is_off(axis):
            _switch_on(settings, axis)
        if verb == HOME:
            begin_homing(settings, axis)
    take(axis, verb)
    return OK


@inner_kernel
def _begin_program(command: Any, axis: Any, segments: Any, tick: int) -> int:
    if not 0 <= command.slot < len(segments):
        return WRONG_STATE
    if not axis.homed:
        return NOT_HOMED
    if 0 < command.tick < tick:
        return LATE
    first = segments[command.slot][0].c[0]
    if abs(first - axis.reference_m) > AT_START_M:
        return NOT_AT_START
    axis.slot, axis.start_tick = command.slot, max(command.tick, tick)
    axis.segment, axis.segment_time_s = 0, 0.0
    axis.program = command.program
    return OK


@inner_kernel
def _switch_on(settings: Any, axis: Any) -> None:
    """Prepare an axis for its first tick with power: it will hold where it is."""
    axis.fresh = 1
    axis.error_count, axis.fast_count, axis.saturated_ticks = 0, 0, 0
    hold_where_it_is(axis)
    # What wrong counts made of the speed while it was off is nothing to expect samples by.
    fastest = settings.max_velocity_m_s
    axis.drift_m_s = min(max(axis.velocity_m_s, -fastest), fastest)
    begin_watching(axis)
    set_soft_limits(settings, axis)
