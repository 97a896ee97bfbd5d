"""The rounds as a page with tables and pictures, and each round's own report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from motorctl.close_loop.json_document import effects_added
from motorctl.close_loop.judge import MOTION_WORDS, AxisJudgement
from motorctl.close_loop.rounds import ClosedLoop, Round
from motorctl.close_loop.run_folder import PAGE, PICTURE
from motorctl.close_loop.tables import attempt_words, error_row, telling_words, tracking_table
from motorctl.errors import UsageError
from motorctl.html_pages import Figure, figure, write_page
from motorctl.identify.compare.measures import EXPLAINED, table_headings
from motorctl.identify.compare.pictures import plot_tracking_error
from motorctl.identify.compare.runs import Comparison, compare
from motorctl.identify.diagnose.report.page import TrackedAxis, TrackingComparison, write_report


def write_reports(loop: ClosedLoop) -> Path:
    """Write the page of all rounds and a report of each, and return the page.

    Raises UsageError where they cannot be written.
    """
    reports = {part.number: _write_round(part) for part in loop.rounds}
    page = loop.folder / PAGE
    try:
        pictures = list(_pictures(loop))
    except OSError as error:
        raise UsageError(f"{loop.folder}: cannot be written: {error.strerror}") from error
    write_page(
        page,
        "motorctl.close_loop",
        PAGE,
        name=loop.first.machine.name,
        config=str(loop.config),
        refined=loop.refined.name,
        ended=loop.ended,
        measures=EXPLAINED,
        axes=[
            _axis(name, effects_added(loop, name), judged) for name, judged in loop.overall.items()
        ],
        pictures=pictures,
        velocity=[
            _axis(name, (), judged)
            for name, judged in (loop.velocity.judgements.items() if loop.velocity else ())
        ],
        velocity_kept=sorted(loop.velocity.kept) if loop.velocity else [],
        rounds=[_round(part, reports[part.number], loop.folder) for part in loop.rounds],
    )
    return page


def _write_round(part: Round) -> Path:
    tried = part.attempts.tried
    attempt = part.accepted or (tried[-1] if tried else None)
    judgements = part.attempts.shares or ({} if attempt is None else attempt.judgements)
    return write_report(
        part.folder,
        part.diagnosis,
        comparison=None if attempt is None else _comparison(judgements),
        config_change=None if attempt is None else attempt.refinement.diff,
    )[0]


def _comparison(judgements: Mapping[str, AxisJudgement]) -> TrackingComparison:
    rows = [
        TrackedAxis(MOTION_WORDS[motion], name, first, second)
        for name, judgement in judgements.items()
        for motion, (first, second) in judgement.tracking.items()
    ]
    return TrackingComparison(tuple(rows))


def _pictures(loop: ClosedLoop) -> Iterator[Figure]:
    """Draw the tracking error before and after on each motion."""
    if loop.first is loop.last:
        return
    for motion, before in loop.first.recordings.items():
        compared = compare([before, loop.last.recordings[motion]])
        runs = [
            replace(run, label=label)
            for run, label in zip(compared.runs, ("before", "after"), strict=True)
        ]
        comparison = Comparison(tuple(runs), compared.axes)
        for axis in comparison.axes:
            if axis not in loop.first.measures[motion]:
                continue
            file = loop.folder / PICTURE.format(axis=axis, motion=motion)
            plot_tracking_error(comparison, axis, file)
            title = f"Tracking error of axis {axis} on {MOTION_WORDS[motion]}"
            yield figure(file, title=title)


def _axis(name: str, effects: Sequence[str], judgement: AxisJudgement) -> dict[str, Any]:
    tables = tracking_table(judgement)
    return {
        "name": name,
        "effects": effects,
        "headings": table_headings(judgement.units.position),
        "groups": [[[words, *cells] for words, cells in group] for group in tables],
        "error": error_row(judgement),
    }


def _round(part: Round, report: Path, folder: Path) -> dict[str, Any]:
    attempt = part.accepted
    return {
        "number": part.number,
        "motion": MOTION_WORDS[part.motion],
        "report": report.relative_to(folder).as_posix(),
        "config": "" if attempt is None else attempt.refinement.out.relative_to(folder).as_posix(),
        "verdicts": [(name, axis.sentence) for name, axis in part.diagnosis.axes.items()],
        "refused": list(part.diagnosis.refused.items()),
        "telling": [] if part.telling is None else telling_words(part.telling),
        "left_out": [
            (name, words)
            for name, all_words in part.attempts.dropped.items()
            for words in all_words
        ],
        "attempts": [attempt_words(tried) for tried in part.attempts.tried],
        "axes": [
            _axis(name, part.added(name), judgement)
            for name, judgement in part.attempts.shares.items()
        ],
        "diff": "" if attempt is None else attempt.refinement.diff,
    }
