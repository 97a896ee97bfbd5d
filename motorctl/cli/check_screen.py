"""A checked machine on one screen: what it is, its limits, the margins of its loops."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from motorctl.axis_units import units_of
from motorctl.cli.check_tables import print_notes, print_verdict
from motorctl.cli.check_words import (
    Part,
    following_error_words,
    inverse,
    late_words,
    limit_words,
    number,
    wiring_words,
)
from motorctl.config.loop_cases import MarginsAt

MORE = "--all: parameters, gains, guards, conditions, logs   --out DIR: Bode plots"


def print_screen(console: Console, summary: Part) -> None:
    """Print in brief what `motorctl.config.summarise` gives."""
    print_verdict(console, summary)
    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for name, driver in summary["drivers"].items():
        table.add_row(escape(name), escape(_driver(driver)))
    for name, axis in summary["axes"].items():
        for label, line in zip((name, *[""] * 4), _axis(axis), strict=True):
            table.add_row(escape(label), units_of(axis["kind"]).words(line))
    if summary["programs"]:
        told = (_program(name, program) for name, program in summary["programs"].items())
        table.add_row("programs", escape("; ".join(told)))
    console.print(table, highlight=False)
    print_notes(console, summary)
    console.print(MORE, style="dim", highlight=False)


def _driver(driver: Part) -> str:
    most, used = driver["max_rate_hz"], driver["used"]
    budget = "" if most is None or used is None else f" of {number(most, 4)} ({100 * used:.0f} %)"
    delay = f", {number(driver['delay_s'] * 1e3)} ms of delay" if driver["delay_s"] else ""
    return (
        f"{driver['type']}, axes {', '.join(driver['axes'])}, {number(driver['rate_hz'])}"
        f"{budget} Hz{delay}, no sample: {late_words(driver['late'])}"
    )


def _axis(axis: Part) -> Iterator[str]:
    limits, resolution_m = axis["limits"], axis["encoder"]["resolution_m"]
    follows = f"follows {axis['program']}" if axis["program"] else "holds"
    rotary = "rotary, " if axis["kind"] == "rotary" else ""
    yield escape(
        f"{rotary}{wiring_words(axis)}, {number(resolution_m * 1e6)} um a count, "
        f"homing {axis['homing']['method']}, {follows}"
    )
    yield limit_words(limits)
    yield f"trips at a following error of {following_error_words(limits['following_error'])}"
    yield escape(" ".join(axis["effects"]))
    yield _margins([MarginsAt(**row) for row in axis["margins"]])


def _margins(rows: list[MarginsAt]) -> str:
    """Return the least margins of all rows: over the inertia's bounds, up to a period late."""
    if not all(row.stable for row in rows):
        return "[bold red]unstable[/bold red] within the bounds of its inertia: see the notes"
    phase = min((r.phase_margin_deg for r in rows if r.phase_margin_deg is not None), default=None)
    more = min((r.gain_margin for r in rows if r.gain_margin), default=None)
    less = min((x for r in rows if (x := inverse(r.gain_reduction))), default=None)
    return f"margins over its bounds {number(phase, 3)} deg, {_db(more)} up, {_db(less)} down"


def _db(ratio: float | None) -> str:
    return "no limit" if ratio is None else f"{20.0 * math.log10(ratio):.1f} dB"


def _program(name: str, program: Part) -> str:
    return f"{name} on {', '.join(program['axes'])}, {number(program['duration_s'], 4)} s"
