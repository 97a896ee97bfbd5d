"""What a diagnosis answered, as far as it is scored."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from motorctl.identify.diagnose.result import AxisDiagnosis


@dataclass(frozen=True)
class Named:
    """A cause that was named."""

    name: str
    confidence: float
    indistinguishable_from: tuple[str, ...] = ()
    grounds: Mapping[str, float] = field(default_factory=dict)
    """The figures that its confidence rests on."""

    @property
    def may_be(self) -> frozenset[str]:
        """Every effect that the answer leaves possible in this place."""
        return frozenset((self.name, *self.indistinguishable_from))


@dataclass(frozen=True)
class Answer:
    """The answer to one case."""

    verdict: str
    """One of the diagnosis' verdicts; "failed" where there is none."""
    named: tuple[Named, ...] = ()
    """Most important first."""
    doubted: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """What was fitted and not named, with the same figures."""
    untestable: tuple[str, ...] = ()
    """Effects of which the answer says that this motion cannot show or tell them apart."""
    depends_on: tuple[str, ...] = ()
    """What unknown structure depends on."""
    family: str | None = None
    """The kind of physics that unknown structure is said to be."""
    explained_fraction: float = math.nan
    """Of the explainable error, on held-out rows."""
    seconds: float = math.nan
    """What the diagnosis took by the clock."""
    processor_s: float = math.nan
    """The same in processor time, on one thread."""
    failure: str = ""
    notes: tuple[str, ...] = ()
    """What is said beside the verdict."""

    @property
    def names(self) -> frozenset[str]:
        """All that was named."""
        return frozenset(named.name for named in self.named)

    def __str__(self) -> str:
        words = []
        for named in self.named:
            twins = "".join(f"|{name}" for name in named.indistinguishable_from)
            words.append(f"{named.name}{twins} ({named.confidence:.2f})")
        found = " + ".join(words) or "nothing"
        if self.failure:
            return f"failed: {self.failure}"
        return found if self.verdict == "effect" else f"{self.verdict}, named {found}"

    def document(self) -> dict[str, Any]:
        """Return it as plain data; None where there is no number."""
        plain = asdict(self)
        for key in ("explained_fraction", "seconds", "processor_s"):
            plain[key] = None if math.isnan(plain[key]) else plain[key]
        return plain


def answer_of(diagnosis: AxisDiagnosis, seconds: float, processor_s: float) -> Answer:
    """Take what is scored out of a diagnosis."""
    return Answer(
        verdict=diagnosis.verdict,
        named=tuple(
            Named(
                effect.name,
                effect.confidence,
                tuple(effect.indistinguishable_from),
                dict(effect.grounds),
            )
            for effect in diagnosis.effects
        ),
        doubted={name: dict(grounds) for name, grounds in diagnosis.doubted.items()},
        untestable=tuple(name for missing in diagnosis.missing for name in missing.effects),
        depends_on=() if diagnosis.unknown is None else diagnosis.unknown.depends_on,
        family=None if diagnosis.unknown is None else diagnosis.unknown.family,
        explained_fraction=diagnosis.error.explained_fraction,
        notes=tuple(diagnosis.notes),
        seconds=seconds,
        processor_s=processor_s,
    )


def in_one_line(error: Exception) -> str:
    """Return what went wrong as the failure of an answer."""
    return " ".join(f"{type(error).__name__}: {error}".split())
