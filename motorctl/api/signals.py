"""Columns by the names that logs have: what a log and what comes from a running daemon share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import UsageError
from motorctl.notebook import pandas

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[Any]
POSITION = ".position_m"


class Signals(Mapping[str, Array]):
    """Arrays of shape (N,) by the names of their columns: ``signals["x.position_m"]``.

    `time_s` is the common time [s]. The arrays are read-only.
    """

    units: Mapping[str, str]
    """By column: m, V, …; empty for counts, codes, and parameters, each of which has its own."""
    descriptions: Mapping[str, str]
    """By column, in words."""

    @property
    @abstractmethod
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""

    @abstractmethod
    def _column(self, name: str) -> Array:
        """Return an existing column."""

    def __getitem__(self, name: str) -> Array:
        self._must_have(name)
        return self._column(name)

    def _must_have(self, name: str) -> None:
        if name not in self.columns:
            raise KeyError(f"no column '{name}'; there are: {', '.join(self.columns)}")

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Time of each row [s], shape (N,)."""
        return self["time_s"]

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes."""
        return tuple(n.removesuffix(POSITION) for n in self.columns if n.endswith(POSITION))

    def to_pandas(self, columns: Sequence[str] | None = None) -> pd.DataFrame:
        """Return a pandas DataFrame over `time_s`; its `attrs["units"]` are the columns' units.

        Parameters
        ----------
        columns
            Which columns; None: all, which of a long log takes gigabytes.

        Returns
        -------
        DataFrame
            A row a sample.

        Raises
        ------
        UsageError
            Where pandas is not installed, or there is no such column.
        """
        wanted = self.columns if columns is None else columns
        if missing := [name for name in wanted if name not in self.columns]:
            raise UsageError(f"no column '{missing[0]}'; there are: {', '.join(self.columns)}")
        module = pandas()
        kept = {name: self[name] for name in wanted if name != "time_s"}
        frame: pd.DataFrame = module.DataFrame(kept, index=module.Index(self.time_s, name="time_s"))
        frame.attrs["units"] = {name: self.units.get(name, "") for name in kept}
        return frame
