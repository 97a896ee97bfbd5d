"""An order to end that comes before the daemon's event loop can take it."""

from __future__ import annotations

import signal
from typing import Self

ORDERS = (signal.SIGTERM, signal.SIGINT)


class EarlyStop:
    """Remembers such an order while it is entered.

    It raises nothing: an exception may come up in the middle of a library's callback, which drops
    it, and the daemon would go on as if nobody had asked.
    """

    def __init__(self) -> None:
        self.asked = False
        """Whether one came."""
        self._before = {number: signal.getsignal(number) for number in ORDERS}

    def __enter__(self) -> Self:
        for number, handler in self._before.items():
            if handler is not signal.SIG_IGN:
                signal.signal(number, self._take)
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the signals to whom they were, where the event loop did not come to take them."""
        for number, handler in self._before.items():
            if signal.getsignal(number) == self._take:
                signal.signal(number, handler)

    def _take(self, number: int, frame: object) -> None:
        self.asked = True
