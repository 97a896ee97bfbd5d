"""What is told of one axis of a public recording."""

from __future__ import annotations

from dataclasses import dataclass

from motorctl_benchmarks.real_machines.readers import Read


@dataclass(frozen=True)
class RealAxis:
    """One axis of a recording, and what may be said of it."""

    name: str
    read: Read
    """Returns its columns from the folder of all recordings."""
    unit: str
    may_name: tuple[str, ...] = ()
    """Effects that the machine has; none other may be named."""
    position_unit: str = "rad"
    scale: int = 1
    """Of the command; -1 where its sign is known to be the other one."""
