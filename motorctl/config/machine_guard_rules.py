"""Guards of the whole machine that could never trip: late ticks, pauses, devices, partners.

And what is written beside them where nothing listens to it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from motorctl.config.guard_keys import STALLED_S, Guards
from motorctl.config.keys import LateSamples, LoopSettings
from motorctl.config.validation import Finding, read_keys
from motorctl.errors import Problem
from motorctl.located_yaml import Document

LONGEST_WITHOUT_SAMPLE_S = 2.0
"""That an axis may be led without a new sample [s]. Longer is no guard: whoever watches has stopped
the machine by hand; shorter forbids what emulated machines need. Chosen by hand."""
WHOLE = 1e-9
"""How far a number of ticks may be above a whole one because periods have no end as decimals. Any
other would do that is small beside 1. Chosen by hand."""


def check_machine_guards(
    document: Document, rate_hz: float | None, divisors: Mapping[str, int]
) -> list[Problem]:
    """Check the guards that are configured beside the axes, and what an axis says of them.

    Parameters
    ----------
    document
        The configuration.
    rate_hz
        Of the loop, None where it cannot be read [Hz].
    divisors
        Ticks of the loop in one of each driver.

    Returns
    -------
    list of Problem
        Of guards that could never trip.
    """
    findings = [*_late_and_frozen(document, rate_hz), *_partners(document)]
    if rate_hz is not None:
        for driver, divisor in divisors.items():
            findings += _without_sample(document, driver, divisor / rate_hz)
    return [document.problem(where, message) for where, message in findings]


def _late_and_frozen(document: Document, rate_hz: float | None) -> Iterator[Finding]:
    loop = read_keys(LoopSettings, document.part(("loop",)))
    if loop is None:
        return
    if loop.waits:
        for name in document.part(("axes",)):
            if _is_chosen(document, name, "host_frozen"):
                yield (
                    ("axes", name, "guards", "host_frozen"),
                    "can never trip: loop.without_realtime is wait, so the machine's time stands "
                    "still while the computer does; should be degrade or refuse, or the guard be "
                    "removed here",
                )
    if loop.overrun_policy == "count":
        for name in document.part(("axes",)):
            if _is_chosen(document, name, "late_ticks"):
                yield (
                    ("axes", name, "guards", "late_ticks"),
                    "can never trip: loop.overrun_policy is count; should be leaky_bucket or stop, "
                    "or the guard be removed here",
                )
    default: int = LoopSettings.model_fields["bucket_size"].default
    if loop.overrun_policy != "leaky_bucket":
        if loop.bucket_size != default:  # a log says what was not written, too
            yield (
                ("loop", "bucket_size"),
                f"found {loop.bucket_size}, does nothing: loop.overrun_policy is "
                f"{loop.overrun_policy}, which has no bucket; should be leaky_bucket, or "
                "bucket_size be removed",
            )
        return
    if rate_hz is None:
        return
    most = max(math.floor(rate_hz * STALLED_S), default)
    if loop.bucket_size > most:
        yield (
            ("loop", "bucket_size"),
            f"found {loop.bucket_size}, guards.late_ticks can hardly ever trip: nothing but "
            f"overruns for {loop.bucket_size / rate_hz:.3g} s at {rate_hz:g} Hz would fill the "
            f"bucket; should be at most {most}",
        )


def _partners(document: Document) -> Iterator[Finding]:
    axes, groups = document.part(("axes",)), document.at(("stop_together",))
    if groups is None and len(axes) == 1:
        (only,) = axes
        if _is_chosen(document, only, "partner"):
            yield (
                ("axes", only, "guards", "partner"),
                f"can never trip: '{only}' is the machine's one axis, no other stops together with "
                "it; remove the guard here",
            )
    if not isinstance(groups, list):
        return
    named = [axis for group in groups if isinstance(group, list) for axis in group]
    for name in axes:
        if name not in named and _is_chosen(document, name, "partner"):
            yield (
                ("axes", name, "guards", "partner"),
                f"can never trip: stop_together names no group with axis '{name}'; add it to one, "
                "or remove the guard here",
            )


def _without_sample(document: Document, driver: str, period_s: float) -> Iterator[Finding]:
    late = read_keys(LateSamples, document.part(("drivers", driver, "late")))
    if late is None or late.hold_ticks * period_s <= LONGEST_WITHOUT_SAMPLE_S + WHOLE:
        return
    yield (
        ("drivers", driver, "late", "hold_ticks"),
        f"found {late.hold_ticks}, guards.no_new_sample can hardly ever trip: axes would be led "
        f"for {late.hold_ticks * period_s:g} s without a sample; should be at most "
        f"{math.floor(LONGEST_WITHOUT_SAMPLE_S / period_s + WHOLE)}, "
        f"{LONGEST_WITHOUT_SAMPLE_S:g} s",
    )


def _is_chosen(document: Document, axis: str, guard: str) -> bool:
    """Return whether an axis asks of a guard what it would not do unasked.

    What a log holds says everything that was not written, too.
    """
    guards = read_keys(Guards, document.part(("axes", axis, "guards")))
    return guards is not None and getattr(guards, guard) != getattr(Guards(), guard)
