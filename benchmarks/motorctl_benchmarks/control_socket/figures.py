"""The figures of the control socket: late ticks with and without a crowd, and what it was told.

The making of logs is measured beside it, as the other work that must cost the loop nothing."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress
from motorctl_benchmarks.control_socket.session import (
    CONVERTING,
    CROWD,
    KINDS,
    QUIET,
    WATCHED,
    Session,
    SocketOptions,
    run_session,
)
from motorctl_benchmarks.control_socket.viewers import VIEWERS
from motorctl_benchmarks.findings import Findings, TextTable

LATE_S = 100e-6
AS_IT_WAS = Target("ratio", ">=", 0.8)
"""The share stays what it was within a quarter, besides what the quiet spells differ in."""
WORKERS_NOTE = (
    "The kernel's own workers may run on the loop's CPU, and finish there what was "
    "written: `motorctl latency` says how to keep them off."
)
STOPPED = Target("value", "<=", 500.0)
"""Whoever calls an emergency stop over the socket is answered within half a second."""


def socket_findings(progress: Progress, options: SocketOptions) -> Findings:
    """Run the session and tell it. Raises RunError where the daemon or the crowd fails to start."""
    return findings_of(run_session(options, progress), options)


def findings_of(session: Session, options: SocketOptions) -> Findings:
    """Return figures, table and failures of a session."""
    figures = (
        _figure("late_crowd", "ticks later than 100 us under the crowd", session, CROWD),
        _figure("late_scope", "ticks later than 100 us, scope with viewers", session, WATCHED),
        _figure("late_logs", "ticks later than 100 us while logs are made", session, CONVERTING),
        Figure("answer_median", "answer to an asker: median", _wait_ms(session, 50), "ms"),
        Figure("answer_p99", "answer to an asker: p99", _wait_ms(session, 99), "ms"),
        *_stop_figures(session),
        Figure("fuzzed_bytes", "fuzzed bytes taken", session.told.fuzzed_bytes / 1e6, "MB"),
        Figure("served_at_once", "clients served at once", session.told.most_at_once, ""),
    )
    notes = (
        f"{options.rounds} rounds of {options.spell_s:g} s each, in turn; the daemon runs "
        f"{options.config}, both axes on their programs.",
        *(
            [f"All else is kept off the loop's CPU {cpu}."]
            if (cpu := options.loop_cpu) is not None
            else []
        ),
        f"While logs are made: {session.logs_made} of all that was recorded so far, in a row.",
        f"The scope: {VIEWERS} viewers drew {session.watched.drawings} times, one asked and never "
        f"read; {session.watched.rows_lost} rows were lost to it, to the log {session.rows_lost}.",
        "A share says how the computer is as much as how motorctl is: compare within a run only. "
        "That of the quiet spells has the standard error of a difference of two of them added.",
        *([WORKERS_NOTE] if session.beside_kernel_workers else []),
    )
    told = {key: value for key, value in asdict(session.told).items() if key != "waits_s"}
    troubles = [{"case": "socket", "truth": "none", "answer": said} for said in session.troubles]
    return Findings(
        figures,
        notes,
        tuple(troubles),
        {
            "told": told,
            "rows_lost": session.rows_lost,
            "logs_made": session.logs_made,
            "spells": _plain(session),
        },
        (_table(session), _told_table(session)),
        failed=bool(troubles) or session.rows_lost > 0,
    )


def _figure(name: str, title: str, session: Session, kind: str) -> Figure:
    """Return a share beside that of the quiet spells, with their standard error of a difference.

    That is what the means of two kinds differ in if both are quiet: a spell has a few late ticks in
    a hundred thousand, so two quiet ones may differ tenfold. How much those of the other kind
    differ excuses nothing.
    """
    quiet, late = (_shares(session, each) for each in (QUIET, kind))
    error = np.std(quiet, ddof=1) * (2 / len(quiet)) ** 0.5 if len(quiet) > 1 else 0.0
    share, beside = float(np.mean(late)), float(np.mean(quiet) + error)
    ratio = beside / share if share else 1.0
    return Figure(name, title, 100 * share, "%", "left alone", 100 * beside, ratio, AS_IT_WAS)


def _shares(session: Session, kind: str) -> list[float]:
    """Return the share of late ticks in each spell of a kind."""
    return [spell.share_later_than(LATE_S) for spell in session.spells if spell.kind == kind]


def _stop_figures(session: Session) -> tuple[Figure, ...]:
    stops_ms = 1e3 * np.array(session.stops_s or [np.nan])
    return tuple(
        Figure(
            f"estop_{name}", f"emergency stop into the crowd: {name}", value, "ms", target=target
        )
        for name, value, target in (
            ("median", float(np.median(stops_ms)), None),
            ("p99", float(np.percentile(stops_ms, 99)), None),
            ("worst", float(np.max(stops_ms)), STOPPED),
        )
    )


def _wait_ms(session: Session, percent: float) -> float:
    """Return a percentile of what clients waited that ask ten times a second."""
    waits_s = session.told.waits_s
    return float(1e3 * np.percentile(waits_s, percent)) if waits_s else float("nan")


def _table(session: Session) -> TextTable:
    rows = []
    for kind in KINDS:
        spells = [spell for spell in session.spells if spell.kind == kind]
        ticks = np.concatenate([spell.lateness_s for spell in spells])
        each = ", ".join(f"{100 * spell.share_later_than(LATE_S):.3f}" for spell in spells)
        rows.append(
            (
                kind,
                f"{len(ticks):,}",
                f"{100 * np.mean(ticks > LATE_S):.3f}",
                each,
                f"{100 * np.mean(ticks > session.period_s):.3f}",
                f"{1e6 * np.median(ticks):.1f}",
                f"{1e3 * np.max(ticks):.2f}",
            )
        )
    columns = (
        "the daemon is",
        "ticks",
        "later than 100 us, %",
        "of each spell, %",
        "later than a period, %",
        "median, us",
        "worst, ms",
    )
    return TextTable("Late ticks of the loop", columns, tuple(rows))


def _told_table(session: Session) -> TextTable:
    told = session.told
    row = (
        f"{told.connections:,}",
        str(told.most_at_once),
        f"{told.refused:,}",
        f"{told.answers:,}",
        f"{told.refusals:,}",
        str(told.mistakes),
        f"{told.fuzzed_bytes:,}",
        ", ".join(f"{_wait_ms(session, percent):.0f}" for percent in (50, 99, 100)),
        ", ".join(f"{figure.value:.0f}" for figure in _stop_figures(session)),
        str(session.rows_lost),
    )
    columns = (
        "connections",
        "served at once",
        "refused: one user's limit",
        "answers",
        "refusals of rubbish",
        "mistakes of ours",
        "fuzzed bytes",
        "an asker waits, ms: median, p99, worst",
        "an emergency stop takes, ms: median, p99, worst",
        "rows lost",
    )
    return TextTable("What the crowd was told", columns, (row,))


def _plain(session: Session) -> list[dict[str, object]]:
    return [
        {
            "kind": spell.kind,
            "ticks": len(spell.lateness_s),
            "share_later_than_100_us": spell.share_later_than(LATE_S),
            "share_later_than_a_period": spell.share_later_than(session.period_s),
        }
        for spell in session.spells
    ]
