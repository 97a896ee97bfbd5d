"""Options that several subjects of `motorctl bench` have."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")]
Seed = Annotated[int | None, typer.Option(min=0, help="Of what is drawn at random; default 1.")]
HeldOutSeed = Annotated[
    int | None, typer.Option(min=0, help="The first seed; by default held-out ones.")
]
Workers = Annotated[int | None, typer.Option(min=1, help="Processes; by default one a CPU.")]
EachCase = Annotated[
    Path | None, typer.Option("--out", metavar="FILE", help="Every case as a line of JSON.")
]
Reliability = Annotated[
    Path | None,
    typer.Option(
        "--plot",
        metavar="FILE",
        help="Draw how often names were right over their confidence.",
    ),
]


class SizeChoice(StrEnum):
    """How many cases a campaign has."""

    SMALL = "small"
    FULL = "full"


def given(**options: Any) -> dict[str, Any]:
    """Return the options that were given: what was not is left to the subject's own default."""
    return {name: value for name, value in options.items() if value is not None}
