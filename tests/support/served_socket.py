"""A control socket whose server runs in a thread of its own."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from motorctl.daemon.access import ControlSocket
from motorctl.daemon.server import ControlServer, Handler


@contextmanager
def served(place: Path, handle: Handler) -> Iterator[Path]:
    """Serve a control socket at a place, its requests answered by `handle`, until this ends."""
    ready, events, stop = threading.Event(), asyncio.new_event_loop(), asyncio.Event()

    async def serve() -> None:
        control = ControlSocket(place)
        server = ControlServer(control, handle)
        await server.start()
        ready.set()
        await stop.wait()
        await server.close()
        control.close()

    thread = threading.Thread(target=events.run_until_complete, args=(serve(),))
    thread.start()
    ready.wait()
    yield place
    events.call_soon_threadsafe(stop.set)
    thread.join()
    events.close()
