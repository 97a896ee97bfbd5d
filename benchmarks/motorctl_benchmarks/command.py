"""`motorctl bench`: speed, diagnosis and buses beside peers, and the campaign of the guards."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from motorctl.cli.terminal import Terminal
    from motorctl_benchmarks.buses.figures import BusesOptions
    from motorctl_benchmarks.closing.findings import ClosingOptions
    from motorctl_benchmarks.control_socket.session import SocketOptions
    from motorctl_benchmarks.diagnosis.campaign import CampaignOptions
    from motorctl_benchmarks.experiments.findings import ExperimentsOptions
    from motorctl_benchmarks.fleet.findings import FleetOptions
    from motorctl_benchmarks.measure import Options, Result
    from motorctl_benchmarks.other_machines.findings import MachinesOptions
    from motorctl_benchmarks.real_machines.findings import RecordingsOptions
    from motorctl_benchmarks.safety.findings import SafetyOptions
    from motorctl_benchmarks.swaps.findings import SwapsOptions
    from motorctl_benchmarks.tuning.findings import TuningOptions

MISTAKES_SHOWN = 60
WIDTH_OF_A_FILE = 120


class SizeChoice(StrEnum):
    """How many cases a campaign has."""

    SMALL = "small"
    FULL = "full"


def bench(
    subject: Annotated[
        str,
        typer.Argument(
            help="What to measure: speed, diagnosis, buses, machines, recordings, campaign, "
            "socket, tuning, experiments, closing, fleet, swaps."
        ),
    ] = "speed",
    cases: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="diagnosis: so many cases in each group. machines: seeds of each kind; default 1. "
            "tuning, experiments: plants that are drawn; default 20, 60. swaps: changes of models; "
            "default 200.",
        ),
    ] = None,
    size: Annotated[
        SizeChoice | None,
        typer.Option(
            help="diagnosis: small (a quarter of an hour on two CPUs; default), or full. "
            "campaign: small (some minutes; default), or full (three quarters of an hour). "
            "closing: small (one hidden effect behind each bus; default), or full (five)."
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="diagnosis, machines: the first seed; by default held-out ones. campaign, socket, "
            "closing, fleet, swaps: default 1.",
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="diagnosis, machines, recordings, campaign, fleet: processes; by default one a "
            "CPU.",
        ),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="CASE",
            help="This case alone; may be repeated. diagnosis: GROUP:SEED. "
            "machines: GENERATOR:KIND:SEED. recordings: the axis' name. buses: the bus' name. "
            "campaign: the key that a case is listed with, or a whole bus as in bus:can-udp. "
            "experiments: a kind of plants, as in 'lag or delay'. closing: the bus' name. fleet: "
            "a part: nights, disturbances, scaling; default nights.",
        ),
    ] = None,
    clean: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="machines: so many clean ones alone, each form of friction with each noise.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Every case or axis as a line of JSON."),
    ] = None,
    logs: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="diagnosis, closing: keep the cases' logs here. fleet: keep truth and findings.",
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="diagnosis, machines: draw how often names were right over their confidence.",
        ),
    ] = None,
    recordings: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            envvar="MOTORCTL_RECORDINGS",
            help="recordings: where tools/fetch_recordings.py has put them.",
        ),
    ] = None,
    machines: Annotated[
        int | None, typer.Option(min=1, help="fleet: machines; default 12, fifty in full.")
    ] = None,
    days: Annotated[
        int | None, typer.Option(min=1, help="fleet: days; default 20, sixty in full.")
    ] = None,
    logs_a_day: Annotated[
        int | None,
        typer.Option(min=1, max=24, help="fleet: logs of each machine a day; default 3."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")] = False,
) -> None:
    """Measure how fast motorctl is here, how often its diagnoses are right, what guards detect.

    speed: the law, the tick, virtual time and the first start of a daemon, as ratios to peers in
    the same run. diagnosis: a blind campaign on simulated machines with known causes, beside
    PySINDy and SysIdentPy where these are installed; what was wrong is listed with the key that
    runs it again. buses: C2 in wall-clock time against the simulated gantry behind each bus, a
    minute each, beside the direct simulation. machines: the diagnosis judged by machines of three
    generators that were written apart and share no code with motorctl; one of them needs MuJoCo.
    recordings: the position that each model predicts of real machines, beside PySINDy and
    SysIdentPy where these are installed. campaign: faults to order in every state, on several
    machines and buses, each judged by what the guards promise, and hours of motion without a fault.

    socket: a daemon at 5 kHz, left alone, under 200 clients of which some send 10 million fuzzed
    bytes, watched by five viewers of the scope and a sixth that never reads, while logs are made,
    and beside busy programs, in turn: late ticks of each, and what the clients were told.

    tuning: gains that `tune` chooses for the shipped gantry and for plants that are drawn, run
    beside a grid of gains, every one of which is run.

    experiments: motion time until nothing is open about plants with look-alikes: the rich motion
    beside motions that are chosen one after the other.

    closing: `close-loop` with nobody there, through a daemon and a bus on a simulated gantry with
    hidden effects, beside the same machine in virtual time: what is left of the errors, motions,
    minutes and questions.

    fleet: machines that change over weeks, each night their logs given to `fleet diagnose` and
    `fleet changes`, and what these told held against the truth. Parts of its own: disturbances
    (workers and schedulers killed, a store that refuses: the findings have to be the same) and
    scaling. --machines 50 --days 60 takes an hour or more on two quiet CPUs.

    swaps: other models and back while an axis holds, and a quarter as many kills of the daemon's
    processes around such a change: bumps, faults, lost rows, models that are not whole.

    The exit status is 0 whether or not the targets are met: what is not met is told. Of the
    campaign and of swaps it is 1 where something is not as promised; of the socket where daemon or
    axes did not stand it, or a row was lost.

    Example: motorctl bench --json

    Example: motorctl bench diagnosis --only one:50003 --logs logs

    Example: motorctl bench buses --only "canopen udp_multicast"

    Example: motorctl bench machines --only energy:cogging:50000

    Example: motorctl bench machines --clean 200

    Example: motorctl bench campaign --only gantry:C2:cruise:encoder_stuck:default:1

    Example: motorctl bench campaign --only dual
    """
    from rich.markup import escape

    from motorctl.cli.progress import showing_progress
    from motorctl.cli.say import say
    from motorctl.cli.terminal import Terminal
    from motorctl.errors import UsageError
    from motorctl.json_values import plain
    from motorctl.latency.host import host_line
    from motorctl_benchmarks.measure import measure

    options: Options | None = None
    asked = (cases, size, seed, workers, only, out, logs, plot)
    if clean is not None and subject != "machines":
        raise UsageError("--clean is for bench machines")
    of_fleet = machines, days, logs_a_day
    if subject != "fleet" and any(value is not None for value in of_fleet):
        raise UsageError("--machines, --days and --logs-a-day are for bench fleet")
    if subject == "fleet":
        if any(value is not None for value in (cases, size, plot)):
            raise UsageError("bench fleet takes no --cases, --size or --plot: see --machines")
        options = _fleet(*of_fleet, seed, workers, only, out, logs)
    elif subject == "machines":
        if size is not None or logs is not None:
            raise UsageError("bench machines takes no --size and keeps no --logs: see --cases")
        options = _machines(cases, clean, seed, workers, only, out, plot)
    elif subject == "recordings":
        if any(value is not None for value in (cases, size, seed, logs, plot)):
            raise UsageError("bench recordings takes no --cases, --size, --seed, --logs or --plot")
        options = _recordings(recordings, workers, only, out)
    elif subject == "campaign":
        if any(value is not None for value in (cases, logs, plot)):
            raise UsageError("bench campaign takes no --cases, --logs or --plot")
        options = _safety(size, seed, workers, only, out)
    elif subject == "tuning":
        if any(value is not None for value in (size, only, logs, plot)):
            raise UsageError("bench tuning takes no --size, --only, --logs or --plot")
        options = _tuning(cases, seed, workers, out)
    elif subject == "experiments":
        if any(value is not None for value in (size, logs, plot)):
            raise UsageError("bench experiments takes no --size, --logs or --plot")
        options = _experiments(cases, seed, workers, only, out)
    elif subject == "closing":
        if any(value is not None for value in (cases, workers, out, plot)):
            raise UsageError("bench closing takes no --cases, --workers, --out or --plot")
        options = _closing(size, seed, only, logs)
    elif subject == "swaps":
        if any(value is not None for value in (size, workers, only, out, logs, plot)):
            raise UsageError("bench swaps takes no option but --cases, --seed and --json")
        options = _swaps(cases, seed)
    elif subject == "buses":
        if any(value is not None for value in (cases, size, seed, workers, out, logs, plot)):
            raise UsageError("bench buses takes no option but --only and --json")
        options = _buses(only)
    elif subject == "socket":
        if any(value is not None for value in (cases, size, workers, only, out, logs, plot)):
            raise UsageError("bench socket takes no option but --seed and --json")
        options = _socket(seed)
    elif subject == "diagnosis" or any(value is not None for value in asked):
        options = _campaign(cases, size, seed, workers, only, out, logs, plot)
    with showing_progress("measuring; the first run compiles the kernels") as progress:
        result = measure(subject, progress, options)
    if as_json:
        say(json.dumps(plain(result.document()), indent=2, allow_nan=False))
        raise typer.Exit(1 if result.failed else 0)
    if result.head:
        _print_page(result)
        raise typer.Exit(1 if result.failed else 0)
    console = Terminal()
    if not console.is_terminal:
        console = Terminal(width=WIDTH_OF_A_FILE)
    console.print(host_line(result.host), highlight=False)
    console.print(_table(result))
    for table in result.tables:
        say("\n" + "\n".join(table.lines()) + "\n")
    for note in result.notes:
        console.print(note, highlight=False, markup=False, soft_wrap=True)
    _print_mistakes(console, result)
    for sentence in result.missed:
        console.print(f"[yellow]not met[/yellow]  {escape(sentence)}", highlight=False)
    if not result.missed:
        console.print("[green]every target is met[/green]")
    if result.failed:
        raise typer.Exit(1)


def _campaign(
    cases: int | None,
    size: SizeChoice | None,
    seed: int | None,
    workers: int | None,
    only: list[str] | None,
    out: Path | None,
    logs: Path | None,
    plot: Path | None,
) -> CampaignOptions:
    """Put the options together. Raises UsageError where they contradict each other."""
    from motorctl.errors import UsageError
    from motorctl_benchmarks.diagnosis.campaign import CampaignOptions
    from motorctl_benchmarks.diagnosis.groups import HELD_OUT_SEED, parse_key

    if cases is not None and size is not None:
        raise UsageError(f"--cases {cases} and --size {size}: only one of the two")
    if only and (cases is not None or size is not None or seed is not None):
        raise UsageError("--only names the cases: --cases, --size and --seed say nothing then")
    return CampaignOptions(
        size="full" if size == SizeChoice.FULL else "small",
        cases=cases,
        first_seed=HELD_OUT_SEED if seed is None else seed,
        workers=workers,
        out=out,
        logs=logs,
        plot=plot,
        only=tuple(parse_key(key) for key in only or ()),
    )


def _machines(
    cases: int | None,
    clean: int | None,
    seed: int | None,
    workers: int | None,
    only: list[str] | None,
    out: Path | None,
    plot: Path | None,
) -> MachinesOptions:
    """Put the options together. Raises UsageError where they contradict each other."""
    from motorctl.errors import UsageError
    from motorctl_benchmarks.diagnosis.groups import HELD_OUT_SEED
    from motorctl_benchmarks.other_machines.findings import MachinesOptions
    from motorctl_benchmarks.other_machines.generators import parse_machine_key

    if only and (cases is not None or seed is not None or clean is not None):
        raise UsageError("--only names the cases: --cases, --clean and --seed say nothing then")
    if cases is not None and clean is not None:
        raise UsageError(f"--cases {cases} and --clean {clean}: only one of the two")
    return MachinesOptions(
        cases=1 if cases is None else cases,
        first_seed=HELD_OUT_SEED if seed is None else seed,
        workers=workers,
        out=out,
        plot=plot,
        clean=clean,
        only=tuple(parse_machine_key(key) for key in only or ()),
    )


def _recordings(
    recordings: Path | None, workers: int | None, only: list[str] | None, out: Path | None
) -> RecordingsOptions:
    from motorctl_benchmarks.real_machines.findings import RecordingsOptions

    return RecordingsOptions(recordings, workers, out, tuple(only or ()))


def _safety(
    size: SizeChoice | None,
    seed: int | None,
    workers: int | None,
    only: list[str] | None,
    out: Path | None,
) -> SafetyOptions:
    """Put the options together. Raises UsageError where they contradict each other."""
    from motorctl.errors import UsageError
    from motorctl_benchmarks.safety.findings import SafetyOptions, parse_tasks

    if only and (size is not None or seed is not None):
        raise UsageError("--only names the cases: --size and --seed say nothing then")
    return SafetyOptions(
        size="full" if size == SizeChoice.FULL else "small",
        seed=1 if seed is None else seed,
        workers=workers,
        out=out,
        only=tuple(task for key in only or () for task in parse_tasks(key)),
    )


def _buses(only: list[str] | None) -> BusesOptions:
    from motorctl_benchmarks.buses.figures import BusesOptions

    return BusesOptions(tuple(only or ()))


def _socket(seed: int | None) -> SocketOptions:
    from motorctl_benchmarks.control_socket.session import SocketOptions

    return SocketOptions(seed=1 if seed is None else seed)


def _tuning(
    cases: int | None, seed: int | None, workers: int | None, out: Path | None
) -> TuningOptions:
    from motorctl_benchmarks.tuning.findings import TuningOptions

    given = {"plants": cases, "first_seed": seed, "workers": workers, "out": out}
    return TuningOptions(**{key: value for key, value in given.items() if value is not None})  # type: ignore[arg-type]


def _experiments(
    cases: int | None,
    seed: int | None,
    workers: int | None,
    only: list[str] | None,
    out: Path | None,
) -> ExperimentsOptions:
    from motorctl_benchmarks.experiments.findings import ExperimentsOptions

    families = None if only is None else tuple(only)
    given = {
        "plants": cases,
        "first_seed": seed,
        "workers": workers,
        "out": out,
        "families": families,
    }
    return ExperimentsOptions(**{k: value for k, value in given.items() if value is not None})  # type: ignore[arg-type]


def _closing(
    size: SizeChoice | None, seed: int | None, only: list[str] | None, logs: Path | None
) -> ClosingOptions:
    from motorctl_benchmarks.closing.findings import ClosingOptions

    given = {
        "size": None if size is None else size.value,
        "seed": seed,
        "only": tuple(only or ()),
        "logs": logs,
    }
    return ClosingOptions(**{k: value for k, value in given.items() if value is not None})  # type: ignore[arg-type]


def _fleet(
    machines: int | None,
    days: int | None,
    logs_a_day: int | None,
    seed: int | None,
    workers: int | None,
    only: list[str] | None,
    out: Path | None,
    logs: Path | None,
) -> FleetOptions:
    from motorctl.extras import require
    from motorctl_benchmarks.fleet.findings import FleetOptions

    require("motorctl bench fleet", "fleet", "distributed", "fsspec", "ruptures")
    given = {
        "machines": machines,
        "days": days,
        "logs_a_day": logs_a_day,
        "seed": seed,
        "workers": workers,
        "only": tuple(only or ()),
        "out": out,
        "folder": logs,
    }
    return FleetOptions(**{k: value for k, value in given.items() if value is not None})  # type: ignore[arg-type]


def _swaps(cases: int | None, seed: int | None) -> SwapsOptions:
    from motorctl_benchmarks.swaps.findings import SwapsOptions

    given = {"swaps": cases, "seed": seed}
    return SwapsOptions(**{key: value for key, value in given.items() if value is not None})


def _print_page(result: Result) -> None:
    """Print Markdown and nothing else, to stand in a page as it is: what was wrong comes first."""
    from motorctl.cli.say import say

    host = result.host
    lines = [
        f"{result.head} {host['cpu']}, {host['cpus']} CPUs, Python {host['python']}, "
        f"numpy {host['numpy']}, numba {host['numba']}."
    ]
    if result.mistakes:
        lines += ["", *(f"- wrong  {r['case']}  {r['truth']}  ->  {r['answer']}"
                        for r in result.mistakes)]  # fmt: skip
    for table in result.tables:
        lines += ["", *table.lines()]
    if result.notes:
        lines += ["", *(f"- {note}" for note in result.notes)]
    say("\n".join(lines))


def _print_mistakes(console: Terminal, result: Result) -> None:
    for row in result.mistakes[:MISTAKES_SHOWN]:
        words = f"{row['case']}  {row['truth']}  ->  {row['answer']}"
        console.print(f"wrong  {words}", highlight=False, markup=False, soft_wrap=True)
    more = len(result.mistakes) - MISTAKES_SHOWN
    if more > 0:
        console.print(f"and {more} more; --out keeps all of them", highlight=False)


def _table(result: Result) -> Table:
    from rich.markup import escape
    from rich.table import Table

    from motorctl.printable import one_line

    table = Table(title=result.subject, title_justify="left", title_style="bold")
    table.add_column("figure")
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("peer")
    ratios = any(figure.ratio is not None for figure in result.figures)
    if ratios:
        table.add_column("ratio", justify="right", no_wrap=True)
    table.add_column("target", justify="right", no_wrap=True)
    table.add_column("met")
    marks = {True: "[green]yes[/green]", False: "[red]no[/red]", None: ""}
    for figure in result.figures:
        peer = figure.peer or ""
        if figure.peer_value is not None:
            peer += f": {figure.peer_value:.3g} {figure.unit}"
        ratio = "" if figure.ratio is None else f"{figure.ratio:.3g}"
        table.add_row(
            escape(one_line(figure.title)),
            f"{figure.value:.3g} {figure.unit}",
            escape(one_line(peer)),
            *([ratio] if ratios else []),
            str(figure.target or ""),
            marks[figure.met],
        )
    return table
