"""The end of a run: what may take long with large logs is waited for, but not without end."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import TypeVar

from motorctl.daemon.left_alone import left_alone
from motorctl.daemon.notify import ServiceNotifier
from motorctl.errors import RunError

ENDING_LIMIT_S = 600.0
"""How long the end of a run may take altogether [s]. Shorter: a log that a slow disk would have
closed is left to the next start. Longer: a disk that hangs keeps the service from being started
again for as long. Chosen: a log of 2 GB, where a new one is begun, at a few megabytes a second."""
MORE_TIME_S = 10.0
"""How much time systemd is asked for again and again [s]. Shorter: a supervisor that gets no CPU is
killed in its work. Longer: one that hangs itself is killed so much later. Chosen."""

Result = TypeVar("Result")


class Ending:
    """Waits for the last works of a run, one after another, with one limit for all of them."""

    def __init__(self, notifier: ServiceNotifier) -> None:
        self._notifier = notifier
        self._began_s: float | None = None

    async def wait_for(self, what: str, work: Callable[[], Result]) -> Result:
        """Do some work in a thread; systemd is told that waiting for it is not in vain.

        Beyond the limit a work that takes a moment is still done.

        Parameters
        ----------
        what
            Names the work, for the message.
        work
            What is done. Where it is given up it is left alone, and ends with the process.

        Returns
        -------
        Result
            What the work returned.

        Raises
        ------
        RunError
            Where it is given up. What the work raises is passed on.
        """
        if self._began_s is None:
            self._began_s = time.monotonic()
        waited = left_alone(what, work)
        while not (await asyncio.wait({waited}, timeout=MORE_TIME_S / 4))[0]:
            if time.monotonic() - self._began_s > ENDING_LIMIT_S:
                waited.cancel()
                raise RunError(
                    f"{what}: given up, as the end of the run took longer than {ENDING_LIMIT_S:g} "
                    "s; does a disk hang? What was recorded is kept: the next start makes a log of "
                    "it, or `motorctl log recover`"
                )
            self._notifier.needs_time(MORE_TIME_S)
        return waited.result()
