"""`motorctl log`: look into a recording, export it, recover it after a crash."""

from __future__ import annotations

import dataclasses
import json
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motorctl.cli.force_option import ForceOption
from motorctl.cli.human_units import long_time, moment, short_time, size
from motorctl.cli.recording_argument import WholeRun
from motorctl.cli.say import say
from motorctl.cli.whole_help import WholeHelp

if TYPE_CHECKING:  # what reads files takes long to import: each command does so when it runs
    from motorctl.log.info import LogInfo

KNOWN = {
    "machine": "machine",
    "version": "motorctl",
    "seed": "seed",
    "host": "computer",
    "rows_lost": "rows lost",
}
"""What a log's metadata tell, and in which words it is shown."""

LogFile = Annotated[Path, typer.Argument(metavar="FILE", show_default=False)]
LogFiles = Annotated[
    list[Path],
    typer.Argument(
        metavar="FILE...",
        help="A log; or several of one run, a folder of them, or the run's name.",
        show_default=False,
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document.")]


class Target(StrEnum):
    """Formats that a log can be exported to."""

    CSV = "csv"
    PARQUET = "parquet"
    MAT = "mat"
    MCAP = "mcap"


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    group = typer.Typer(cls=WholeHelp, no_args_is_help=True)
    group.command("info", epilog="Example: motorctl log info run.parquet")(_info)
    group.command("export", epilog="Example: motorctl log export run.parquet --to csv")(_export)
    group.command("recover", epilog="Example: motorctl log recover run.parquet.partial")(_recover)
    app.add_typer(group, name="log", help="Look into a log, export it, recover it after a crash.")


def _info(files: LogFiles, whole_run: WholeRun = False, as_json: AsJson = False) -> None:
    """Show what is in a log, in an unfinished one, in a foreign recording or in a whole run."""
    from motorctl.log.info import describe, describe_run
    from motorctl.log.run_parts import is_run

    run = is_run(files, whole_run)
    info = describe_run(files, whole_run) if run else describe(files[0])
    if as_json:
        say(json.dumps(dataclasses.asdict(info)))
    else:
        say(_told(info))


def _export(
    files: LogFiles,
    to: Annotated[Target, typer.Option(help="The format.", show_default=False)],
    out: Annotated[Path | None, typer.Option(help="The new file; else beside the log.")] = None,
    whole_run: WholeRun = False,
    force: ForceOption = False,
    as_json: AsJson = False,
) -> None:
    """Write a log, or a run, as CSV, MAT, MCAP for Foxglove, or Parquet that any program reads."""
    from motorctl.cli.progress import showing_progress
    from motorctl.log.export import export

    with showing_progress(f"writing {to.value}") as progress:
        target = export(files, to.value, out, progress, whole_run, replace=force)
    say(json.dumps({"out": str(target)}) if as_json else target)


def _recover(
    file: LogFile,
    out: Annotated[Path | None, typer.Option(help="The log; else as it was to be called.")] = None,
    as_json: AsJson = False,
) -> None:
    """Make a log of what a crash left, with every row that is whole."""
    from motorctl.log.recovery import recover

    done = recover(file, out)
    if as_json:
        say(json.dumps(dataclasses.asdict(done) | {"path": str(done.path)}))
    elif done.was_finished:
        say(f"{done.path}: was complete already, with {done.rows} rows")
    else:
        tail = "; the torn end of the file was dropped" if done.tail_cut else ""
        say(f"{done.path}: {done.rows} rows kept{tail}")
        if done.partial_kept:
            say("the damage is more than an interrupted write: the partial file stays")


def _told(info: LogInfo) -> str:
    lines = [info.path + ("" if info.finished else "  (not finished)")]
    lines.append(f"  {info.rows:,} rows, {size(info.size_bytes)}")
    if info.begin_s is not None and info.end_s is not None:
        rate = f" at {info.sample_rate_hz:g} Hz" if info.sample_rate_hz else ""
        lasts = long_time(info.end_s - info.begin_s)
        lines.append(f"  {lasts}{rate}, from {info.begin_s:.6g} s to {info.end_s:.6g} s")
    lines.append(f"  axes: {', '.join(info.axes)}")
    for key, words in KNOWN.items():
        if info.metadata.get(key) not in (None, 0):
            lines.append(f"  {words}: {_short(info.metadata[key])}")
    if started := info.metadata.get("started_utc"):
        lines.append(f"  started: {moment(str(started))}")
    lines += _part(info.metadata)
    timing = info.metadata.get("timing") or {}
    for name in ("turnaround", "lateness"):
        if isinstance(found := timing.get(name), dict):
            lines.append(f"  {name}: {_durations(found)}")
    if missing := timing.get("ticks_missing"):
        paused = ", or left out in pauses" if info.metadata.get("pauses") else ""
        lines.append(f"  {missing:,} ticks are missing (skipped or lost{paused})")
    lines += [
        f"  axis {axis}: {missed:,} of {info.rows:,} rows without a new sample"
        for axis, missed in info.missed.items()
        if missed
    ]
    for f in info.faults:
        device = f" (device: {', '.join(f.device)})" if f.device else ""
        cause = f.cause.lower().replace("_", " ")
        lines.append(f"  fault at {f.time_s:.6g} s, axis {f.axis}: {cause}{device}")
    lines += [f"  note: {note}" for note in info.notes]
    return "\n".join(lines)


def _part(metadata: dict[str, Any]) -> list[str]:
    """Say which part of a run a log is, and where rows were left out on purpose."""
    told = []
    if "part" in metadata:
        around = [
            f"{word} {metadata[key]}"
            for key, word in (("predecessor", "after"), ("successor", "before"))
            if metadata.get(key)
        ]
        parts = metadata["part"]
        which = f"parts {parts[0]} to {parts[-1]}" if isinstance(parts, list) else f"part {parts}"
        told.append(", ".join([f"  {which} of the run {metadata['run']}", *around]))
    if (pauses := metadata.get("pauses")) and pauses["count"]:
        times = f"{pauses['count']} times, {pauses['seconds']:.6g} s in all"
        told.append(f"  paused {times}: {pauses['while']}")
    return told


def _short(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {item}" for key, item in value.items())
    return str(value)


def _durations(found: dict[str, float]) -> str:
    names = {"p50_s": "median", "p99_s": "99 %", "p999_s": "99.9 %", "max_s": "worst"}
    parts = [f"{names[key]} {short_time(found[key])}" for key in names if key in found]
    at = f" at {found['max_at_s']:.6g} s" if "max_at_s" in found else ""
    return ", ".join(parts) + at
