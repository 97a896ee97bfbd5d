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


@dataclass(frozen=True)
class ReadStretches:
    """The stretches of an axis that tell most, of all that were looked at."""

    stretches: tuple[Stretch, ...]
    """In order of time."""
    rows_of_log: int
    """Of all of it."""
    candidates: int
    """Stretches whose motion tells a parameter, with those that were read."""

    @property
    def rows(self) -> int:
        """Which were read."""
        return sum(stretch.rows for stretch in self.stretches)

    @property
    def sentence(self) -> str:
        """Say how much was read, and why that."""
        read, all_of = len(self.stretches), self.candidates
        which = (
            "the only stretch"
            if all_of == 1
            else f"{read} of {all_of} stretches"
            if read < all_of
            else f"all {all_of} stretches"
        )
        one = "the one" if read == 1 else "those"
        why = f", {one} whose motion tells most of them" if read < all_of else ""
        return (
            f"Of this long log {self.rows} of {self.rows_of_log} rows were looked at: {which} with "
            f"enough motion to tell the declared parameters{why}."
        )
