"""The page `/metrics` that Prometheus reads: of a daemon that may be away, to whom may ask."""

from __future__ import annotations

import secrets
import socket
import threading
from collections.abc import Callable, Container, Iterable, Iterator
from concurrent.futures import Future
from functools import partial
from http import HTTPStatus
from pathlib import Path
from socketserver import ThreadingMixIn
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer, make_server

from prometheus_client import CollectorRegistry, make_wsgi_app
from prometheus_client.core import Metric
from prometheus_client.registry import Collector

from motorctl.api.connection import connect
from motorctl.api.off_the_loop import keep_off_the_loop
from motorctl.api.status import MachineStatus
from motorctl.errors import MotorctlError, RunError, UsageError
from motorctl.neighbours.metrics import down, metrics_of
from motorctl.own_names import is_own, name_of, needs_token, own_names

if TYPE_CHECKING:
    from wsgiref.types import StartResponse, WSGIApplication, WSGIEnvironment

PAGE = "/metrics"
SHORTEST_TOKEN = 16
"""Characters of a token that nobody guesses."""
HEADERS = (
    ("Content-Type", "text/plain; charset=utf-8"),
    ("X-Content-Type-Options", "nosniff"),
    ("Cache-Control", "no-store"),
)
ANSWER_S = 2.0
"""How long a scrape waits for the daemon [s]: an answer takes milliseconds, and Prometheus waits at
most as long as its interval is, which few choose below 5 s. One that came too late would be none,
and `motorctl_up` not be 0 though the daemon hangs."""
PATIENCE_S = 10.0
"""How long a client may take for its request [s]."""


class DaemonCollector(Collector):
    """Asks the daemon once a scrape, in a thread that none has to wait for longer than it may.

    Parameters
    ----------
    socket
        Its control socket; None: as `motorctl.connect` finds it.
    tell
        Told when the daemon goes away, why, and when it is back.
    """

    def __init__(self, socket: Path | None, tell: Callable[[str], None]) -> None:
        self._path = socket
        self._tell = tell
        self._away: str | None = None
        self._asked: Future[MachineStatus] | None = None
        """The last question, which all wait for who ask while there is no answer."""
        self._lock = threading.Lock()
        """Nobody waits for the daemon with it."""

    def begin(self) -> None:
        """Look for the daemon once, which may be away, before threads are begun that serve.

        Raises UsageError where it cannot be told which one is meant.
        """
        try:
            self._status()
        except UsageError:
            raise
        except MotorctlError as error:
            self._away = str(error)
            self._tell(f"no metrics of the daemon so far: {error}")

    def describe(self) -> Iterable[Metric]:
        """Return nothing: what there is, the daemon says."""
        return ()

    def collect(self) -> Iterator[Metric]:
        """Yield the daemon's metrics, or that it is down."""
        try:
            status = self._status()
        except MotorctlError as error:
            if self._changed(str(error)) is None:
                self._tell(f"no metrics of the daemon: {error}")
            yield from down()
            return
        if self._changed(None) is not None:
            self._tell("the daemon answers")
        yield from metrics_of(status)

    def _changed(self, away: str | None) -> str | None:
        """Take note of why the daemon is away, or that it is not; return what was so before."""
        with self._lock:
            before, self._away = self._away, away
        return before

    def _status(self) -> MachineStatus:
        """Return the daemon's status. Raises MotorctlError where there is none within ANSWER_S."""
        with self._lock:
            if self._asked is None or self._asked.done():
                self._asked = Future()
                ask = partial(self._ask, self._asked)
                threading.Thread(target=ask, name="metrics-ask", daemon=True).start()
            asked = self._asked
        try:
            status = asked.result(ANSWER_S)
        except TimeoutError:
            raise RunError(
                f"the daemon did not answer within {ANSWER_S:g} s: whether it hangs, "
                "`motorctl status` tells"
            ) from None
        with self._lock:  # each time: a loop that still compiles is on no CPU of its own so far
            keep_off_the_loop(status.document["loop"]["pid"])
        return status

    def _ask(self, asked: Future[MachineStatus]) -> None:
        try:
            with connect(self._path) as machine:
                asked.set_result(machine.status())
        except Exception as error:  # who waits is told
            asked.set_exception(error)


class _Named(Collector):
    """Of a collector's metrics those that a scrape names, as ``?name[]=motorctl_up`` does."""

    def __init__(self, every: Collector, names: Container[str]) -> None:
        self._every = every
        self._names = names

    def describe(self) -> Iterable[Metric]:
        return ()

    def collect(self) -> Iterator[Metric]:
        for metric in self._every.collect():
            named = [sample for sample in metric.samples if sample.name in self._names]
            if metric.name in self._names:
                yield metric
            elif named:
                metric.samples = named
                yield metric


