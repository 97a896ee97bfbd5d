"""`motorctl bench tuning`."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from motorctl_benchmarks.command_options import AsJson, EachCase, HeldOutSeed, Workers, given


def tuning(
    cases: Annotated[
        int | None, typer.Option(min=1, help="Plants that are drawn; default 20.")
    ] = None,
    seed: HeldOutSeed = None,
    workers: Workers = None,
    out: EachCase = None,
    as_json: AsJson = False,
) -> None:
    """Run gains that `tune` chooses beside a grid of gains, every one of which is run.

    For the shipped gantry, and for plants that are drawn: tuned to a measured response, and to a
    log of the program alone.
    """
    from motorctl_benchmarks.print_result import measure_and_print
    from motorctl_benchmarks.tuning.findings import TuningOptions, tuning_findings

    options = TuningOptions(workers=workers, out=out, **given(plants=cases, first_seed=seed))
    measure_and_print("tuning", partial(tuning_findings, options=options), as_json=as_json)
