"""What of a long recording was read to diagnose an axis, and why that."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Stretch:
    """Rows that were read; rest between them may have been left out."""

    log: str
    """The file."""
    begin_s: float
    """Its first row's `time_s`."""
    end_s: float
    """Its last row's."""
    rows: int
    vaguest: str
    """The parameter of the declared model that its motion tells least of."""
    vagueness: float
    """What that parameter moves within its standard error, in parts of the command."""
    left_rms: float | None
    """What the declared model leaves of the command in it, with the parameters of the whole log, in
    the band of the scan; None where that was not told."""
    why: str
    """It was read."""


MOST_LEFT = "the declared model leaves most there"
CLEAREST = "its motion tells most"
NOTHING_CLEAR = "its motion tells too little"
"""Reasons to read a stretch; the last one where no other was there."""


@dataclass(frozen=True)
class ReadStretches:
    """The stretches of an axis that were read, of all that were looked at."""

    stretches: tuple[Stretch, ...]
    """In order of time."""
    rows_of_log: int
    """Of all of it."""
    candidates: int
    """Stretches whose motion tells a parameter, with those that were read."""
    unread: str | None = None
    """Where the declared model leaves much more than in any of them; None: nowhere."""

    @property
    def rows(self) -> int:
        """Which were read."""
        return sum(stretch.rows for stretch in self.stretches)

    @property
    def sentence(self) -> str:
        """Say how much was read, and why that."""
        read, all_of = len(self.stretches), self.candidates
        begin = f"Of this long log {self.rows} of {self.rows_of_log} rows were looked at: "
        enough = "with enough motion to tell the declared parameters"
        if not all_of:
            return f"{begin}no stretch of it is one {enough}; these are of those in which it moves."
        if all_of == 1:
            return f"{begin}the only stretch {enough}."
        if read == all_of:
            return f"{begin}all {all_of} stretches {enough}."
        most_left = sum(stretch.why == MOST_LEFT for stretch in self.stretches)
        reasons = []
        if most_left:
            reasons.append(f"{most_left} in which the declared model leaves most")
        if read > most_left:
            of_them = " of the others" if most_left else ""
            reasons.append(f"{read - most_left} whose motion tells most{of_them}")
        return (
            f"{begin}{read} of {all_of} stretches {enough}, {' and '.join(reasons)}. What happens "
            "only in stretches that were not looked at is not known."
        )
