"""`motorctl bench closing`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from motorctl_benchmarks.command_options import AsJson, Seed, SizeChoice, given


def closing(
    size: Annotated[
        SizeChoice | None,
        typer.Option(help="Small (one hidden effect behind each bus; default), or full (five)."),
    ] = None,
    seed: Seed = None,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="BUS", help="The bus of this name alone; may be repeated."),
    ] = None,
    logs: Annotated[Path | None, typer.Option(metavar="DIR", help="Keep the logs here.")] = None,
    as_json: AsJson = False,
) -> None:
    """Run `close-loop` with nobody there, through a daemon and a bus, on hidden effects.

    Beside the same machine in virtual time: what is left of the errors, motions, minutes and
    questions.
    """
    from motorctl_benchmarks.closing.findings import ClosingOptions, closing_findings
    from motorctl_benchmarks.print_result import measure_and_print

    options = ClosingOptions(
        only=tuple(only or ()),
        logs=logs,
        **given(seed=seed, size=None if size is None else size.value),
    )
    measure_and_print("closing", partial(closing_findings, options=options), as_json=as_json)
