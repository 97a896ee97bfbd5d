"""A trouble that lasts is told once, not each time that it is met."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable

WELL_FOR_S = 10.0
"""How long nothing may be wrong before a spell of trouble is over [s]. Shorter: a disk that takes
rows now and then fills the journal. Longer: its end is told so much later. Chosen by hand."""
MOST_WELL_FOR_S = 600.0
"""What it grows to, twofold each time, where one spell follows another within that time [s]: what
comes and goes all day is told six times an hour. Chosen by hand."""
_NUMBERS = re.compile(r"\d[\w.,:-]*")


class Spell:
    """A time in which something is wrong, with what of it is news.

    Each cause is news once in a spell, and the spell's end is. Texts that differ only in numbers,
    as do megabytes that are free and the time in the name of the next log, tell one cause.

    Parameters
    ----------
    well_for_s
        How long nothing must be wrong before the spell is over [s]; None: WELL_FOR_S. Longer where
        one spell follows another.
    clock
        Asked for the time [s].
    """

    def __init__(
        self, well_for_s: float | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._least_s = self._well_for_s = WELL_FOR_S if well_for_s is None else well_for_s
        self._clock = clock
        self._told: set[str] = set()
        self._wrong_s = self._over_s = -math.inf

    def is_news(self, text: str | None) -> bool:
        """Tell whether to say now what is wrong; with None, whether to say that it is over."""
        now_s = self._clock()
        if text is None:
            over = bool(self._told) and now_s - self._wrong_s >= self._well_for_s
            if over:
                self._told.clear()
                self._over_s = now_s
            return over
        if not self._told:
            again = now_s - self._over_s < MOST_WELL_FOR_S
            longer_s = min(2.0 * self._well_for_s, MOST_WELL_FOR_S)
            self._well_for_s = longer_s if again else self._least_s
        self._wrong_s = now_s
        cause = _NUMBERS.sub("#", text)
        if cause in self._told:
            return False
        self._told.add(cause)
        return True
