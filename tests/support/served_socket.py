"""A control socket whose server runs in a thread of its own."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from motorctl.daemon.access import ControlSocket, Peer, Role
from motorctl.daemon.server import ControlServer, Handler


class _Admits(ControlSocket):
    """Has the test say what whoever connects may do."""

    def __init__(self, place: Path, role: Callable[[], Role]) -> None:
        super().__init__(place)
        self._role = role

    def role_of(self, peer: Peer) -> Role:
        return self._role()


def _operates() -> Role:
    return Role.OPERATE


@contextmanager
def served(
    place: Path,
    handle: Handler,
    role: Callable[[], Role] = _operates,
    open_samples: Callable[[], int] | None = None,
) -> Iterator[Path]:
    """Serve a control socket at a place, its requests answered by `handle`, until this ends.

    role is asked what the client that connects next may do; `open_samples` as of `ControlServer`.
    """
    ready, events, stop = threading.Event(), asyncio.new_event_loop(), asyncio.Event()

    async def serve() -> None:
        control = _Admits(place, role)
        server = ControlServer(control, handle, open_samples)
        await server.start()
        ready.set()
        await stop.wait()
        await server.close()
        control.close()

    thread = threading.Thread(target=events.run_until_complete, args=(serve(),))
    thread.start()
    ready.wait()
    try:
        yield place
    finally:
        events.call_soon_threadsafe(stop.set)
        thread.join()
        events.close()
