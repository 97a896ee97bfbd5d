"""`motorctl bench fleet`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from motorctl_benchmarks.command_options import AsJson, EachCase, Seed, Workers, given


def fleet(
    machines: Annotated[int | None, typer.Option(min=1, help="Default 12; fifty in full.")] = None,
    days: Annotated[int | None, typer.Option(min=1, help="Default 20; sixty in full.")] = None,
    logs_a_day: Annotated[
        int | None, typer.Option(min=1, max=24, help="Logs of each machine a day; default 3.")
    ] = None,
    seed: Seed = None,
    workers: Workers = None,
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PART",
            help="nights, disturbances, scaling; default nights. May be repeated.",
        ),
    ] = None,
    out: EachCase = None,
    logs: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Keep truth and findings here.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Let simulated machines change over weeks, and hold what `motorctl fleet` tells to the truth.

    Each night their logs are given to `fleet diagnose` and `fleet changes`. Parts of its own:
    disturbances (workers and schedulers killed, a store that refuses: the findings have to be the
    same) and scaling. --machines 50 --days 60 takes half an hour or more on two quiet CPUs.
    """
    from motorctl.extras import require

    require("motorctl bench fleet", "fleet", "distributed", "fsspec", "ruptures")
    from motorctl_benchmarks.fleet.findings import FleetOptions, fleet_findings
    from motorctl_benchmarks.print_result import measure_and_print

    options = FleetOptions(
        workers=workers,
        out=out,
        folder=logs,
        only=tuple(only or ()),
        **given(machines=machines, days=days, logs_a_day=logs_a_day, seed=seed),
    )
    measure_and_print("fleet", partial(fleet_findings, options=options), as_json=as_json)
