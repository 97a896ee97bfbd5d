"""`motorctl bench diagnosis`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from motorctl_benchmarks.command_options import (
    AsJson,
    EachCase,
    HeldOutSeed,
    Reliability,
    SizeChoice,
    Workers,
    given,
)


def diagnosis(
    cases: Annotated[
        int | None, typer.Option(min=1, help="So many cases in each group, instead of a size.")
    ] = None,
    size: Annotated[
        SizeChoice | None,
        typer.Option(help="Small (a quarter of an hour on two CPUs; default), or full."),
    ] = None,
    seed: HeldOutSeed = None,
    workers: Workers = None,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="GROUP:SEED", help="This case alone; may be repeated."),
    ] = None,
    out: EachCase = None,
    logs: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Keep the cases' logs here.")
    ] = None,
    plot: Reliability = None,
    as_json: AsJson = False,
) -> None:
    """Diagnose simulated machines with known causes, beside PySINDy and SysIdentPy if installed.

    It is a blind campaign. What was wrong is listed with the key that runs it again.

    Example: motorctl bench diagnosis --only one:50003 --logs logs
    """
    from motorctl.errors import UsageError
    from motorctl_benchmarks.diagnosis.campaign import CampaignOptions
    from motorctl_benchmarks.diagnosis.findings import diagnosis_findings
    from motorctl_benchmarks.diagnosis.groups import parse_key
    from motorctl_benchmarks.print_result import measure_and_print

    if cases is not None and size is not None:
        raise UsageError(f"--cases {cases} and --size {size}: only one of the two")
    if only and (cases is not None or size is not None or seed is not None):
        raise UsageError("--only names the cases: --cases, --size and --seed say nothing then")
    options = CampaignOptions(
        cases=cases,
        workers=workers,
        out=out,
        logs=logs,
        plot=plot,
        only=tuple(parse_key(key) for key in only or ()),
        **given(first_seed=seed, size=None if size is None else size.value),
    )
    measure_and_print("diagnosis", partial(diagnosis_findings, options=options), as_json=as_json)
