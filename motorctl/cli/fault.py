"""`motorctl fault`: the flight records of axes that tripped."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motorctl.cli.say import say
from motorctl.cli.socket_option import SocketOption
from motorctl.cli.whole_help import WholeHelp

if TYPE_CHECKING:  # what reads files takes long to import: each command does so when it runs
    from motorctl.axis_units import AxisUnits
    from motorctl.flight import FlightRecord, Listing
    from motorctl.flight.fault_moment import AxisMoment, FaultMoment

LogDirOption = Annotated[
    Path | None,
    typer.Option(
        "--log-dir",
        metavar="DIR",
        help="Where `motorctl run` logs to; without it the running daemon is asked.",
        show_default=False,
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document.")]
MOST_LISTED = 20


def _columns(units: AxisUnits) -> dict[str, tuple[float, str, str]]:
    """Return of the table how a signal is scaled, formatted, and its unit."""
    place = (units.place.factor, f"10.{units.place_digits}f", units.place.unit)
    speed = "7.1f" if units.kind == "linear" else "7.4f"
    return {
        "reference_m": place,
        "position_m": place,
        "velocity_m_s": (units.velocity.factor, speed, units.velocity.unit),
        "following_error_m": (units.error.factor, "9.1f", units.error.unit),
        "command_v": (1.0, "8.3f", "V"),
    }


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    group = typer.Typer(cls=WholeHelp, no_args_is_help=True)
    group.command("list", epilog="Example: motorctl fault list --log-dir logs")(_list)
    group.command("show", epilog="Example: motorctl fault show --out pictures")(_show)
    app.add_typer(group, name="fault", help="List and show what was kept of axes that tripped.")


def _list(
    log_dir: LogDirOption = None,
    every: Annotated[bool, typer.Option("--all", help="All of them, however many.")] = False,
    as_json: AsJson = False,
    socket: SocketOption = None,
) -> None:
    """List the flight records, the newest first."""
    listing = _listing(log_dir, socket)
    if as_json:
        records = [record.document() for record in listing.records]
        say(
            json.dumps(
                {"folder": str(listing.folder), "records": records, "broken": list(listing.broken)}
            )
        )
        return
    if not (listing.records or listing.broken):
        say(f"{listing.folder}: no flight records: no axis has tripped")
    shown = listing.records if every else listing.records[:MOST_LISTED]
    for record in shown:
        others = [axis for axis in record.faults if axis != record.first_axis]
        beside = f"  (and {', '.join(others)})" if others else ""
        say(f"{record.id}{beside}\n    {record.message}")
    if left := len(listing.records) - len(shown):
        say(f"and {left} older ones: --all")
    for message in listing.broken:
        say(f"! {message}")


def _show(
    record: Annotated[
        str | None,
        typer.Argument(
            metavar="[ID]",
            help="As `fault list` tells it, a part that only one has, or a file; else the newest.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Where pictures go; none without it."),
    ] = None,
    log_dir: LogDirOption = None,
    as_json: AsJson = False,
    socket: SocketOption = None,
) -> None:
    """Show what happened: cause, axes before and in the fault's tick, versions, and pictures."""
    from motorctl.flight import find_record, load_record
    from motorctl.flight.fault_moment import fault_moment, read_rows

    if record is not None and Path(record).is_file():
        found = load_record(Path(record))
    else:
        found = find_record(_listing(log_dir, socket), record)
    rows = read_rows(found)
    moment = fault_moment(found, rows)
    pictures: list[Path] = []
    if out is not None:
        from motorctl.flight.pictures import plot_record

        pictures = plot_record(found, rows, out)
    if as_json:
        say(json.dumps(_document(found, moment) | {"pictures": [str(p) for p in pictures]}))
        return
    say(_told(found, moment))
    for picture in pictures:
        say(str(picture))
    if out is None:
        say("  pictures: --out DIR")


