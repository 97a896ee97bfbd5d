"""A latency measurement on a terminal."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from motorctl.latency.durations import Durations
from motorctl.latency.histogram import histogram_lines
from motorctl.latency.host import host_line
from motorctl.latency.result import Latency

US = 1e6
MOST_REFUSALS = 5


def print_latency(console: Console, latency: Latency) -> None:
    """Print verdict, figures, histograms and advice."""
    run, times, machine = latency.run, latency.times, latency.machine
    console.print(host_line(latency.host), highlight=False)
    doing = "following their programs" if latency.moving else "switched off"
    console.print(
        f"{machine.name}: axes {', '.join(machine.axes)} {doing} at {machine.rate_hz:g} Hz for "
        f"{latency.duration_s:g} s, on CPU {latency.cpu} at priority {machine.loop.priority}, "
        f"spinning the last {machine.loop.spin_s * US:g} us",
        highlight=False,
    )
    console.print(_durations(latency))
    console.print(_shares(latency))
    console.print(_histograms(latency), highlight=False, no_wrap=True, overflow="crop")
    every = "yes" if latency.every_tick else "[red]no[/red]"
    console.print(
        f"every tick in the log: {every} ({times.rows} rows, {run.rows_lost} lost; "
        f"{run.skipped_periods} periods skipped, {times.periods_missing} missing; "
        f"{run.overruns} overruns)",
        highlight=False,
    )
    for reason in run.degraded:
        console.print(f"[yellow]degraded[/yellow]  {escape(reason)}", highlight=False)
    notes = [*run.refusals[:MOST_REFUSALS], *filter(None, [latency.without_rival])]
    for note in notes:
        console.print(f"[yellow]note[/yellow]  {escape(note)}", highlight=False)
    for sentence in latency.missed:
        console.print(f"[yellow]not met[/yellow]  {sentence}", highlight=False)
    if latency.advice:
        console.print("What would help this machine (nothing of it is applied):")
        for line in latency.advice:
            console.print(f"  {escape(line)}", highlight=False)
    console.print(f"[bold]{latency.verdict.sentence}[/bold]", highlight=False)


def _durations(latency: Latency) -> Table:
    table = Table(title="timing [us]", title_justify="left", title_style="bold")
    table.add_column("")
    for heading in ("p50", "p99", "p99.9", "max", "at s"):
        table.add_column(heading, justify="right")
    rows: list[tuple[str, Durations]] = [("lateness", latency.times.lateness)]
    if latency.rival is not None:
        rows.append(("cyclictest", latency.rival.latency))
    rows += [
        (part if part == "turnaround" else f"  {part}", durations)
        for part, durations in latency.times.parts.items()
    ]
    for name, durations in rows:
        at = durations.worst_at_s
        table.add_row(
            name,
            *(f"{durations.percentile_s(p) * US:.2f}" for p in (50.0, 99.0, 99.9)),
            f"{durations.worst_s * US:.1f}",
            "" if at is None else f"{at:.3f}",
        )
    return table


def _shares(latency: Latency) -> Table:
    table = Table(title="beside others", title_justify="left", title_style="bold")
    table.add_column("")
    table.add_column("motorctl", justify="right")
    table.add_column("peer")
    table.add_column("target", justify="right")
    table.add_column("met")
    marks = {True: "[green]yes[/green]", False: "[red]no[/red]", None: ""}
    for figure in latency.figures:
        peer = figure.peer or ""
        if figure.peer_value is not None:
            peer += f": {figure.peer_value:.4g} {figure.unit}"
        target = ""
        if figure.target is not None:
            target = f"{figure.target.relation} {figure.target.limit:.4g} {figure.unit}"
        value = f"{figure.value:.4g} {figure.unit}"
        table.add_row(figure.title, value, peer, target, marks[figure.met])
    return table


def _histograms(latency: Latency) -> str:
    subjects = {"lateness": latency.times.lateness}
    if latency.rival is not None:
        subjects["cyclictest"] = latency.rival.latency
    lines = [*histogram_lines(subjects), ""]
    lines += histogram_lines({"turnaround": latency.times.parts["turnaround"]})
    return "\n".join(lines)
