"""`motorctl bench campaign`."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from motorctl_benchmarks.command_options import (
    AsJson,
    EachCase,
    Seed,
    SizeChoice,
    Workers,
    given,
)


def campaign(
    size: Annotated[
        SizeChoice | None,
        typer.Option(help="Small (some minutes; default), or full (three quarters of an hour)."),
    ] = None,
    seed: Seed = None,
    workers: Workers = None,
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="CASE",
            help="This case alone, by the key that it is listed with; or a whole bus as in "
            "bus:can-udp, or a machine. May be repeated.",
        ),
    ] = None,
    out: EachCase = None,
    as_json: AsJson = False,
) -> None:
    """Raise faults to order in every state, on several machines and buses, and judge the guards.

    Each case is held against what the guards promise; hours of motion without a fault come besides.
    The exit status is 1 where something is not as promised.

    Example: motorctl bench campaign --only gantry:C2:cruise:encoder_stuck:default:1

    Example: motorctl bench campaign --only dual
    """
    from motorctl.errors import UsageError
    from motorctl_benchmarks.print_result import measure_and_print
    from motorctl_benchmarks.safety.findings import SafetyOptions, parse_tasks, safety_findings

    if only and (size is not None or seed is not None):
        raise UsageError("--only names the cases: --size and --seed say nothing then")
    options = SafetyOptions(
        workers=workers,
        out=out,
        only=tuple(task for key in only or () for task in parse_tasks(key)),
        **given(seed=seed, size=None if size is None else size.value),
    )
    measure_and_print("campaign", partial(safety_findings, options=options), as_json=as_json)
