"""What can be measured: subjects, each of which gives figures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from motorctl.bench.figure import Figure, missed
from motorctl.bench.host import host_facts
from motorctl.bench.interleave import Progress, part_of
from motorctl.bench.law_figures import law_figures
from motorctl.bench.tick_figures import tick_figures
from motorctl.bench.virtual_figures import virtual_figures
from motorctl.errors import UsageError

Measure = Callable[[Progress], tuple[list[Figure], list[str]]]

SUBJECTS: dict[str, tuple[Measure, ...]] = {"speed": (law_figures, tick_figures, virtual_figures)}
"""Each subject's parts, measured one after the other."""


@dataclass(frozen=True)
class Result:
    """The figures of one subject, and the machine that they were measured on."""

    subject: str
    host: dict[str, Any]
    figures: tuple[Figure, ...]
    notes: tuple[str, ...]

    @property
    def missed(self) -> list[str]:
        """Which targets are not met, a plain sentence each."""
        return missed(self.figures)

    def document(self) -> dict[str, Any]:
        """Give it as plain data."""
        return {
            "subject": self.subject,
            "host": self.host,
            "figures": [figure.document() for figure in self.figures],
            "missed": self.missed,
            "notes": list(self.notes),
        }


def measure(subject: str, progress: Progress) -> Result:
    """Measure a subject. Raises UsageError, naming those there are, for an unknown one."""
    if subject not in SUBJECTS:
        raise UsageError(f"there is no bench '{subject}'; there are: {', '.join(SUBJECTS)}")
    parts = SUBJECTS[subject]
    host = host_facts()
    figures: list[Figure] = []
    notes: list[str] = []
    for k, part in enumerate(parts):
        more, remarks = part(part_of(progress, k / len(parts), (k + 1) / len(parts)))
        figures += more
        notes += remarks
    return Result(subject, host, tuple(figures), tuple(notes))
