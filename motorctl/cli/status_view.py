"""The status document as a picture for a terminal."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Any

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.measure import Measurement
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from motorctl.axis_units import AxisUnits, units_of
from motorctl.cli.human_units import short_time
from motorctl.printable import one_line

STATE_STYLES = {
    "off": "dim",
    "homing": "yellow",
    "idle": "cyan",
    "running": "bold green",
    "stopping": "yellow",
    "fault": "bold red",
}
PHASE_STYLES = {"running": "green", "failed": "bold red", "stopped": "yellow"}
TRAVEL_CELLS = 13
LEAST_CELLS = 68
"""Of a terminal in which the travel is drawn, too: below it the numbers need the room."""
PATH_CELLS = 64
"""Of a path on one line, in a terminal of 80 columns."""
MOTION_CELLS = 24
NOTHING = "–"


def status_view(document: Mapping[str, Any], *, detailed: bool) -> RenderableType:
    """Draw the status; `detailed` adds the parameters of every axis in it."""
    parts: list[RenderableType] = [_Axes(document["axes"])]
    for name, axis in document["axes"].items():
        if axis["motion"]:
            parts.append(_motion(name, axis["motion"]))
        if axis.get("excitation"):
            parts.append(Text(f"{name}: excited for {axis['excitation']['left_s']:.0f} s more"))
        if (left := axis.get("trial_motions_left")) is not None:
            parts.append(Text(f"{name}: other models on trial, {left} motions left", "yellow"))
        if axis.get("dual_drive"):
            parts.append(_skew(name, axis["dual_drive"]))
        if axis["fault"]:
            parts.append(Text(f"{name}: {one_line(axis['fault']['message'])}", "bold red"))
        if axis.get("device"):
            parts.append(Text(f"{name}: its device now: {one_line(axis['device'])}", "yellow"))
        if axis.get("samples", {}).get("missed"):
            parts.append(_missed(name, axis["samples"]))
    if preparing := document["loop"].get("preparing"):
        parts.append(Text(preparing, "yellow"))
    if any(axis["fault"] for axis in document["axes"].values()):
        parts += _flight_record(document["recording"].get("flight_records") or {})
    if detailed:
        parts += [_parameters(axis) for axis in document["axes"].values()]
    parts += [Text(), _loop(document["loop"], document["recording"])]
    parts += [Text(f"! {reason}", "yellow") for reason in document["loop"]["degraded"]]
    if difference := document["daemon"].get("config_difference"):
        told = f"! {document['daemon']['config']} {difference} since it was read"
        parts.append(Text(told, "yellow"))
    return Panel(
        Group(*parts),
        title=_title(document),
        title_align="left",
        subtitle=Text(document["daemon"]["socket"], "dim"),
        subtitle_align="right",
        border_style="dim",
        expand=False,
    )


def _flight_record(flight: Mapping[str, str | None]) -> list[RenderableType]:
    if flight.get("failure"):
        return [Text(f"the seconds before it could not be kept: {flight['failure']}", "yellow")]
    if not flight.get("newest"):
        return []
    newest = f"the seconds before it: motorctl fault show {flight['newest']}"
    told: list[RenderableType] = [Text(newest, "dim")]
    if path := flight.get("newest_path"):  # none of an older daemon
        shown = one_line(shlex.quote(path))
        told.append(Text(f"and every row of them: motorctl scope {shown}", "dim", overflow="fold"))
    return told


def _missed(name: str, samples: Mapping[str, int]) -> Text:
    missed, longest, allowed = (samples[key] for key in ("missed", "longest_missed", "allowed"))
    if samples.get("lost"):
        told = f"{missed} ticks without a sample, at most {longest} in a row"
        return Text(f"{name}: device lost; before that {told}", "yellow")
    return Text(
        f"{name}: {missed} ticks without a new sample, at most {longest} in a row; "
        f"{allowed} are allowed",
        "yellow" if 2 * longest > allowed else "dim",
    )


def _title(document: Mapping[str, Any]) -> Text:
    loop, daemon = document["loop"], document["daemon"]
    phase = loop["phase"]
    if daemon["stopping"]:
        phase = "ending, its loop is gone" if phase == "failed" else "stopping"
    return Text.assemble(
        (document["machine"], "bold not dim"),
        ("  ● ", f"{PHASE_STYLES.get(loop['phase'], 'yellow')} not dim"),
        (phase, "not dim"),
        (f"  {loop['rate_hz']:g} Hz  up {_duration(daemon['uptime_s'])}", "dim"),
    )


class _Axes:
    """A line for each axis; in a narrow terminal without the drawing of its travel."""

    def __init__(self, axes: Mapping[str, Any]) -> None:
        self._axes = axes

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield self._table(options)

    def __rich_measure__(self, console: Console, options: ConsoleOptions) -> Measurement:
        return Measurement.get(console, options, self._table(options))

    def _table(self, options: ConsoleOptions) -> Table:
        narrow = options.max_width < LEAST_CELLS
        table = Table(box=None, padding=(0, 1 if narrow else 3, 0, 0), header_style="dim")
        for heading, justify in (
            ("axis", "left"),
            ("state", "left"),
            ("position", "right"),
            *(() if narrow else (("travel", "left"),)),
            ("error", "right"),
            ("command", "right"),
        ):
            table.add_column(heading, justify=justify, no_wrap=True)
        for name, axis in self._axes.items():
            error = _units(axis).error
            table.add_row(
                Text(name, "bold"),
                Text(axis["state"], STATE_STYLES[axis["state"]]),
                _position(axis["position_m"], _units(axis)),
                *(() if narrow else (_travel(axis),)),
                _number(axis["following_error_m"], error.factor, "+.1f", error.unit),
                _number(axis["command_v"], 1.0, "+.2f", "V"),
            )
        return table


def _units(axis: Mapping[str, Any]) -> AxisUnits:
    return units_of(axis.get("position_unit"))  # an older daemon tells none


def _position(value: float | None, units: AxisUnits) -> Text:
    return _number(value, units.place.factor, f".{units.place_digits}f", units.place.unit)


def _skew(name: str, dual: Mapping[str, Any]) -> Text:
    """Tell how far the ends of a beam are apart, and what holds them."""
    skew_m, limit_m = dual["skew_m"], dual["skew_limit_m"]
    near = skew_m is None or 2.0 * abs(skew_m) > limit_m
    return Text.assemble(
        (name, "bold"),
        (" skew ", "dim"),
        _number(skew_m, 1e6, "+.1f", "µm"),
        (f" of {limit_m * 1e6:g} µm, held by ", "dim"),
        _number(dual["skew_command_v"], 1.0, "+.2f", "V"),
        style="yellow" if near else "",
    )


def _travel(axis: Mapping[str, Any]) -> Text:
    """Draw where the axis stands between the ends of its travel."""
    if not axis["homed"]:
        return Text("not homed", "yellow")
    low, high = axis["travel_m"]
    if axis["position_m"] is None:
        return Text(NOTHING, "dim")
    place = (axis["position_m"] - low) / (high - low)
    cell = min(max(int(place * TRAVEL_CELLS), 0), TRAVEL_CELLS - 1)
    before, after = "─" * cell, "─" * (TRAVEL_CELLS - 1 - cell)
    dot = STATE_STYLES[axis["state"]] if 0 <= place <= 1 else "bold red"
    return Text.assemble(("├" + before, "dim"), ("●", dot), (after + "┤", "dim"))


def _motion(name: str, motion: Mapping[str, Any]) -> Text:
    elapsed, whole = max(motion["elapsed_s"], 0.0), motion["duration_s"]
    done = round(min(elapsed / whole, 1.0) * MOTION_CELLS) if whole else MOTION_CELLS
    return Text.assemble(
        (name, "bold"),
        (" follows ", "dim"),
        f"{one_line(motion['name'])}  ",
        ("━" * done, "green"),
        ("━" * (MOTION_CELLS - done), "dim"),
        (f"  {min(elapsed, whole):.1f} of {whole:.1f} s", "dim"),
    )


def _parameters(axis: Mapping[str, Any]) -> RenderableType:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    table.add_column("parameter", no_wrap=True)
    table.add_column("estimate", justify="right")
    table.add_column("unit", no_wrap=True)
    units = axis.get("theta_units", {})  # an older daemon tells none
    for name, value in axis["theta_hat"].items():
        table.add_row(name, NOTHING if value is None else f"{value:.6g}", units.get(name, ""))
    d0 = axis["d0_hat_v"]
    table.add_row("d0", NOTHING if d0 is None else f"{d0:.6g}", "V")
    heading = Text.assemble(("controller ", "dim"), axis["controller"])
    return Group(Text(), heading, table)


def _loop(loop: Mapping[str, Any], recording: Mapping[str, Any]) -> Table:
    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(style="dim")
    table.add_column()
    for name in ("turnaround", "lateness"):
        table.add_row(name, _timing(loop[name]))
    missed = loop["overruns"] + loop["skipped_periods"]
    table.add_row(
        "overruns",
        Text(
            f"{loop['overruns']:,}, {loop['skipped_periods']:,} periods "
            f"{'waited' if loop['waits'] else 'skipped'}, of {loop['ticks']:,} ticks",
            "yellow" if missed else "",
        ),
    )
    if recording["file"]:
        lost = recording["rows_lost"]
        counted = f"{recording['rows']:,} ticks, {lost:,} lost"
        table.add_row("recording", Text(counted, "bold red" if lost else ""))
        why = recording.get("lost_because")  # none of an older daemon
        if lost and why and not recording["failure"]:
            table.add_row("", Text(f"lost: {why}", "bold red", overflow="fold"))
        table.add_row("", Text(_broken(recording["file"]), "dim", overflow="fold"))
        for text in _logs(recording):
            table.add_row("", text)
    if recording["failure"]:
        table.add_row("", Text(recording["failure"], "bold red"))
    return table


def _broken(path: str) -> str:
    """Return a path in two lines, its folder and its name, where one would not hold it."""
    folder, slash, name = path.rpartition("/")
    return f"{folder}{slash}\n{name}" if len(path) > PATH_CELLS else path


def _logs(recording: Mapping[str, Any]) -> list[Text]:
    """Draw what else there is to know of the logs; nothing where all is as it should be."""
    told = []
    if recording.get("paused"):
        told.append(Text("paused: every axis is off", "cyan"))
    for text in (recording.get("trouble"), (recording.get("conversion") or {}).get("failure")):
        if text:
            told.append(Text(text, "bold red", overflow="fold"))
    disk, retention = recording.get("disk") or {}, recording.get("retention") or {}
    if retention.get("failure"):
        told.append(Text(retention["failure"], "bold red", overflow="fold"))
    if disk.get("warning"):
        told.append(Text(disk["warning"], "bold yellow", overflow="fold"))
    elif disk.get("free_mb") is not None and disk.get("closed_mb_h") is not None:
        left = "" if disk["hours_left"] is None else f", enough for {_long(disk['hours_left'])}"
        kept = f"{disk['closed_mb_h']:,.0f} MB an hour are kept"
        told.append(Text(f"{kept}; {disk['free_mb'] / 1e3:,.1f} GB free{left}", "dim"))
    if retention.get("removed"):
        gone = f"{retention['removed']:,} old logs removed, {retention['removed_mb'] / 1e3:,.1f} GB"
        told.append(Text(f"{gone}: {retention['because']}", "dim"))
    return told


def _long(hours: float) -> str:
    return f"{hours:.0f} h" if hours < 48 else f"{hours / 24:,.0f} days"


def _timing(figures: Mapping[str, float] | None) -> Text:
    if figures is None:
        return Text(NOTHING, "dim")
    return Text.assemble(
        ("median ", "dim"),
        short_time(figures["p50_s"]),
        ("   p99 ", "dim"),
        short_time(figures["p99_s"]),
        ("   worst ", "dim"),
        short_time(figures["max_s"]),
        (f" at {figures['max_at_s']:.1f} s", "dim"),
    )


def _number(value: float | None, scale: float, form: str, unit: str) -> Text:
    if value is None:
        return Text(NOTHING, "dim")
    return Text.assemble(f"{value * scale:{form}}", (f" {unit}", "dim"))


def _duration(seconds: float) -> str:
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
