"""The broken drivers, each with the checks that have to fail for it."""

from __future__ import annotations

from collections.abc import Callable

from wire_driver import WireRig

from motorctl.hal import Driver

BROKEN: dict[type[Driver], set[str]] = {}


def fails(*checks: str) -> Callable[[type[Driver]], type[Driver]]:
    """Note which checks have to fail."""

    def note(cls: type[Driver]) -> type[Driver]:
        BROKEN[cls] = set(checks)
        return cls

    return note


UNOPENED = "test_safe_reaches_the_device_without_open"
ANEW = "test_it_opens_anew_in_another_thread"
ABSENT = "test_open_names_the_device_that_is_absent"
DAMAGED = "test_a_damaged_reply_never_becomes_a_count"
LOCKED = "test_opening_anew_leaves_other_threads_their_turn"
LOST = "test_a_lost_reply_is_stale"
RAISES = "test_nothing_that_happens_makes_it_raise"
REOPENED = "test_close_and_open_bring_a_vanished_device_back"
SAFE_WITHOUT = "test_safe_after_vanishing_never_raises"
SILENCE = "test_silence_is_stale_for_as_long_as_it_lasts"
TOLD = "test_a_damaged_reply_is_told_as_corrupt"
VANISHED = "test_a_vanished_device_is_communication_lost"
UNTOUCHED = "test_nothing_is_touched_before_open"
VIRTUAL = "test_virtual_time_gives_the_same_run_twice"


def rig_class(cls: type[Driver]) -> type[WireRig]:
    """Make the rig of a broken driver."""
    return type(f"{cls.__name__}Rig", (WireRig,), {"driver_class": cls})
