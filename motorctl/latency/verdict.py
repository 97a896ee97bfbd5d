"""LinuxCNC's published thresholds for the worst latency, as a plain sentence."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Verdict:
    """What the worst lateness means."""

    grade: str
    sentence: str


_GRADES = (
    (20.0, "very good", "below 20 us"),
    (50.0, "good", "20 to 50 us"),
    (500.0, "only with a hardware card", "50 to 500 us: leave fast pulses to hardware"),
)


def judge(max_us: float) -> Verdict:
    """Judge the worst lateness [us] by the thresholds of LinuxCNC's documentation."""
    for limit, grade, meaning in _GRADES:
        if max_us < limit:
            return Verdict(grade, f"{grade}: worst lateness {max_us:.1f} us ({meaning})")
    return Verdict("unacceptable", f"unacceptable: worst lateness {max_us:.1f} us, above 500 us")