class Access:
    """Who may read: on this computer everybody, from elsewhere who has the token.

    Raises UsageError where others reach the address and there is no token.
    """

    def __init__(self, address: str, token: str | None) -> None:
        self._address = address
        self._token = token
        self._names = own_names() if token is not None else frozenset()
        if token is None and needs_token(address):
            raise UsageError(
                f"metrics on {address} are read by whoever reaches it: name a file with a token, "
                "which Prometheus takes as authorization.credentials_file: openssl rand -hex 32 "
                "> token; motorctl metrics --token-file token"
            )

    def refusal(self, environ: WSGIEnvironment) -> tuple[HTTPStatus, str] | None:
        """Return why a request is refused; None where it is not."""
        host = environ.get("HTTP_HOST", "")
        if not is_own(name_of(host), self._address, self._names, others=self._token is not None):
            return HTTPStatus.FORBIDDEN, (
                f"asked for under the name '{host[:80]}', which is none of this server's: ask "
                "for the address that motorctl metrics printed"
            )
        if "HTTP_ORIGIN" in environ:
            return HTTPStatus.FORBIDDEN, "a page asked: metrics are for programs"
        if self._token is not None:
            shown = environ.get("HTTP_AUTHORIZATION", "").removeprefix("Bearer ")
            if not secrets.compare_digest(shown.encode("latin-1"), self._token.encode()):
                return HTTPStatus.UNAUTHORIZED, (
                    "the token is missing or wrong: send 'Authorization: Bearer TOKEN'; Prometheus "
                    "does with authorization.credentials_file"
                )
        if environ["REQUEST_METHOD"] not in ("GET", "HEAD"):
            return HTTPStatus.METHOD_NOT_ALLOWED, "metrics are only read"
        if environ.get("PATH_INFO") != PAGE:
            return HTTPStatus.NOT_FOUND, f"the metrics are at {PAGE}"
        return None


def application(collector: Collector, access: Access) -> WSGIApplication:
    """Return the server's application."""

    def answer(environ: WSGIEnvironment, start: StartResponse) -> Iterable[bytes]:
        status, headers, body = asked(environ)
        start(status, [*headers, ("Content-Length", str(len(body)))])
        return [] if environ["REQUEST_METHOD"] == "HEAD" else [body]

    def asked(environ: WSGIEnvironment) -> tuple[str, list[tuple[str, str]], bytes]:
        if refused := access.refusal(environ):
            status, why = refused
            return f"{status.value} {status.phrase}", [*HEADERS], f"refused: {why}\n".encode()
        names = parse_qs(environ.get("QUERY_STRING", "")).get("name[]")
        registry = CollectorRegistry(auto_describe=False)
        registry.register(_Named(collector, names) if names else collector)
        told: list[Any] = []
        as_get = {**environ, "REQUEST_METHOD": "GET", "QUERY_STRING": ""}
        body = b"".join(make_wsgi_app(registry)(as_get, lambda *begun: told.extend(begun)))
        return told[0], told[1], body

    return answer


def token_in(file: Path) -> str:
    """Return the token in a file. Raises UsageError where there is none."""
    try:
        token = file.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is no text"
        raise UsageError(f"{file}: the token cannot be read: {why}") from error
    if len(token) < SHORTEST_TOKEN or len(token.split()) != 1:
        raise UsageError(
            f"{file}: holds {len(token)} characters, should be one word of at least "
            f"{SHORTEST_TOKEN}: openssl rand -hex 32 > {file}"
        )
    return token


class _Server(ThreadingMixIn, WSGIServer):
    """A thread a request, so that a slow client keeps nobody waiting."""

    daemon_threads = True


class _ServerSix(_Server):
    address_family = socket.AF_INET6


class _Handler(WSGIRequestHandler):
    timeout = PATIENCE_S

    def log_message(self, *_: Any) -> None:
        """Log nothing: a scrape is none of a person's business."""


def open_server(address: str, port: int, app: WSGIApplication) -> WSGIServer:
    """Return a server that listens; `serve_forever` answers.

    Raises RunError where nobody may listen there.
    """
    kind = _ServerSix if ":" in address else _Server
    try:
        return make_server(address, port, app, kind, _Handler)
    except (OSError, OverflowError) as error:
        raise RunError(
            f"metrics cannot be served on {address}, port {port}: "
            f"{getattr(error, 'strerror', None) or error}; --port 0 takes any that is free"
        ) from error
