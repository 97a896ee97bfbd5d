"""Publish a row of the ring once its tick is over."""

from numba import njit

from motorctl.loop.fences import fence_release, store_release

NS = 1e-9


@njit(cache=True)
def publish(  # type: ignore[no-untyped-def]
    status, ticks, measured, row, written, number, period_s, virtual, scheduled, woke, t1, t2, t3
) -> None:
    """Finish the row and announce it; in virtual time no time passes within a tick."""
    record = ticks[row]
    record.tick = number
    record.time_s = number * period_s
    times = measured[row]
    times[0], times[1] = (t3 - woke) * NS, (t1 - woke) * NS
    times[2], times[3] = (t2 - t1) * NS, (t3 - t2) * NS
    record.lateness_s = 0.0 if virtual else (woke - scheduled) * NS
    record.turnaround_s = 0.0 if virtual else times[0]
    record.read_s = 0.0 if virtual else times[1]
    record.compute_s = 0.0 if virtual else times[2]
    record.write_s = 0.0 if virtual else times[3]
    status[0].tick = number
    status[0].time_s = number * period_s
    store_release(status[0], "ring_head", written)
    # Answers come after the status in which they show.
    store_release(status[0], "mail_tail", status[0].mail_taken)
    # The next tick overwrites the oldest row: whoever sees any of that sees this head, too.
    fence_release()
