"""What an installation or a removal did, told to whoever asked for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Done:
    """One thing that was done, or would be in a dry run."""

    what: str
    """`written`, `updated`, `unchanged`, `removed`, `kept` or `run`."""
    target: str
    """A path, or a command."""
    why: str = ""


@dataclass
class Outcome:
    """What was done to a system, in order, and what is left to a person."""

    name: str
    root: Path
    dry_run: bool
    done: list[Done] = field(default_factory=list)
    next: list[str] = field(default_factory=list)

    @property
    def unit(self) -> str:
        """The name by which systemd knows the gantry."""
        return unit_of(self.name)

    def tell(self, what: str, target: Path | str, why: str = "") -> None:
        """Note one thing."""
        self.done.append(Done(what, str(target), why))

    def document(self) -> dict[str, Any]:
        """Return it as plain data, for ``--json``."""
        return {
            "name": self.name,
            "unit": self.unit,
            "root": str(self.root),
            "dry_run": self.dry_run,
            "done": [asdict(one) for one in self.done],
            "next": self.next,
        }

    def lines(self) -> Sequence[str]:
        """Return it in words."""
        told = ["dry run: nothing was changed"] if self.dry_run else []
        told += [
            f"{one.what:<9} {one.target}" + (f"  ({one.why})" if one.why else "")
            for one in self.done
        ]
        if self.next:
            told += ["", "next:", *(f"  {line}" for line in self.next)]
        return told


def unit_of(name: str) -> str:
    """Return the unit of a gantry."""
    return f"motorctl@{name}.service"
