"""Spectra of columns that are asked for again and again, as the forms of a scan are.

What a recording's motion makes of a form of an effect depends on neither the filter nor on what
else a model has: it is the same in every round of a search, on twins and behind another filter.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Spectrum = tuple[NDArray[np.complex128], int]
"""The spectra of columns over a stretch, (p, f), and the number of rows they stand for."""
Spectra = tuple[Spectrum, ...]
"""For each stretch."""

MOST_BYTES = 250_000_000
"""Memory that is used at most [B]. Larger leaves less to the columns themselves, smaller forms
columns of long recordings anew in every round. Chosen by hand: a search of 24 s keeps 120 MB."""


class KeptSpectra:
    """Spectra by what they are of; those that were not asked for longest go first."""

    def __init__(self) -> None:
        self._kept: OrderedDict[Hashable, tuple[Spectra, object]] = OrderedDict()
        self._bytes = 0

    def of(
        self,
        key: Hashable,
        form: Callable[[], Spectra],
        acceleration: Sequence[NDArray[Any]] | None = None,
    ) -> Spectra:
        """Return what is kept under a key, formed where nothing is.

        Parameters
        ----------
        key
            What the spectra are of.
        form
            Forms them.
        acceleration
            The very arrays that they were formed on, where they depend on such: what was formed on
            others is not returned.

        Returns
        -------
        Spectra
            As `form` returned them.
        """
        key = (key, id(acceleration))
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key][0]
        spectra = form()
        self._bytes += _size(spectra)
        self._kept[key] = spectra, acceleration  # held, so that its id stays its own
        while self._bytes > MOST_BYTES:
            _, (old, _) = self._kept.popitem(last=False)
            self._bytes -= _size(old)
        return spectra


def _size(spectra: Spectra) -> int:
    return sum(spectrum.nbytes for spectrum, _ in spectra)
