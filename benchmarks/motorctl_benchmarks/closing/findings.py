"""`motorctl bench closing`: how much of its error a machine behind a bus loses by itself."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from motorctl.errors import MotorctlError, UsageError
from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress, part_of
from motorctl_benchmarks.closing.gantries import ENVELOPE, RATES_HZ, HiddenGantry, hidden_gantries
from motorctl_benchmarks.closing.run_bus import JUDGED, BusClosed, Gain, close_over_bus
from motorctl_benchmarks.findings import Findings, TextTable

WITHIN = 1.2
"""So many times what virtual time leaves of an error may be left over a bus."""
EFFECTS = {"small": 1, "full": 5}
"""Hidden behind each bus."""


@dataclass(frozen=True)
class ClosingOptions:
    """What is asked for."""

    size: Literal["small", "full"] = "small"
    seed: int = 1
    only: tuple[str, ...] = ()
    """Buses; all where none is named."""
    logs: Path | None = None
    """Where everything is kept that the loops leave."""

    def __post_init__(self) -> None:
        """Look at the buses."""
        for name in self.only:
            if name not in RATES_HZ:
                raise UsageError(f"--only {name}: the loop is closed over {', '.join(RATES_HZ)}")


def closing_findings(progress: Progress, options: ClosingOptions) -> Findings:
    """Close the loop over each bus in turn; one that fails is told and hinders no other."""
    gantries = [
        gantry
        for gantry in hidden_gantries(options.seed, EFFECTS[options.size])
        if not options.only or gantry.transport.name in options.only
    ]
    rows = []
    for k, gantry in enumerate(gantries):
        part = part_of(progress, k / len(gantries), (k + 1) / len(gantries))
        rows.append(_one(gantry, options, part))
    return found_of(rows)


def _one(gantry: HiddenGantry, options: ClosingOptions, progress: Progress) -> BusClosed:
    name = gantry.transport.name
    with tempfile.TemporaryDirectory(prefix="motorctl-") as scratch:
        folder = Path(scratch)
        if options.logs is not None:
            folder = options.logs / f"{name.replace(' ', '_')}_{options.size}_{options.seed}"
            folder.mkdir(parents=True, exist_ok=True)
        try:
            return close_over_bus(gantry, folder, progress)
        except MotorctlError as error:
            hidden = {axis: tuple(effects) for axis, effects in gantry.hidden.items()}
            return BusClosed(name, gantry.transport.rate_hz, hidden, failed=str(error))


def found_of(rows: Sequence[BusClosed]) -> Findings:
    """Return figures and tables of the loops that were closed."""
    ran = [row for row in rows if row.over_bus is not None and row.virtual is not None]
    figures = [
        Figure(
            f"{row.bus}_{axis}_{measure}".replace(" ", "_"),
            f"{row.bus}: {measure} of {axis} on the unused motion, left over left in virtual time",
            row.worse(axis, measure),
            "x",
            target=Target("value", "<=", WITHIN),
        )
        for row in ran
        for axis in row.axes
        for measure in JUDGED
    ]
    questions = sum(row.questions for row in ran)
    figures.append(
        Figure("questions", "questions that somebody had to answer",
               float(questions) if ran else math.nan, "", target=Target("value", "<=", 0.0))
    )  # fmt: skip
    notes = [
        "Within an envelope that the configuration declares: "
        + ", ".join(f"{key} {value}" for key, value in ENVELOPE.items()),
        *(f"{row.bus}: failed: {row.failed}" for row in rows if row.failed),
    ]
    return Findings(
        tuple(figures),
        tuple(notes),
        data={"buses": [row.document() for row in rows]},
        tables=(_errors(ran), _loops(ran)),
        failed=any(row.failed for row in rows),
    )


def _errors(rows: Sequence[BusClosed]) -> TextTable:
    lines = []
    for row in rows:
        assert row.over_bus is not None
        assert row.virtual is not None
        for axis, errors in row.over_bus.errors.items():
            cells = [f"{row.bus}, {row.rate_hz:g} Hz, {axis}"]
            for measure in JUDGED:
                beside = row.virtual.errors[axis][measure]
                cells += [_um(errors[measure]), _um(beside), f"{row.worse(axis, measure):.2f}"]
            lines.append(tuple(cells))
    heads = [
        f"{m}, {where}" for m in JUDGED for where in ("over the bus", "virtual", "left, ratio")
    ]
    return TextTable("errors in µm on the unused motion", ("bus, axis", *heads), tuple(lines))


def _um(gain: Gain) -> str:
    return f"{1e6 * gain.before_m:.3g} → {1e6 * gain.after_m:.3g}"


def _loops(rows: Sequence[BusClosed]) -> TextTable:
    lines = []
    for row in rows:
        for where, closed in (("over the bus", row.over_bus), ("virtual", row.virtual)):
            assert closed is not None
            lines.append(
                (
                    f"{row.bus}, {where}",
                    _by_axis(row.hidden),
                    _by_axis(closed.named),
                    str(closed.rounds),
                    f"{closed.motions}, {closed.minutes:.1f}, {closed.questions}"
                    if where != "virtual"
                    else "",
                    f"{closed.disturbed:.0%}" if where != "virtual" else "",
                    f"{closed.lasted_s / 60.0:.1f}",
                )
            )
    columns = (
        "loop",
        "hidden",
        "added",
        "rounds",
        "motions, minutes, questions",
        "rows left out",
        "took, minutes",
    )
    return TextTable("what the loops did", columns, tuple(lines))


def _by_axis(names: Mapping[str, tuple[str, ...]]) -> str:
    return "; ".join(f"{axis}: {', '.join(own)}" for axis, own in names.items() if own) or "none"
