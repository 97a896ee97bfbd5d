"""A subject that was measured: what was found, and the computer that it was found on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from motorctl.latency.figure import missed
from motorctl.latency.host import host_facts
from motorctl.latency.progress import Progress
from motorctl_benchmarks.findings import Findings


@dataclass(frozen=True)
class Result:
    """What was found of one subject, and the computer that it was measured on."""

    subject: str
    host: dict[str, Any]
    found: Findings

    @property
    def missed(self) -> list[str]:
        """Which targets are not met, a plain sentence each."""
        return missed(self.found.figures)

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        found = self.found
        return {
            "subject": self.subject,
            "host": self.host,
            "figures": [figure.document() for figure in found.figures],
            "missed": self.missed,
            "notes": list(found.notes),
            "mistakes": [dict(row) for row in found.mistakes],
            **({"head": found.head} if found.head else {}),
            **found.data,
        }


def measure(subject: str, find: Callable[[Progress], Findings], progress: Progress) -> Result:
    """Measure a subject.

    Parameters
    ----------
    subject
        Its name.
    find
        Measures it.
    progress
        Called with the share done, 0 to 1.
    """
    host = host_facts()
    return Result(subject, host, find(progress))
