"""`motorctl bench experiments`."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from motorctl_benchmarks.command_options import AsJson, EachCase, HeldOutSeed, Workers, given


def experiments(
    cases: Annotated[
        int | None, typer.Option(min=1, help="Plants that are drawn; default 60.")
    ] = None,
    seed: HeldOutSeed = None,
    workers: Workers = None,
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND", help="A kind of plants, as in 'lag or delay'; may be repeated."
        ),
    ] = None,
    out: EachCase = None,
    as_json: AsJson = False,
) -> None:
    """Compare motion time until nothing is open: the rich motion, and motions chosen one by one.

    The plants that are drawn have look-alikes.
    """
    from motorctl_benchmarks.experiments.findings import ExperimentsOptions, experiments_findings
    from motorctl_benchmarks.print_result import measure_and_print

    kinds = None if only is None else tuple(only)
    options = ExperimentsOptions(
        workers=workers, out=out, **given(plants=cases, first_seed=seed, families=kinds)
    )
    measure_and_print(
        "experiments", partial(experiments_findings, options=options), as_json=as_json
    )
