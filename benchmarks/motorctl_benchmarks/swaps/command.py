"""`motorctl bench swaps`."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from motorctl_benchmarks.command_options import AsJson, Seed, given


def swaps(
    cases: Annotated[
        int | None,
        typer.Option(min=1, help="Changes of models; default 200. A quarter as many kills."),
    ] = None,
    seed: Seed = None,
    as_json: AsJson = False,
) -> None:
    """Change models while an axis holds, and kill the daemon's processes around such a change.

    Told are bumps, faults, lost rows, and models that are not whole; the exit status is 1 where
    there was one.
    """
    from motorctl_benchmarks.print_result import measure_and_print
    from motorctl_benchmarks.swaps.findings import SwapsOptions, swaps_findings

    options = SwapsOptions(**given(swaps=cases, seed=seed))
    measure_and_print("swaps", partial(swaps_findings, options=options), as_json=as_json)