def _listing(log_dir: Path | None, socket: Path | None) -> Listing:
    from motorctl.daemon.client import Client
    from motorctl.errors import MotorctlError, UsageError
    from motorctl.flight import Listing, list_records

    if log_dir is not None:
        return list_records(log_dir)
    try:
        with Client(socket) as client:
            folder = Path(client.ask("status")["recording"]["flight_records"]["folder"])
    except MotorctlError as error:
        raise UsageError(
            f"{error}\nflight records can be read without a daemon: name the folder of its logs "
            "with --log-dir"
        ) from error
    return list_records(folder) if folder.is_dir() else Listing(folder, (), ())


def _document(record: FlightRecord, moment: FaultMoment) -> dict[str, Any]:
    own = record.own
    return record.document() | {
        "moment": {
            "time_s": moment.time_s,
            "before": {axis: asdict(found) for axis, found in moment.before.items()},
            "at": {axis: asdict(found) for axis, found in moment.at.items()},
        },
        "version": record.metadata.get("version"),
        "host": record.metadata.get("host"),
        "libraries": own.get("libraries"),
        "motions": record.metadata.get("motions"),
        "loop": record.metadata.get("loop"),
        "config": record.metadata.get("config"),
    }


def _told(record: FlightRecord, moment: FaultMoment) -> str:
    meta = record.metadata
    lines = [
        record.id,
        f"  {record.path}",
        f"  {record.machine}, {record.written_utc[:19].replace('T', ' ')} UTC",
    ]
    lines += [f"  {axis}: {f['message']}" for axis, f in record.faults.items()]
    if record.own.get("loop_ended"):
        lines.append(f"  the loop ended: {record.own['loop_ended']}")
    lines += ["", *_table(moment, meta.get("config") or {}), ""]
    lines += [f"  {motion}" for motion in _motions(meta.get("motions"))]
    settings = record.own.get("settings", {})
    lines.append(
        f"  {record.rows} rows at {meta.get('rate_hz', 0):g} Hz, {meta.get('rows_lost', 0)} lost; "
        f"up to {settings.get('before_s', 0):g} s before and {settings.get('after_s', 0):g} s after"
    )
    host, libraries = meta.get("host", {}), record.own.get("libraries", {})
    versions = {"motorctl": meta.get("version"), "Python": host.get("python"), **libraries}
    lines.append("  " + ", ".join(f"{name} {number}" for name, number in versions.items()))
    lines.append(f"  an ordinary log: motorctl diagnose {record.path}")
    return "\n".join(lines)


def _table(moment: FaultMoment, config: dict[str, Any]) -> list[str]:
    from motorctl.axis_units import units_in

    heading = (
        f"  {'axis':<8} {'':<7} {'state':<9} {'reference':>13} {'position':>13} {'velocity':>12} "
        f"{'error':>12} {'command':>10}"
    )
    lines = [heading]
    for axis in moment.at:
        units = units_in(config, axis)
        for when, found in (("before", moment.before[axis]), ("at", moment.at[axis])):
            lines.append(f"  {axis:<8} {when:<7} {_cells(found, units)}")
    return lines


def _cells(found: AxisMoment, units: AxisUnits) -> str:
    words = ", ".join(found.flags + tuple(f"device: {word}" for word in found.device))
    numbers = " ".join(_cell(found.values[signal], *how) for signal, how in _columns(units).items())
    return f"{found.state:<9} {numbers}" + (f"  {words}" if words else "")


def _cell(value: float | None, scale: float, digits: str, unit: str) -> str:
    if value is None:
        width = int(digits.split(".", maxsplit=1)[0])
        return f"{'–':>{width}} {unit}"
    return f"{value * scale:>{digits}} {unit}"


def _motions(motions: Any) -> list[str]:
    if not isinstance(motions, list) or not motions:
        return []
    last = motions[-1]
    return [f"last motion: {last.get('name')} of {', '.join(last.get('axes', []))}"]
