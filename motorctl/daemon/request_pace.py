"""How fast one connection may ask: who asks faster waits, and takes no time from the others."""

from __future__ import annotations

REQUESTS_PER_S = 100.0
"""Requests a second that are answered without a wait, in the long run. A page that draws a machine
asks twenty times a second; a status takes about 0.3 ms to make."""
BURST = 200.0
"""Requests that may come at once, as a script's after a pause."""


class RequestPace:
    """Counts one connection's requests.

    Parameters
    ----------
    now_s
        The time of the connection's beginning, by any steady clock [s].
    """

    def __init__(self, now_s: float) -> None:
        self._due_s = now_s - BURST / REQUESTS_PER_S

    def wait_s(self, now_s: float) -> float:
        """Take a request into account and return how long its answer has to wait [s]."""
        self._due_s = max(self._due_s, now_s - BURST / REQUESTS_PER_S) + 1.0 / REQUESTS_PER_S
        return max(self._due_s - now_s, 0.0)
