"""Commands from the mailbox: which state allows which, and what each one begins."""

from __future__ import annotations

from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop.fences import load_acquire
from motorctl.loop.guards.command import is_hot
from motorctl.loop.guards.device import DEVICE_FAULTS, is_overdue
from motorctl.loop.guards.encoder import begin_watching
from motorctl.loop.guards.motion import is_too_fast, set_soft_limits, still_moves
from motorctl.loop.guards.reactions import stop, trip
from motorctl.loop.homing import begin_homing
from motorctl.loop.reference import hold_where_it_is
from motorctl.loop.shared import MAILBOX_SIZE
from motorctl.loop.vocabulary import Reply, Verb

OFF = int(AxisState.OFF)
HOMING = int(AxisState.HOMING)
IDLE = int(AxisState.IDLE)
RUNNING = int(AxisState.RUNNING)
STOPPING = int(AxisState.STOPPING)
FAULT = int(AxisState.FAULT)
CAUSE_ESTOP = int(FaultCause.ESTOP)

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
NO_HOMING = int(Reply.NO_HOMING)
LATE = int(Reply.LATE)
STILL_MOVING = int(Reply.STILL_MOVING)
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
                trip(axes[i], CAUSE_ESTOP, 0.0, 0.0, t)
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
    verb = command.verb
    if verb == START:
        return _enable(settings, axis)
    if verb == STOP:
        if axis.state == FAULT:
            return WRONG_STATE
        stop(axis)
        return OK
    if verb == RESET:
        if axis.state != FAULT:
            return WRONG_STATE
        if axis.status & DEVICE_FAULTS or is_overdue(settings, axis):
            return STILL_FAULTY
        if is_hot(settings, axis) or is_too_fast(settings, axis):
            return CAUSE_LASTS
        axis.state, axis.fault = OFF, 0
        return OK
    if verb == HOME:
        if settings.absolute:
            return NO_HOMING
        if axis.state == OFF:
            answer = _enable(settings, axis)
            if answer != OK:
                return answer
        if axis.state != IDLE:
            return WRONG_STATE
        axis.state = HOMING
        begin_homing(settings, axis)
        return OK
    if verb == FOLLOW:
        if axis.state != IDLE or not 0 <= command.slot < len(segments):
            return WRONG_STATE
        if not axis.homed:
            return NOT_HOMED
        if 0 < command.tick < tick:
            return LATE
        first = segments[command.slot][0].c[0]
        if abs(first - axis.reference_m) > AT_START_M:
            return NOT_AT_START
        axis.state = RUNNING
        axis.slot, axis.start_tick = command.slot, max(command.tick, tick)
        axis.segment, axis.segment_time_s = 0, 0.0
        axis.program = command.program
        return OK
    return WRONG_STATE


@inner_kernel
def _enable(settings: Any, axis: Any) -> int:
    if axis.state != OFF:
        return WRONG_STATE
    if axis.status & DEVICE_FAULTS or is_overdue(settings, axis):
        return STILL_FAULTY
    if still_moves(settings, axis):
        return STILL_MOVING
    axis.state = IDLE
    axis.fresh = 1
    axis.error_count, axis.fast_count, axis.saturated_ticks = 0, 0, 0
    hold_where_it_is(axis)
    begin_watching(axis)
    set_soft_limits(settings, axis)
    return OK
