"""`motorctl fleet`: the logs of many machines and days, and what changed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.table import Table

from motorctl.cli.recording_argument import AllowCode
from motorctl.cli.say import say
from motorctl.cli.terminal import Terminal, open_table
from motorctl.cli.whole_help import WholeHelp
from motorctl.extras import require

if TYPE_CHECKING:
    from motorctl.fleet.changes import Alarm, Explained, FleetChanges, Unlike
    from motorctl.fleet.run import FleetRun

NEEDED = ("distributed", "fsspec", "ruptures")
SOME_REFUSED = 3
"""Exit status where some logs cannot be used: none that a failure has, so that timers can tell."""
FalseAlarms = Annotated[
    float,
    typer.Option(
        metavar="N", help="Looks with a false alarm that are accepted a year, fleet-wide."
    ),
]
LooksADay = Annotated[float, typer.Option(metavar="N", help="How often you ask; that counts.")]
CovariatesFile = Annotated[
    Path | None,
    typer.Option(
        metavar="CSV",
        help="machine, time and columns as temperature_C: what goes with them is no alarm.",
        show_default=False,
    ),
]
ReadLogs = Annotated[
    bool,
    typer.Option(
        "--logs/--no-logs",
        help="Read logs before and after again, where the fit leaves more, to name what grew: "
        "seconds to minutes each, of the first 20 at most.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document.")]
StoreOption = Annotated[
    Path, typer.Option("--store", metavar="DIR", help="The folder of findings.", show_default=False)
]


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    group = typer.Typer(cls=WholeHelp, no_args_is_help=True)
    group.command(
        "diagnose",
        epilog="Example: motorctl fleet diagnose 'logs/**/*.parquet' --store findings",
    )(_diagnose)
    group.command(
        "changes", epilog="Example: motorctl fleet changes --store findings --false-alarms 2"
    )(_changes)
    group.command("report", epilog="Example: motorctl fleet report findings --out fleet.html")(
        _report
    )
    app.add_typer(
        group,
        name="fleet",
        help="Diagnose the logs of many machines, and tell what changed since when.",
    )


def _diagnose(
    logs: Annotated[
        list[str],
        typer.Argument(
            metavar="LOGS...",
            help="Logs, or quoted patterns of them; s3://…, gs://… and http://… where the package "
            "for it is installed.",
            show_default=False,
        ),
    ],
    store: StoreOption,
    model: Annotated[
        str | None,
        typer.Option(help="C1, C2 or a configuration; else what each log declares."),
    ] = None,
    diagnoses: Annotated[
        int,
        typer.Option(
            metavar="N",
            help="So many windows of each axis and log are searched for what the model lacks; "
            "every one is fitted.",
        ),
    ] = 1,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="tcp://…", help="Of a Dask cluster; else one of this computer."),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Processes of this computer; else one a CPU."),
    ] = None,
    allow_code: AllowCode = None,
    as_json: AsJson = False,
) -> None:
    """Fit and diagnose every log that was not looked at before; exit with 3 where some cannot be.

    A bad log is told with its file and the reason, and the others go on. What is done stays,
    whatever ends the run: the same command again does the rest.
    """
    require("motorctl fleet", "fleet", *NEEDED)
    from motorctl.cli.progress import showing_stages
    from motorctl.fleet.run import diagnose_fleet

    with showing_stages(lines=True) as progress:
        run = diagnose_fleet(
            logs,
            store,
            model=model,
            allow_code=allow_code or (),
            diagnoses=diagnoses,
            scheduler=scheduler,
            workers=workers,
            progress=progress,
        )
    if as_json:
        say(json.dumps(run.to_dict()))
    else:
        for refusal in run.refused:
            say(f"motorctl: not looked at: {refusal.reason}", err=True)
        say(_summary(run))
    if run.refused:
        raise typer.Exit(2 if run.none_usable else SOME_REFUSED)


def _changes(
    store: StoreOption,
    false_alarms: FalseAlarms = 1.0,
    looks_a_day: LooksADay = 1.0,
    covariates: CovariatesFile = None,
    read_logs: ReadLogs = False,
    as_json: AsJson = False,
) -> None:
    """Tell which parameters of which machines changed, since when, and what to look at first."""
    require("motorctl fleet", "fleet", *NEEDED)
    from motorctl.cli.progress import showing_stages
    from motorctl.fleet.changes import changes_in
    from motorctl.fleet.covariates import read_covariates
    from motorctl.fleet.grown import names_of
    from motorctl.fleet.store import open_store

    found = changes_in(
        open_store(store),
        false_alarms_a_year=false_alarms,
        looks_a_day=looks_a_day,
        covariates=read_covariates(covariates) if covariates else None,
    )
    with showing_stages(lines=True) as progress:
        told = names_of(found.alarms, progress) if read_logs else {}
    if as_json:
        document = found.to_dict()
        for k, name in told.items():
            grown = name if isinstance(name, str) else name.to_dict()
            document["alarms"][k]["not_named" if isinstance(name, str) else "grown"] = grown
        say(json.dumps(document))
        return
    console = Terminal()
    if found.alarms:
        console.print(_alarms(found.alarms))
        for k, name in told.items():
            series = found.alarms[k].series
            words = name if isinstance(name, str) else f"what grew is {name.sentence}"
            say(f"{series.machine} {series.axis} {series.name}: {words}")
        first = found.alarms[0]
        say(f"look at first: machine {first.series.machine}, axis {first.series.axis}: {first.log}")
    if found.unlike:
        console.print(_unlike(found.unlike))
    for one in found.explained:
        say(_explained(one))
    say(_judged(found))


def _report(
    store: Annotated[
        Path, typer.Argument(metavar="STORE", help="The folder of findings.", show_default=False)
    ],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="The page.")] = Path(
        "fleet.html"
    ),
    false_alarms: FalseAlarms = 1.0,
    looks_a_day: LooksADay = 1.0,
    covariates: CovariatesFile = None,
    read_logs: ReadLogs = False,
    scope_port: Annotated[
        int,
        typer.Option(
            min=1, max=65535, metavar="N", help="Of the scope that the page's links lead to."
        ),
    ] = 8765,
) -> None:
    """Write the fleet as one page: what to look at first, every machine, links into the logs."""
    require("motorctl fleet", "fleet", *NEEDED)
    from motorctl.cli.progress import showing_stages
    from motorctl.fleet.covariates import read_covariates
    from motorctl.fleet.report import write_fleet_page
    from motorctl.fleet.store import open_store

    with showing_stages(lines=True) as progress:
        found = write_fleet_page(
            open_store(store),
            out,
            false_alarms_a_year=false_alarms,
            looks_a_day=looks_a_day,
            covariates=read_covariates(covariates) if covariates else None,
            scope_port=scope_port,
            read_logs=progress if read_logs else None,
        )
    say(f"{out}: {_judged(found)}")


def _alarms(alarms: Sequence[Alarm]) -> Table:
    table = open_table("what changed", ("machine", "parameter", "before", "after", "since", "size"))
    for alarm in alarms:
        series, change = alarm.series, alarm.change
        before, after = (
            f"{level.value:.4g} ± {level.std_error:.1g}" for level in (change.before, change.after)
        )
        since = f"{alarm.since[0]:%Y-%m-%d %H:%M}"
        if change.form == "drift":
            since = f"drifts from {since}"
        where = f"{series.machine} {series.axis}" + (
            f" ({series.program})" if series.program else ""
        )
        name = f"{series.name} [{series.unit}]"
        cells = (where, name, before, after, since, f"{change.size:.1f}")
        table.add_row(*(escape(cell) for cell in cells))
    return table


def _unlike(unlike: Sequence[Unlike]) -> Table:
    table = open_table(
        "unlike their siblings", ("machine", "parameter", "level", "siblings", "distance", "log")
    )
    for one in unlike:
        series, at = one.judged.series, one.standing
        cells = (
            f"{series.machine} {series.axis}" + (f" ({series.program})" if series.program else ""),
            f"{series.name} [{series.unit}]",
            f"{at.level.value:.4g} ± {at.level.std_error:.1g}",
            f"{at.median:.4g} ± {at.spread:.1g} ({at.others})",
            f"{at.z:+.1f} ± {at.z_error:.1f}",
            series.seen[-1].source,
        )
        table.add_row(*(escape(cell) for cell in cells))
    return table


def _explained(one: Explained) -> str:
    series, influence = one.judged.series, one.judged.influence
    named = ", ".join(influence.names if influence else ())
    left = f"{one.remainder.value:+.2g} ± {one.remainder.std_error:.1g}"
    verdict = f"goes with {named}" if one.certain else f"cannot be told apart from {named}"
    return (
        f"no alarm: {series.machine} {series.axis} {series.name}: changed by {one.moved:+.3g} "
        f"{series.unit}, which {verdict}; {left} are left"
    )


def _judged(found: FleetChanges) -> str:
    others = (
        f" {found.of_other_models} values of other models than the last were left out."
        if found.of_other_models
        else ""
    )
    for use in found.covariates:
        if use.not_used or use.points_left_out:
            others += (
                f" {use.name}: {use.series} series were judged with it, {use.not_used} without, as "
                f"too few points have a reading or it tells nothing there; {use.points_left_out} "
                "points without a reading were left out."
            )
    return (
        f"{len(found.alarms)} of {found.series} series changed, {len(found.unlike)} of "
        f"{found.compared} are unlike their siblings; {found.too_short} have too few "
        f"points or never differ.{others} If nothing changes and machines are alike, at most "
        f"{found.false_alarms_a_year:g} looks a year are expected to have a false alarm; "
        f"of those told at most {100 * found.level:.2g} % are expected to be false. "
        "Size: the change over the usual scatter of a point."
    )


def _summary(run: FleetRun) -> str:
    twins = f", {run.twins} the same as another" if run.twins else ""
    if run.copies:
        twins += f", {run.copies} copies of rows of others (flight records, captures)"
    return (
        f"{run.store}: of {run.logs} logs {run.looked_at} were looked at ({run.hours:.3g} h of "
        f"recording in {run.seconds:.3g} s), {run.known} were known{twins}, {len(run.refused)} "
        f"cannot be used; {run.findings} findings were added"
    )
