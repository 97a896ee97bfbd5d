"""Work in a thread that the end of the process does not wait for."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

Result = TypeVar("Result")


def left_alone(what: str, work: Callable[[], Result]) -> asyncio.Future[Result]:
    """Do some work in a thread; who no longer wants it leaves it, and it ends with the process.

    asyncio's own threads are waited for at the end of the process, however long they take.

    Parameters
    ----------
    what
        Names the thread.
    work
        What is done.

    Returns
    -------
    asyncio.Future
        What the work returns or raises.
    """
    done: Future[Result] = Future()
    done.set_running_or_notify_cancel()

    def run() -> None:
        try:
            done.set_result(work())
        except BaseException as error:
            done.set_exception(error)

    threading.Thread(target=run, name=what, daemon=True).start()
    return asyncio.wrap_future(done)
