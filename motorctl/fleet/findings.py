"""What is kept of a log: a row for each parameter, effect and verdict of each window."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import pyarrow as pa

from motorctl.fleet.head import LogHead
from motorctl.identify.diagnose.result import AxisDiagnosis
from motorctl.identify.fit.report import parameter_values
from motorctl.identify.fit.result import AxisFit
from motorctl.json_values import finite
from motorctl.long_logs.windows import Window
from motorctl.version import VERSION

SCHEMA_VERSION = 1
"""Of the store; a store of another one is not written to."""

_MOMENT = pa.timestamp("us", tz="UTC")
FIELDS: Mapping[str, tuple[pa.DataType, str]] = {
    "key": (pa.string(), "of log, model and version together; a file has one"),
    "log_id": (pa.string(), "hash of the log's size and footer, whatever its name and age"),
    "model_id": (pa.string(), "hash of what was fitted: declared effects, and what is tried"),
    "version": (pa.string(), "of motorctl"),
    "source": (pa.string(), "where the log was"),
    "machine": (
        pa.string(),
        "as the log says, told apart where it was simulated; null of one that cannot be read",
    ),
    "host": (pa.string(), "the computer that recorded it"),
    "axis": (pa.string(), "null where a row is of the whole log"),
    "program": (pa.string(), "what the axis was to follow; empty where nothing"),
    "window": (pa.int32(), "from 0, in the log's order"),
    "begin_utc": (_MOMENT, "of the window's first row"),
    "end_utc": (_MOMENT, "of its last row"),
    "begin_s": (pa.float64(), "of its first row by the log's own `time_s`, as the scope counts"),
    "end_s": (pa.float64(), "of its last row"),
    "rows": (pa.int64(), "of the window"),
    "kind": (pa.string(), "parameter, effect, verdict, nothing or refused"),
    "name": (pa.string(), "of the parameter or effect; the verdict"),
    "value": (
        pa.float64(),
        "of a parameter; of an effect the part of the error it explains; null where not finite",
    ),
    "std_error": (pa.float64(), "of a parameter"),
    "unit": (pa.string(), "of value and std_error"),
    "confidence": (pa.float64(), "of an effect, 0 to 1"),
    "text": (
        pa.string(),
        "the verdict's sentence, at which bound a value is, or why nothing is told",
    ),
    "written_utc": (_MOMENT, "when it was kept"),
}
"""Columns of the store, and what they mean."""
SCHEMA = pa.schema([pa.field(name, kind) for name, (kind, _) in FIELDS.items()])
RESIDUAL = "residual_rms"
"""What the fit leaves of the command, kept beside the parameters."""
DELAY = "input_delay_s"
"""The input delay that the fit found, kept beside the parameters."""

Row = dict[str, Any]


@dataclass(frozen=True)
class Refusal:
    """Why a log cannot be used."""

    source: str
    reason: str
    lasting: bool = True
    """Whether that lies in the log itself, and will be so tomorrow."""
    machine: str | None = None
    """As the log says, where that is known."""


def fit_rows(head: LogHead, window: Window, span_s: tuple[float, float], fit: AxisFit) -> list[Row]:
    """Return a row for each parameter, the delay and the residual of a window's fit."""
    unit = fit.data.command_unit
    found: list[tuple[str, float, float, str, str | None]] = [
        (
            name,
            entry["value"],
            math.nan if "at_bound" in entry else entry["std_error"],
            entry["unit"],
            f"at its {entry['at_bound']} bound" if "at_bound" in entry else None,
        )
        for name, entry in parameter_values(fit).items()
    ]
    found.append((DELAY, fit.delay_s, fit.estimate.delay_std_error_s, "s", None))
    found.append((RESIDUAL, fit.error.rms, math.nan, unit, None))
    return [
        _of(head, window, span_s)
        | {
            "kind": "parameter",
            "name": name,
            "value": finite(value),
            "std_error": finite(std_error),
            "unit": unit_of,
            "text": text,
        }
        for name, value, std_error, unit_of, text in found
    ]


def diagnosis_rows(
    head: LogHead, window: Window, span_s: tuple[float, float], axis: AxisDiagnosis
) -> list[Row]:
    """Return a row for the verdict of a window, and one for each effect that was found."""
    verdict: Row = {"kind": "verdict", "name": axis.verdict, "text": axis.sentence}
    effects: list[Row] = [
        {
            "kind": "effect",
            "name": found.name,
            "value": finite(found.explained_fraction),
            "unit": "1",
            "confidence": found.confidence,
            "text": " ".join(found.evidence),
        }
        for found in axis.effects
    ]
    return [_of(head, window, span_s) | row for row in (verdict, *effects)]


def nothing_row(head: LogHead, axis: str, why: str, window: Window | None = None) -> Row:
    """Return the row of an axis, or of one window of it, that tells nothing."""
    told: Row = {"axis": axis, "program": head.programs.get(axis, ""), "kind": "nothing"}
    return told | {"text": why, "window": None if window is None else window.number}


def table_of_log(head: LogHead, key: str, rows: Iterable[Row]) -> pa.Table:
    """Return the rows of a log with what is known of it, in an order that never changes."""
    whole = {
        "key": key,
        "log_id": head.log_id,
        "model_id": head.model_id,
        "version": VERSION,
        "source": head.source,
        "machine": head.machine,
        "host": head.host,
        "begin_utc": head.begin_utc,
        "end_utc": head.end_utc,
        "rows": head.rows,
        "written_utc": datetime.now(UTC),
    }
    ordered = sorted(rows, key=_order)
    return _table([whole | row for row in ordered])


def table_of_refusal(refusal: Refusal, key: str, log_id: str, head: LogHead | None) -> pa.Table:
    """Return the one row of a log that cannot be used."""
    row: Row = {"kind": "refused", "text": refusal.reason}
    if head is not None:
        return table_of_log(head, key, [row])
    row |= {"key": key, "log_id": log_id, "version": VERSION, "source": refusal.source}
    return _table([row | {"written_utc": datetime.now(UTC)}])


def _table(rows: Iterable[Row]) -> pa.Table:
    """Return rows whose text can be written: half a character of a name is written out."""
    kept = [
        {key: whole_text(each) if isinstance(each, str) else each for key, each in row.items()}
        for row in rows
    ]
    return pa.Table.from_pylist(kept, schema=SCHEMA)


def whole_text(text: str) -> str:
    """Return a text that can be written, as a file's name with bytes of no character cannot be."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def _of(head: LogHead, window: Window, span_s: tuple[float, float]) -> Row:
    """Return what is known of a window; `span_s` counts from the log's first row."""
    return {
        "axis": window.axis,
        "program": head.programs.get(window.axis, ""),
        "window": window.number,
        "begin_utc": head.begin_utc + timedelta(seconds=span_s[0]),
        "end_utc": head.begin_utc + timedelta(seconds=span_s[1]),
        "begin_s": head.first_s + span_s[0],
        "end_s": head.first_s + span_s[1],
        "rows": window.rows,
    }


def _order(row: Row) -> tuple[str, int, str, str]:
    window = row.get("window")
    return (
        str(row.get("axis") or ""),
        -1 if window is None else int(window),
        str(row["kind"]),
        str(row.get("name") or ""),
    )
