"""Draw a flight record: an axis a picture, the whole of it beside the moment of the fault."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from motorctl.axis_units import units_in
from motorctl.errors import UsageError
from motorctl.flight.fault_moment import axes_of, fault_row
from motorctl.flight.records import FlightRecord
from motorctl.picture_style import COLOURS, draw_curve, panels_in_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

CLOSE_S = 0.05
"""Half of the time that the right column shows [s]. Larger hides what happened within a tick,
smaller what led to it. Chosen by hand."""
LEAST_CLOSE_TICKS = 20
"""But at least so many ticks to either side, on slow loops."""
CLOSE_MARKS = 150
"""With fewer ticks in the right column than that each is marked by a dot."""
STATE_COLOURS = {
    "off": "#bbbbbb",
    "homing": "#c9a227",
    "idle": "#7fb3c8",
    "running": "#3f7f3f",
    "stopping": "#c9a227",
    "fault": "#b5482e",
}
DIM = "#777777"


def plot_record(record: FlightRecord, rows: pa.Table, folder: Path) -> list[Path]:
    """Draw every axis of a record.

    Parameters
    ----------
    record
        The record.
    rows
        Its rows, from `read_rows`.
    folder
        Where the pictures go; made where it is missing.

    Returns
    -------
    list of Path
        One picture for each axis.

    Raises
    ------
    UsageError
        Where they cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return [
            _plot_axis(record, rows, axis, folder / f"{record.id}-{axis}.png")
            for axis in axes_of(record)
        ]
    except OSError as error:
        raise UsageError(
            f"{folder}: pictures cannot be written: {error.strerror or error}; name a folder that "
            "can be written to, with --out"
        ) from error


def _plot_axis(record: FlightRecord, rows: pa.Table, axis: str, path: Path) -> Path:
    times = rows["time_s"].to_numpy()
    at = fault_row(times, record.time_s)
    since = times - times[at]
    period_s = float(np.median(np.diff(times))) if len(times) > 1 else CLOSE_S
    reach_s = max(CLOSE_S, LEAST_CLOSE_TICKS * period_s)
    close = np.abs(since) <= reach_s
    with panels_in_file(5, path, height=1.35, columns=2) as (figure, panels):
        for column, chosen in enumerate((np.ones(len(since), bool), close)):
            own = panels[column::2]
            _draw_axis(own, record, rows.filter(pa.array(chosen)), axis, since[chosen])
            own[-1].set_xlabel("time after the fault [s]")
            for panel in own:
                panel.axvline(0.0, color=COLOURS[0], lw=0.8, ls=":")
        panels[0].set_title("the whole record", loc="left", fontsize=9)
        panels[1].set_title(f"{reach_s * 1e3:g} ms to either side", loc="left", fontsize=9)
        for panel in (panels[0], panels[6]):  # once a row: the right column draws the same
            panel.legend(loc="upper left", fontsize=7, ncols=2)
        figure.suptitle(_title(record, axis), x=0.01, ha="left", wrap=True)
    return path


def _title(record: FlightRecord, axis: str) -> str:
    fault = record.faults.get(axis)
    told = str(fault["message"]) if fault else f"did not trip ({record.message})"
    return f"{record.machine}, axis {axis}: {told}"


def _draw_axis(
    panels: Sequence[Axes], record: FlightRecord, rows: pa.Table, axis: str, since: Array
) -> None:
    def signal(name: str) -> Array:
        values: Array = rows[f"{axis}.{name}"].to_numpy()
        return values

    if 1 < len(since) <= CLOSE_MARKS:
        for panel in panels:
            panel.set_prop_cycle(marker=["."], markersize=[3])
    motion, error, command, timing, states = panels
    units = units_in(record.metadata.get("config") or {}, axis)
    place = units.place
    draw_curve(motion, since, signal("reference_m") * place.factor, DIM, "reference")
    draw_curve(motion, since, signal("position_m") * place.factor, COLOURS[1], "position")
    motion.set_ylabel(f"position\n[{place.unit}]")
    draw_curve(error, since, signal("following_error_m") * 1e6, COLOURS[1])
    error.set_ylabel(f"following\nerror [{units.error.unit}]")
    draw_curve(command, since, signal("command_v"), COLOURS[1])
    _limit_lines(command, record, axis)
    command.set_ylabel("command\n[V]")
    draw_curve(timing, since, rows["lateness_s"].to_numpy() * 1e6, COLOURS[4], "lateness")
    draw_curve(timing, since, rows["turnaround_s"].to_numpy() * 1e6, COLOURS[3], "turnaround")
    timing.set_ylabel("loop\n[µs]")
    timing.set_yscale("symlog", linthresh=10.0)
    timing.set_ylim(bottom=0.0)
    _draw_states(states, record, signal("state").astype(np.int64), since)


def _limit_lines(panel: Axes, record: FlightRecord, axis: str) -> None:
    """Draw the voltage limit where the command comes near it; else it would flatten the curve."""
    configured = record.metadata.get("config", {})
    try:
        limit = float(configured["axes"][axis]["limits"]["max_voltage_v"])
    except (KeyError, TypeError, ValueError):
        return
    low, high = panel.get_ylim()
    for value in (-limit, limit):
        if low - 0.5 * (high - low) <= value <= high + 0.5 * (high - low):
            panel.axhline(value, color=DIM, lw=0.8, ls="--")


def _draw_states(
    panel: Axes, record: FlightRecord, states: NDArray[np.int64], since: Array
) -> None:
    """Draw the states as a band, each named where it is wide enough."""
    names = {int(code): str(name).lower() for code, name in record.metadata["states"].items()}
    begins = np.flatnonzero(np.diff(states, prepend=states[0] - 1))
    ends = np.append(begins[1:], len(states))
    whole = float(since[-1] - since[0]) or 1.0
    for begin, end in zip(begins, ends, strict=True):
        name = names.get(int(states[begin]), str(states[begin]))
        left, right = float(since[begin]), float(since[min(end, len(since) - 1)])
        panel.axvspan(left, right, color=STATE_COLOURS.get(name, DIM), alpha=0.6, lw=0)
        if right - left > 0.08 * whole:
            panel.text(0.5 * (left + right), 0.5, name, ha="center", va="center", fontsize=8)
    panel.set_ylim(0.0, 1.0)
    panel.set_yticks([])
    panel.grid(visible=False)
    panel.set_ylabel("state")
