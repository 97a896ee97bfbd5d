"""Guards of the computer: a silent supervisor, too many overruns, a loop that stood still."""

from __future__ import annotations

from typing import Any

import numpy as np

from motorctl.kernels import inner_kernel
from motorctl.log.sample import FaultCause
from motorctl.loop.fences import load_acquire
from motorctl.loop.guards.reactions import ramp_on_stall, react_to_others, trip_on_stall

PAUSE_PARTS = 5
"""One pause of the loop counts for at most this part of the silence that the supervisor may keep: a
frozen computer is then told as one, and a supervisor that lives has time for its next sign. Fewer
tell a pause as a silent supervisor, more keep a loop that often pauses waiting for a dead one.
Chosen by hand."""
WATCH = np.dtype(
    [
        ("silent_limit", "i8"),  # ticks without a beat; 0: there is no supervisor
        ("last_beat", "i8"),
        ("silent_ticks", "i8"),
        ("bucket_size", "i8"),  # overruns that fill the bucket; 0: only count them
        ("bucket", "i8"),
        ("orphaned", "i8"),
        ("shutdown", "i8"),
    ],
    align=True,
)


@inner_kernel
def supervise(
    watch: Any, status: Any, settings: Any, axes: Any, elapsed: int, overran: bool, t: float
) -> None:
    """Stop all axes where the supervisor is silent or the bucket of overruns is full.

    The bucket leaks: an overrun, and each period that was skipped, adds one, a good tick takes
    one out. Once it is full it stops what is led, for as long as it stays so.
    """
    if watch.silent_limit:
        beat = load_acquire(status, "beat")
        if beat != watch.last_beat:
            watch.last_beat, watch.silent_ticks = beat, 0
        else:
            # While the loop stood still, the supervisor may have as well: a frozen computer.
            watch.silent_ticks += min(elapsed, max(watch.silent_limit // PAUSE_PARTS, 1))
        if watch.silent_ticks > watch.silent_limit and not watch.orphaned:
            watch.orphaned = 1
            watch.shutdown = 1
            for i in range(axes.size):
                silent_s = watch.silent_ticks * settings[i].tick_s
                limit_s = watch.silent_limit * settings[i].tick_s
                cause = FaultCause.SUPERVISOR_LOST
                react_to_others(settings[i], axes[i], cause, silent_s, limit_s, t)
    skipped = elapsed - 1
    if overran:
        status.overruns += 1
    status.skipped_periods += skipped
    if watch.bucket_size:
        if overran or skipped:
            watch.bucket = min(watch.bucket + max(skipped, 1), watch.bucket_size)
        elif watch.bucket > 0:
            watch.bucket -= 1
        if watch.bucket >= watch.bucket_size:
            size = float(watch.bucket_size)
            for i in range(axes.size):
                # A pause that is too long for an axis is its own cause: `check_pause`.
                if elapsed // settings[i].divisor - 1 <= settings[i].frozen_ticks:
                    react_to_others(settings[i], axes[i], FaultCause.OVERRUN, 0.0, size, t)


@inner_kernel
def still_overruns(watch: Any, axis: Any) -> bool:
    """Return whether overruns that tripped an axis are still in their bucket."""
    return axis.fault == FaultCause.OVERRUN and watch.bucket > 0  # type: ignore[no-any-return]


@inner_kernel
def stalled_periods(settings: Any, elapsed: int, behind: int) -> int:
    """Return how many of the axis' periods the loop was stalled for, up to the end of the read.

    elapsed counts the axis' periods since its last tick, behind the loop's by which the read ended
    too late.
    """
    return elapsed - 1 + behind // settings.divisor  # type: ignore[no-any-return]


@inner_kernel
def note_pause(settings: Any, axis: Any, elapsed: int, behind: int) -> None:
    """Keep a pause that the device may not have stood, until the device is heard to be well.

    What it reports until then, or that it is silent, comes of the pause.
    """
    stalled = stalled_periods(settings, elapsed, behind)
    if stalled > settings.patience_ticks:
        axis.stalled_ticks = max(axis.stalled_ticks, stalled)


@inner_kernel
def forget_stall(axis: Any, elapsed: int, behind: int) -> None:
    """Note that the device is well, in a tick that the sample cannot be older than the pause."""
    if elapsed == 1 and behind == 0:
        axis.stalled_ticks = 0


@inner_kernel
def check_pause(settings: Any, axis: Any, elapsed: int, t: float) -> bool:
    """Trip where the axis has had no tick for too long: whatever else is wrong comes of that.

    Return whether it did: an axis that is being stopped for a fault goes on with that.
    """
    skipped, before = elapsed - 1, axis.state
    if skipped > settings.frozen_ticks:
        if settings.quick_stops >> FaultCause.HOST_FROZEN & 1:
            ramp_on_stall(axis, float(skipped), float(settings.frozen_ticks), settings.frozen_by, t)
        else:
            trip_on_stall(axis, float(skipped), float(settings.frozen_ticks), settings.frozen_by, t)
    return axis.state != before  # type: ignore[no-any-return]
