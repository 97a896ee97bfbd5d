"""The figures of the buses: tracking beside the direct simulation, turnaround, bus use."""

from __future__ import annotations

import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from motorctl.errors import MotorctlError
from motorctl.identify.compare.measures import Measures
from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress, part_of
from motorctl_benchmarks.buses.exchanges import exchange_figures
from motorctl_benchmarks.buses.session import Measured, measure_transport
from motorctl_benchmarks.buses.transports import chosen_transports
from motorctl_benchmarks.findings import Findings
from motorctl_devices.prompt_ptys import can_be_prompt

DURATION_S = 60.0
EXCHANGE_SHARE = 0.03
"""Of the progress."""
PROMPT = (
    "The kernel's threads that carry pseudo-terminals had a real-time priority, as a wire would."
)
NOT_PROMPT = (
    "The kernel's threads that carry pseudo-terminals had ordinary priority, as they could not be "
    "raised here, and any other program delays them."
)
TRACKING = Target("ratio", ">=", 0.9)
"""As good as the direct simulation within a tenth."""


@dataclass(frozen=True)
class BusesOptions:
    """What is asked for."""

    only: tuple[str, ...] = ()
    """Names of transports: these, and no exchange apart; all, if not given."""


def bus_findings(
    progress: Progress, options: BusesOptions, duration_s: float = DURATION_S
) -> Findings:
    """Run C2 over each transport in turn; one that fails is told and hinders no other.

    Raises UsageError where a transport that is asked for is not there.
    """
    figures: list[Figure] = []
    notes: list[str] = []
    rows: list[dict[str, Any]] = []
    chosen, whole = chosen_transports(options.only), progress
    if not options.only:
        figures, notes = exchange_figures(part_of(progress, 0.0, EXCHANGE_SHARE))
        whole = part_of(progress, EXCHANGE_SHARE, 1.0)
    for k, transport in enumerate(chosen):
        part = part_of(whole, k / len(chosen), (k + 1) / len(chosen))
        with tempfile.TemporaryDirectory(prefix="motorctl-") as folder:
            try:
                measured = measure_transport(transport, duration_s, Path(folder), part)
            except MotorctlError as error:
                notes.append(f"{transport.name}: {error}")
                continue
        figures += _figures(measured)
        rows.append(_row(measured))
        notes += [f"{transport.name}: {refusal}" for refusal in measured.refusals]
    notes.append(PROMPT if can_be_prompt() else NOT_PROMPT)
    notes.append(
        f"Two published axes under C2 for {duration_s:g} s each, the gantry in a process of its "
        "own. eF is the largest error of the last two cycles, L2 the rms error; the first cycle "
        "does not count. The direct simulation has the same rate, gains and motion, and its "
        "commands act as late as the exchange makes them; it runs in virtual time, so without the "
        "pauses of this computer. What these do to it on the wall clock is in the JSON document."
    )
    return Findings(tuple(figures), tuple(notes), data={"buses": rows})


def _figures(measured: Measured) -> list[Figure]:
    key = measured.transport.name.replace(" ", "_")
    title = f"{measured.transport.name}, {measured.transport.rate_hz:g} Hz"
    figures = []
    for axis, over in measured.over_bus.items():
        beside = measured.direct[axis]
        for symbol, own, direct in (
            ("eF", over.eF_m, beside.eF_m),
            ("L2", over.L2_m, beside.L2_m),
        ):
            figures.append(
                Figure(
                    f"{key}_{symbol}_{axis}",
                    f"{title}: {symbol} of {axis}",
                    1e6 * own,
                    "um",
                    "direct",
                    1e6 * direct,
                    direct / own,
                    TRACKING,
                )
            )
    turnaround = measured.timing.turnaround
    if turnaround is not None:
        for name, value in (
            ("median", turnaround.median_s),
            ("p99", turnaround.p99_s),
            ("max", turnaround.worst_s),
        ):
            figures.append(
                Figure(
                    f"{key}_turnaround_{name}", f"{title}: turnaround, {name}", 1e6 * value, "us"
                )
            )
    return figures


def _row(measured: Measured) -> dict[str, Any]:
    turnaround = measured.timing.turnaround
    return {
        "transport": measured.transport.name,
        "rate_hz": measured.transport.rate_hz,
        "max_rate_hz": measured.max_rate_hz,
        "used": measured.used,
        "arithmetic": measured.arithmetic,
        "exchange_delay_s": measured.delay_s,
        "turnaround_median_s": turnaround.median_s if turnaround else None,
        "turnaround_p99_s": turnaround.p99_s if turnaround else None,
        "turnaround_max_s": turnaround.worst_s if turnaround else None,
        "held_share": measured.held_share,
        "skipped_share": measured.skipped_share,
        "axes": {
            axis: _measures_row("", over)
            | _measures_row("direct_", measured.direct[axis])
            | _measures_row("direct_wall_", measured.direct_wall[axis])
            for axis, over in measured.over_bus.items()
        },
    }


def _measures_row(prefix: str, measures: Measures) -> dict[str, float]:
    return {f"{prefix}{key}": value for key, value in asdict(measures).items()}
