"""Go through a long log row group by row group: how much does the motion in each of them tell."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from motorctl.identify.columns.measured import SIGNALS, with_others
from motorctl.identify.fit.settings import FitOptions
from motorctl.log import Recording
from motorctl.log.opened_parquet import OpenedParquet
from motorctl.log.parquet_pieces import ParquetPieces
from motorctl.log.read import recording_of
from motorctl.log.row_groups import RowGroupTable
from motorctl.log.timebase import MINIMUM_ROWS
from motorctl.long_logs.excitation import Excitation, excitation_of
from motorctl.long_logs.footer import furthest_in
from motorctl.model import EffectList

ModelsOf = Callable[[Recording], Mapping[str, EffectList]]
Told = Mapping[str, Excitation | None]
"""Of each axis what a row group tells; None: nothing."""


def scanned(
    source: str,
    file: OpenedParquet,
    moved: Mapping[str, Sequence[bool]],
    groups: Sequence[int],
    models_of: ModelsOf,
) -> Iterator[Told]:
    """Yield what the motion in each of some row groups tells, of each axis.

    They are read one by one; those in which the file itself says that an axis did not move are not
    read for it, nor those of fewer rows than a recording needs. The choices of a fit, as its band,
    are those of the row group in which the axis went furthest: rest says nothing of them.

    Parameters
    ----------
    source, file
        What messages call the log; the log, open.
    moved
        Of each axis that is asked for, in which row groups its position changed.
    groups
        Their indices, ascending.
    models_of
        What is declared of each axis; asked once, with the first rows that are read.

    Raises
    ------
    DataError
        Where a row group cannot be read, or its rows are no recording.
    """
    options: dict[str, FitOptions | None] = {}
    models: Mapping[str, EffectList] | None = None
    pieces = ParquetPieces(source, file)
    for k in groups:
        told: dict[str, Excitation | None] = dict.fromkeys(moved)
        moving = [axis for axis in moved if moved[axis][k]]
        if moving and file.group_rows[k] >= MINIMUM_ROWS:
            recording = _read(source, file, k)
            if models is None:
                models = models_of(recording)
            for axis in moving:
                if axis not in options:
                    furthest = furthest_in(pieces, axis, MINIMUM_ROWS)
                    first = recording if furthest in (k, None) else _read(source, file, furthest)
                    _, options[axis] = excitation_of(with_others(first, axis), models[axis], None)
                data = with_others(recording, axis)
                told[axis], options[axis] = excitation_of(data, models[axis], options[axis])
        yield told


def _read(source: str, file: OpenedParquet, group: int) -> Recording:
    return recording_of(RowGroupTable(source, file, [group]), "keep", SIGNALS)
