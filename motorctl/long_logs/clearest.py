"""What is read of each axis of a long log, once all of it was scanned."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from motorctl.identify.diagnose.read_stretches import (
    CLEAREST,
    MOST_LEFT,
    NOTHING_CLEAR,
    ReadStretches,
    Stretch,
)
from motorctl.log.timebase import MINIMUM_ROWS
from motorctl.long_logs.choice import MUCH_MORE, clearest_within, most_left_and_clearest
from motorctl.long_logs.excitation import Excitation, Usual, usual_of
from motorctl.long_logs.long_log import LongLog
from motorctl.long_logs.windows import Window, windows_of
from motorctl.model import EffectList

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Clearest:
    """What is read of an axis: windows by part, and what is told of them."""

    groups: Mapping[int, Sequence[int]]
    read: ReadStretches

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what a verdict on these must not be read without."""
        return () if self.read.unread is None else (self.read.unread,)


def clearest_of(
    log: LongLog,
    models: Mapping[str, EffectList],
    most_rows: int,
    progress: Progress | None = None,
    *,
    by_motion_alone: bool = False,
) -> dict[str, Clearest | None]:
    """Scan a long log, and choose of each axis what is read of it.

    A share of the rows are those of windows in which the declared model leaves most, the others of
    windows whose motion tells most, spread over time.

    Parameters
    ----------
    log
        What is scanned.
    models
        What is declared of each axis that is asked for.
    most_rows
        Of an axis.
    progress
        Told the share of rows that was scanned.
    by_motion_alone
        Nothing is read because the model leaves much there.

    Returns
    -------
    dict
        By axis; without `candidates` where it moved, but no motion tells a parameter; None where
        it never moved.
    """
    told: dict[str, list[list[Excitation | None]]] = {
        axis: [[] for _ in log.parts] for axis in models
    }
    done = 0
    for part, group, found in log.scanned(list(models), lambda _: models):
        for axis, excitation in found.items():
            told[axis][part].append(excitation)
        done += log.parts[part].group_rows[group]
        if progress is not None:
            progress(f"scanning {log.source}", done / log.rows)
    return {
        axis: _Scanned(log, axis, models[axis], told[axis]).chosen(most_rows, by_motion_alone)
        for axis in models
    }


@dataclass(frozen=True)
class _Scanned:
    """What the scan told of an axis."""

    log: LongLog
    axis: str
    model: EffectList
    told: Sequence[Sequence[Excitation | None]]
    """By part and row group."""

    @cached_property
    def usual(self) -> Usual | None:
        """What holds for all parts."""
        return usual_of(each for part in self.told for each in part)

    def windows(self) -> list[tuple[int, Window]]:
        """Return part and window of all that tells a parameter, in order of time."""
        found: list[tuple[int, Window]] = []
        first_row = 0
        for k, part in enumerate(self.log.parts):
            own = windows_of(
                self.axis,
                part.group_rows,
                self.told[k],
                self.log.head.period_s,
                len(found),
                first_row,
                self.usual,
            )
            found += [(k, window) for window in own]
            first_row += part.rows
        return found

    def chosen(self, most_rows: int, by_motion_alone: bool) -> Clearest | None:
        """Return what is read."""
        windows = self.windows()
        if not windows:
            return self._moving(most_rows)
        of_axis = [window for _, window in windows]
        reserved: list[Window] = []
        if by_motion_alone:
            others = clearest_within(of_axis, most_rows)
        else:
            reserved, others = most_left_and_clearest(of_axis, most_rows)
        why = dict.fromkeys((each.number for each in reserved), MOST_LEFT)
        groups: dict[int, list[int]] = defaultdict(list)
        stretches = []
        for window in sorted([*reserved, *others], key=lambda each: each.number):
            k, _ = windows[window.number]
            groups[k] += window.groups
            stretches.append(
                self._stretch(
                    k,
                    window.groups,
                    window.vagueness,
                    window.left_rms,
                    why.get(window.number, CLEAREST),
                )
            )
        unread = self._unread(groups, [each.left_rms for each in (*reserved, *others)])
        return Clearest(
            groups, ReadStretches(tuple(stretches), self.log.rows, len(windows), unread)
        )

    def _moving(self, most_rows: int) -> Clearest | None:
        """Return rows in which the axis moves, though that tells nothing: a diagnosis says why."""
        moving = [
            (-(told.products.rows if told else 0), k, group)
            for k, part in enumerate(self.log.parts)
            for group, told in enumerate(self.told[k])
            if part.moved[self.axis][group] and part.group_rows[group] >= MINIMUM_ROWS
        ]
        groups: dict[int, list[int]] = defaultdict(list)
        rows = 0
        for _, k, group in sorted(moving):
            more = self.log.parts[k].group_rows[group]
            if rows and rows + more > most_rows:
                break
            groups[k].append(group)
            rows += more
        if not groups:
            return None
        stretches = [
            self._stretch(k, (group,), self._vagueness(k, group), None, NOTHING_CLEAR)
            for k in sorted(groups)
            for group in sorted(groups[k])
        ]
        return Clearest(groups, ReadStretches(tuple(stretches), self.log.rows, 0))

    def _vagueness(self, k: int, group: int) -> Sequence[float]:
        told = self.told[k][group]
        if told is None or self.usual is None:
            return [math.inf] * len(self.model.parameter_names)
        return [float(each) for each in told.vagueness(self.usual.variance)]

    def _unread(
        self, groups: Mapping[int, Sequence[int]], in_windows: Sequence[float]
    ) -> str | None:
        """Tell of row groups in which much more is left than in all that are read."""
        if self.usual is None:
            return None
        theta = self.usual.theta
        left = {
            (k, group): told.left_rms(theta)
            for k, part in enumerate(self.told)
            for group, told in enumerate(part)
            if told is not None and told.tells
        }
        read = {(k, group) for k, own in groups.items() for group in own}
        most = MUCH_MORE * max([*in_windows, *(left[key] for key in read & left.keys())])
        beyond = [key for key in left if key not in read and left[key] > most]
        if not beyond:
            return None
        k, group = max(beyond, key=lambda key: left[key])
        part = self.log.parts[k]
        rows = sum(self.log.parts[k].group_rows[group] for k, group in beyond)
        return (
            f"{rows} rows of {self.log.source} were not looked at, though the declared model "
            f"leaves more than {MUCH_MORE:g} times as much there as in any that were, most of it "
            f"from {part.begins_s[group]:.1f} s to {part.ends_s[group]:.1f} s in {part.path.name}: "
            "the verdict does not speak of these"
        )

    def _stretch(
        self,
        k: int,
        groups: Sequence[int],
        vagueness: Sequence[float],
        left_rms: float | None,
        why: str,
    ) -> Stretch:
        part, worst = self.log.parts[k], int(np.argmax(vagueness))
        return Stretch(
            log=str(part.path),
            begin_s=float(part.begins_s[groups[0]]),
            end_s=float(part.ends_s[groups[-1]]),
            rows=sum(part.group_rows[group] for group in groups),
            vaguest=self.model.parameter_names[worst],
            vagueness=vagueness[worst],
            left_rms=left_rms,
            why=why,
        )
