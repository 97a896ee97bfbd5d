"""A UDP socket on loopback that takes JSON as PlotJuggler does."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

PLACE = "127.0.0.1"


@contextmanager
def listening(received: list[dict[str, Any]]) -> Iterator[str]:
    """Take datagrams as PlotJuggler's UDP server does, and yield where."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as server:
        server.bind((PLACE, 0))
        server.settimeout(0.05)
        done = threading.Event()

        def take() -> None:
            while True:
                try:
                    received.append(json.loads(server.recv(1 << 16)))
                except TimeoutError:
                    if done.is_set():
                        return

        thread = threading.Thread(target=take)
        thread.start()
        try:
            yield f"udp://{PLACE}:{server.getsockname()[1]}"
        finally:
            done.set()
            thread.join()
