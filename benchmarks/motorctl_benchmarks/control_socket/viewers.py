"""A scope beside a daemon, and viewers of its page: five that draw, and one that never reads."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote, urlsplit

from motorctl.errors import RunError
from motorctl_benchmarks.running_daemon import MAIN

VIEWERS = 5
DRAW_S = 0.1
"""Between two drawings of a page that follows the machine, which asks no more often."""
VIEW_S = 10.0
"""How much a page shows."""
PIXELS = 1600
"""Of a wide screen."""
COLUMNS = ("r_m", "y_m", "e_m", "u_v")
"""Each viewer draws these of every axis."""
READY_S = 60.0
"""A scope that takes longer to start has failed. Chosen by hand: it compiles nothing."""


@dataclass
class Watched:
    """What the viewers were told."""

    drawings: int = 0
    """Answers to a viewer that draws."""
    failed: list[str] = field(default_factory=list)
    """Questions that were not answered, a sentence each."""
    rows_lost: int = 0
    """That the scope was too late for."""


@contextmanager
def watching(control_socket: Path, captures: Path, watched: Watched) -> Iterator[None]:
    """Run a scope with its viewers while the body runs.

    Parameters
    ----------
    control_socket
        The daemon's.
    captures
        A folder for the scope; nothing is captured.
    watched
        What the viewers are told is added to it.

    Raises
    ------
    RunError
        Where the scope does not start.
    """
    command = [sys.executable, "-P", "-c", MAIN, "scope", "--socket", str(control_socket)]
    scope = subprocess.Popen(
        [*command, "--captures", str(captures)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    over = threading.Event()
    threads: list[threading.Thread] = []
    try:
        url = _address(scope)
        drawn = _drawn(url)
        threads = [
            threading.Thread(target=_draw, args=(url, drawn, watched, over)) for _ in range(VIEWERS)
        ]
        threads.append(threading.Thread(target=_never_read, args=(url, drawn, over)))
        for thread in threads:
            thread.start()
        yield
        live = json.loads(_asked(f"{url}api/live"))
        watched.rows_lost += int(live["lost"])
    finally:
        over.set()
        for thread in threads:
            thread.join()
        scope.terminate()
        scope.wait()
        if scope.stdout is not None:
            scope.stdout.close()


def _address(scope: subprocess.Popen[str]) -> str:
    """Return the page's address, which a scope says when it can be opened."""
    said: list[str] = []
    assert scope.stdout is not None
    late = threading.Timer(READY_S, scope.kill)
    late.start()
    try:
        for line in scope.stdout:
            said.append(line.strip())
            for word in line.split():
                if word.startswith("http://"):
                    return word
    finally:
        late.cancel()
    raise RunError(f"the scope did not start: {' '.join(said) or 'it said nothing'}")


def _drawn(url: str) -> str:
    """Return the columns that a viewer draws, as the page asks for them."""
    shown = json.loads(_asked(f"{url}api/logs"))["logs"][0]
    axes = shown["axes"]
    return quote(",".join(f"{axis}.{column}" for axis in axes for column in COLUMNS), safe=",")


def _question(url: str, columns: str) -> str:
    end_s = float(json.loads(_asked(f"{url}api/live"))["end_s"])
    begin_s = max(end_s - VIEW_S, 0.0)
    stretch = f"begin_s={begin_s:.4f}&end_s={end_s:.4f}"
    return f"{url}api/signals?log=0&{stretch}&pixels={PIXELS}&columns={columns}"


def _draw(url: str, columns: str, watched: Watched, over: threading.Event) -> None:
    while not over.is_set():
        began = time.monotonic()
        try:
            _asked(_question(url, columns))
            watched.drawings += 1
        except OSError as error:
            watched.failed.append(str(error))
        over.wait(max(DRAW_S - (time.monotonic() - began), 0.0))


def _never_read(url: str, columns: str, over: threading.Event) -> None:
    """Ask without end and take no answer: until what one may send is full, and again."""
    where = urlsplit(url)
    assert where.hostname is not None
    assert where.port is not None
    while not over.is_set():
        with suppress(OSError), socket.create_connection((where.hostname, where.port), 5) as stuck:
            question = urlsplit(_question(url, columns))
            line = f"GET {question.path}?{question.query} HTTP/1.1\r\nHost: {where.netloc}\r\n\r\n"
            while not over.is_set():
                stuck.sendall(line.encode())
                over.wait(DRAW_S)


def _asked(url: str) -> bytes:
    with urllib.request.urlopen(url, timeout=10) as answer:
        body: bytes = answer.read()
    return body
