"""Windows of logs before and after a change, fitted again where they can be held together."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from motorctl.errors import DataError, MotorctlError
from motorctl.fleet.head import Declared, identity_of
from motorctl.fleet.leftovers import Leftovers
from motorctl.fleet.paths import opened
from motorctl.fleet.series import Seen
from motorctl.identify.columns.measured import SIGNALS, with_others
from motorctl.identify.fit.declared_models import declared_models
from motorctl.identify.fit.recording import fit_axis
from motorctl.identify.fit.result import AxisFit
from motorctl.identify.fit.settings import FitOptions
from motorctl.log.parquet_pieces import ParquetPieces
from motorctl.log.read import recording_of
from motorctl.log.row_groups import RowGroupTable
from motorctl.long_logs.footer import moved_in, times_of
from motorctl.long_logs.windows import MOST_ROWS
from motorctl.model.columns import form_key

SAME_MOTION = 0.03
"""Part of the way, and of the top speed, by which percentiles of places and of speeds may differ
under one program. Larger takes other motions for the same, smaller refuses what is repeated less
exactly. Chosen by hand."""
MOST_UNLIKE = 5
"""Percentiles of 99 that may differ by more: those between two speeds of a program, or two places,
jump with its timing. Larger overlooks rare moves, smaller refuses the same program. Chosen by
hand."""


@dataclass(frozen=True)
class _Said:
    """What a log says that it is of, as far as two must agree."""

    source: str
    model: tuple[tuple[str, str], ...]
    programs: str

    def check_as(self, other: _Said) -> None:
        """Raise DataError where what is left in the two cannot be held beside each other."""
        for what, differs in (
            ("models", self.model != other.model),
            ("programs", self.programs != other.programs),
        ):
            if differs:
                raise DataError(
                    f"the logs declare different {what}: {other.source} and {self.source}"
                )


def left_before_and_after(
    before: Sequence[Seen], after: Sequence[Seen], axis: str, declared: Declared
) -> tuple[Leftovers, Leftovers]:
    """Return what the fits leave in windows before a change and after it, in one band.

    Parameters
    ----------
    before, after
        Windows of one axis of one machine, under one program. Those that cannot be read are left
        out.
    axis
        Its name.
    declared
        Which model is meant.

    Raises
    ------
    DataError
        Where a side has no window that can be read, or the logs declare different models or
        programs, or their motions differ.
    """
    said: list[_Said] = []
    band: list[FitOptions] = []

    def fits(side: Sequence[Seen]) -> Iterator[AxisFit]:
        unread: MotorctlError | None = None
        any_read = False
        for seen in side:
            try:
                fit, own = _fitted(seen, axis, declared, band[0] if band else None)
            except MotorctlError as error:
                unread = unread or error
                continue
            except OSError as error:
                unread = unread or DataError(f"{seen.source}: {error}")
                continue
            if said:
                own.check_as(said[0])
            said.append(own)
            band.append(FitOptions(filter_hz=fit.options.filter_hz))
            any_read = True
            yield fit
        if not any_read:
            raise DataError(str(unread or "there is no window")) from unread

    earlier, later = Leftovers(fits(before)), Leftovers(fits(after))
    _check_motions(earlier, later)
    return earlier, later


def _check_motions(earlier: Leftovers, later: Leftovers) -> None:
    """Raise DataError where the motions before and after are not those of one program."""
    sides = (earlier, later)
    way = max(each.way for each in sides)
    top = max(float(np.max(each.speed)) for each in sides)
    places = [each.position[each.moving] for each in sides]
    speeds = [each.speed[each.moving] for each in sides]
    each_percent = np.arange(1.0, 100.0)
    for what, whole, values in (("places", way, places), ("speeds", top, speeds)):
        then, now = (np.percentile(each, each_percent) for each in values)
        apart = np.abs(then - now)
        if np.count_nonzero(apart > SAME_MOTION * whole) > MOST_UNLIKE:
            k = int(np.argmax(apart))
            raise DataError(
                f"the axis moved otherwise before than after: percentile {each_percent[k]:.0f} of "
                f"its {what} was {then[k]:.3g}, and is {now[k]:.3g}"
            )


def _fitted(
    seen: Seen, axis: str, declared: Declared, options: FitOptions | None
) -> tuple[AxisFit, _Said]:
    """Fit a window of a log again. Raises DataError where it is not there any more."""
    if identity_of(seen.source) != seen.log_id:
        raise DataError(f"{seen.source}: is another log by now than the one that was looked at")
    with opened(seen.source) as file:
        pieces = ParquetPieces(seen.source, file)
        groups = _moving_groups(seen, axis, pieces, file.group_rows)
        recording = recording_of(RowGroupTable(seen.source, file, groups), "keep", SIGNALS)
    config = recording.metadata["config"]
    machine = declared.machine(config, seen.source)
    model = declared_models(recording, declared.model, axis, machine=machine)[axis]
    own = _Said(
        seen.source, tuple(form_key(effect) for effect in model.effects), _programs(config, axis)
    )
    return fit_axis(with_others(recording, axis), model, options), own


def _moving_groups(
    seen: Seen, axis: str, pieces: ParquetPieces, group_rows: Sequence[int]
) -> list[int]:
    """Return the row groups of a window in which the axis moved, of so many rows at most.

    Raises DataError where it moved in none.
    """
    inside = np.array(moved_in(pieces, axis), np.bool_)
    if seen.begin_s is not None and seen.end_s is not None:
        begins, ends = times_of(seen.source, pieces)
        inside &= (ends >= seen.begin_s) & (begins <= seen.end_s)
    moved = np.flatnonzero(inside)
    if not len(moved):
        raise DataError(f"{seen.source}: axis {axis} did not move in the window looked at")
    rows = np.cumsum(np.asarray(group_rows)[moved])
    count = max(1, int(np.searchsorted(rows, MOST_ROWS, side="right")))
    return [int(group) for group in moved[:count]]


def _programs(config: Mapping[str, Any], axis: str) -> str:
    """Return what an axis is to follow, as text that is equal for equal programs."""
    own = (config.get("axes") or {}).get(axis) or {}
    return json.dumps([own.get("program"), config.get("programs")], sort_keys=True, default=str)
