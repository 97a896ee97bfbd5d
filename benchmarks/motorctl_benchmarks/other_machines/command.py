"""`motorctl bench machines`."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from motorctl_benchmarks.command_options import (
    AsJson,
    EachCase,
    HeldOutSeed,
    Reliability,
    Workers,
    given,
)


def machines(
    cases: Annotated[
        int | None, typer.Option(min=1, help="So many seeds of each kind; default 1.")
    ] = None,
    clean: Annotated[
        int | None,
        typer.Option(
            min=1, help="So many clean ones alone, each form of friction with each noise."
        ),
    ] = None,
    seed: HeldOutSeed = None,
    workers: Workers = None,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="GENERATOR:KIND:SEED", help="This case alone; may be repeated."),
    ] = None,
    out: EachCase = None,
    plot: Reliability = None,
    as_json: AsJson = False,
) -> None:
    """Diagnose machines of three generators that were written apart; one needs MuJoCo.

    They share no code with motorctl: whether it is right on machines that its authors did not make.

    Example: motorctl bench machines --only energy:cogging:50000

    Example: motorctl bench machines --clean 200
    """
    from motorctl.errors import UsageError
    from motorctl_benchmarks.other_machines.findings import MachinesOptions, machine_findings
    from motorctl_benchmarks.other_machines.generators import parse_machine_key
    from motorctl_benchmarks.print_result import measure_and_print

    if only and (cases is not None or seed is not None or clean is not None):
        raise UsageError("--only names the cases: --cases, --clean and --seed say nothing then")
    if cases is not None and clean is not None:
        raise UsageError(f"--cases {cases} and --clean {clean}: only one of the two")
    options = MachinesOptions(
        workers=workers,
        out=out,
        plot=plot,
        clean=clean,
        only=tuple(parse_machine_key(key) for key in only or ()),
        **given(cases=cases, first_seed=seed),
    )
    measure_and_print("machines", partial(machine_findings, options=options), as_json=as_json)
