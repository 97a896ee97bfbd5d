"""The server of the scope's page: what it asks for, read in threads beside the event loop."""

from __future__ import annotations

import asyncio
import math
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, TypeVar

from aiohttp import web
from pydantic import ValidationError

from motorctl.errors import MotorctlError, RunError, UsageError
from motorctl.own_names import name_to_ask, needs_token, own_names
from motorctl.scope.access import LOG_PAGE, Access, guarded, new_token
from motorctl.scope.bands import bands
from motorctl.scope.laps import laps
from motorctl.scope.live_machine import LiveMachine
from motorctl.scope.opened_log import OpenedLog
from motorctl.scope.place_spectrum import place_spectrum
from motorctl.scope.planes import path, plane
from motorctl.scope.shown import Shown
from motorctl.scope.signals import signals
from motorctl.scope.spectrum import spectrum
from motorctl.scope.trigger import Trigger
from motorctl.scope.wire import Answer
from motorctl.version import VERSION

T = TypeVar("T")
MOST_ASKED_BYTES = 4096
"""Of a request's body: a trigger has some hundred."""
OF_LOGS = (
    *("logs", "signals", "bands", "plane", "path", "spectrum", "place_spectrum", "laps"),
    "values",
)
"""What is asked of anything that is shown."""
RECORDS = "/flight_record/"
MOST_RECORDS = 8
"""How many of these are open at a time; of a fault, or a fleet, more are seldom compared."""
Find = Callable[[str], Path]
"""Returns where the log of an identity is; raises UsageError where none is known."""
PAGE = files("motorctl.scope") / "page"
KINDS = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".css": "text/css",
    ".svg": "image/svg+xml",
}


@dataclass(frozen=True)
class Logs:
    """The logs that a page shows, side by side in their order."""

    opened: Sequence[Shown]
    refused: Mapping[str, str]
    """By path, why one could not be opened."""

    @classmethod
    def of(cls, paths: Sequence[Path]) -> Logs:
        """Open as many as can be. Raises UsageError where none can."""
        opened: list[Shown] = []
        refused: dict[str, str] = {}
        for each in paths:
            try:
                opened.append(OpenedLog(each))
            except MotorctlError as error:
                refused[str(each)] = str(error)
        if not opened:
            raise UsageError("no log could be opened:\n" + "\n".join(refused.values()))
        return cls(opened, refused)

    @classmethod
    def of_machine(cls, socket: Path | None, captures: Path) -> Logs:
        """Listen to a running machine. Raises MotorctlError where no daemon answers."""
        return cls([LiveMachine(socket, captures)], {})

    def close(self) -> None:
        """Leave the machine, if one is shown."""
        for opened in self.opened:
            if isinstance(opened, LiveMachine):
                opened.close()

    def told(self) -> dict[str, Any]:
        """Return what the page is told first, for JSON."""
        logs = []
        for opened in self.opened:
            with opened.lock:
                opened.refresh()
                logs.append(opened.told())
        machines = {log["machine"] for log in logs}
        notes = []
        if len(machines) > 1:
            named = ", ".join(sorted(str(name) for name in machines))
            notes.append(f"the logs are of different machines: {named}")
        notes += [f"not shown: {why}" for why in self.refused.values()]
        return {"version": VERSION, "logs": logs, "notes": notes}


class Questions:
    """What the page may ask of the logs."""

    def __init__(self, logs: Logs) -> None:
        self._logs = logs

    async def logs(self, request: web.Request) -> web.Response:
        """Tell which logs there are."""
        return web.json_response(await asyncio.to_thread(self._logs.told))

    async def signals(self, request: web.Request) -> web.Response:
        """Tell columns over time."""
        pixels = _number(request, "pixels")
        names = request.query.get("columns", "").split(",")
        return await self._arrays(request, lambda o, a, b: signals(o, names, a, b, int(pixels)))

    async def bands(self, request: web.Request) -> web.Response:
        """Tell states and faults."""
        return web.json_response(await self._asked(request, bands))

    async def plane(self, request: web.Request) -> web.Response:
        """Tell one column against another."""
        x, y = _word(request, "x"), _word(request, "y")
        return await self._arrays(request, lambda o, a, b: plane(o, x, y, a, b))

    async def path(self, request: web.Request) -> web.Response:
        """Tell the path of two axes."""
        x, y, magnified = _word(request, "x"), _word(request, "y"), _number(request, "magnified")
        return await self._arrays(request, lambda o, a, b: path(o, x, y, a, b, magnified))

    async def spectrum(self, request: web.Request) -> web.Response:
        """Tell of which frequencies a column is made."""
        name = _word(request, "column")
        return await self._arrays(request, lambda o, a, b: spectrum(o, name, a, b))

    async def place_spectrum(self, request: web.Request) -> web.Response:
        """Tell of which waves over position a column is made."""
        name, over = _word(request, "column"), _word(request, "position")
        return await self._arrays(request, lambda o, a, b: place_spectrum(o, name, over, a, b))

    async def laps(self, request: web.Request) -> web.Response:
        """Tell a column lap by lap."""
        axis, name = _word(request, "axis"), _word(request, "column")
        return await self._arrays(request, lambda o, a, b: laps(o, axis, name, a, b))

    async def values(self, request: web.Request) -> web.Response:
        """Tell one row."""
        at_s = _number(request, "at_s")
        values = await self._asked(request, lambda o, a, b: o.values_at(at_s), stretch=False)
        return web.json_response(values)

    async def live(self, request: web.Request) -> web.Response:
        """Tell how far the machine's rows are, and what was captured."""
        return web.json_response(await asyncio.to_thread(self.machine().state))

    async def trigger(self, request: web.Request) -> web.Response:
        """Arm a trigger, or disarm it where nothing is asked for."""
        machine = self.machine()
        told = await request.text()
        try:
            wanted = Trigger.model_validate_json(told) if told else None
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(map(str, first["loc"])) or "trigger"
            raise UsageError(f"{where}: {first['msg']}") from None
        await asyncio.to_thread(machine.arm, wanted)
        return web.json_response({"armed": wanted is not None})

    def machine(self) -> LiveMachine:
        """Return the machine. Raises UsageError where logs are shown."""
        machine = self._logs.opened[0]
        if not isinstance(machine, LiveMachine):
            raise UsageError("no machine is shown, but logs")
        return machine

    async def _arrays(
        self, request: web.Request, ask: Callable[[Shown, float, float], Answer]
    ) -> web.Response:
        body = (await self._asked(request, ask)).encoded()
        return web.Response(body=body, content_type="application/octet-stream")

    async def _asked(
        self,
        request: web.Request,
        ask: Callable[[Shown, float, float], T],
        stretch: bool = True,
    ) -> T:
        index = _number(request, "log")
        if not 0 <= index < len(self._logs.opened) or index % 1:
            raise UsageError(f"log: {index:g}: there are {len(self._logs.opened)}, from 0")
        opened = self._logs.opened[int(index)]
        begin_s, end_s = 0.0, 0.0
        if stretch:
            begin_s, end_s = _number(request, "begin_s"), _number(request, "end_s")
            if begin_s > end_s:
                raise UsageError(f"begin_s: {begin_s:g} is after end_s, {end_s:g}")

        def answer() -> T:
            with opened.lock:
                if opened.live:
                    opened.refresh()
                return ask(opened, begin_s, end_s)

        return await asyncio.to_thread(answer)


class RecordPages:
    """Flight records of the machine that is shown, each as a page of its own.

    Which one is opened, the daemon tells, and a page then asks for it by the number that it got
    here: from a browser comes no path.
    """

    def __init__(self, live: Questions) -> None:
        self._live = live
        self._opened: dict[int, tuple[Path, Questions]] = {}
        self._count = 0
        self._lock = threading.Lock()

    async def newest(self, request: web.Request) -> web.Response:
        """Open the newest record, and lead to its page."""
        number = await asyncio.to_thread(self._open_newest)
        return web.Response(status=302, headers={"Location": f"{RECORDS}{number}/"})

    async def answer(self, request: web.Request) -> web.Response:
        """Tell of a record what its page asks for."""
        _, questions = self._opened.get(int(request.match_info["number"]), (None, None))
        if questions is None:
            raise UsageError("this flight record is closed by now: open it from the live page")
        told: web.Response = await getattr(questions, request.match_info["name"])(request)
        return told

    def _open_newest(self) -> int:
        path = self._live.machine().newest_flight_record()
        with self._lock:
            for number, (opened, _) in self._opened.items():
                if opened == path:
                    return number
            self._count += 1
            self._opened[self._count] = path, Questions(Logs.of([path]))
            self._opened.pop(self._count - MOST_RECORDS, None)
            return self._count


class LogPages:
    """Logs of a fleet, each as a page of its own, which its first question opens.

    A page asks by the log's identity, and who started the scope knows where that is: from a browser
    comes no path.
    """

    def __init__(self, find: Find) -> None:
        self._find = find
        self._opened: dict[str, Questions] = {}
        self._lock = threading.Lock()

    async def first(self, request: web.Request) -> web.Response:
        """Tell who asks for no log where they are."""
        text = "Logs of a fleet: open them from the page of `motorctl fleet report`.\n"
        return web.Response(text=text)

    async def answer(self, request: web.Request) -> web.Response:
        """Tell of a log what its page asks for."""
        questions = await asyncio.to_thread(self._of, request.match_info["log_id"])
        told: web.Response = await getattr(questions, request.match_info["name"])(request)
        return told

    def _of(self, log_id: str) -> Questions:
        with self._lock:
            questions = self._opened.pop(log_id, None) or Questions(Logs.of([self._find(log_id)]))
            self._opened[log_id] = questions
            while len(self._opened) > MOST_RECORDS:
                del self._opened[next(iter(self._opened))]
            return questions


def application(logs: Logs | Find, access: Access) -> web.Application:
    """Return the server's application, of logs or a machine, or of a fleet's logs."""

    @web.middleware
    async def in_words(request: web.Request, handler: Any) -> web.StreamResponse:
        try:
            answer: web.StreamResponse = await handler(request)
        except MotorctlError as error:
            return web.Response(status=400, text=f"{error}\n")
        return answer

    app = web.Application(middlewares=[guarded(access), in_words], client_max_size=MOST_ASKED_BYTES)
    if not isinstance(logs, Logs):
        pages = LogPages(logs)
        app.router.add_get("/", pages.first)
        app.router.add_get(f"{LOG_PAGE}/api/{{name:{'|'.join(OF_LOGS)}}}", pages.answer)
        app.router.add_get(LOG_PAGE + "/{name:[a-zA-Z_/.]*}", _file)
        return app
    questions = Questions(logs)
    app.router.add_post("/api/trigger", questions.trigger)
    app.router.add_get("/api/live", questions.live)
    for name in OF_LOGS:
        app.router.add_get(f"/api/{name}", getattr(questions, name))
    records, number = RecordPages(questions), RECORDS + r"{number:\d{1,9}}"
    app.router.add_get(RECORDS, records.newest)
    app.router.add_get(f"{number}/api/{{name:{'|'.join(OF_LOGS)}}}", records.answer)
    app.router.add_get(number + "/{name:[a-zA-Z_/.]*}", _file)
    app.router.add_get("/{name:[a-zA-Z_/.]*}", _file)
    return app


async def serve(
    logs: Logs | Find, address: str, port: int, ready: Callable[[str], None] = lambda url: None
) -> None:
    """Serve the page until it is cancelled.

    Parameters
    ----------
    logs
        What it shows; of a fleet where each log is.
    address, port
        Where; of any address that others reach, the page needs a token. Port 0: any that is free.
    ready
        Told the page's address once it can be opened.

    Raises
    ------
    RunError
        Where nobody may listen there.
    """
    access = Access(address, None)
    if needs_token(address):
        access = Access(address, new_token(), await asyncio.to_thread(own_names))
    runner = web.AppRunner(application(logs, access), access_log=None)
    await runner.setup()
    try:
        try:
            site = web.TCPSite(runner, address, port)
            await site.start()
        except (OSError, UnicodeError) as error:  # the latter: no name that could be looked up
            why = error.strerror if isinstance(error, OSError) else "no name of a computer"
            raise RunError(
                f"the page cannot be served on {address}, port {port}: {why or error}; "
                "--port 0 takes any that is free"
            ) from error
        bound = runner.addresses[0][1]
        name = name_to_ask(address)
        ready(f"http://{name}:{bound}/" + (f"?token={access.token}" if access.token else ""))
        await asyncio.Event().wait()
    finally:
        await runner.cleanup()


async def _file(request: web.Request) -> web.Response:
    name = request.match_info["name"] or "index.html"
    file = _page_files().get(name)
    if file is None:
        return web.Response(status=404, text=f"no page '{name[:80]}'\n")
    text = file.read_text(encoding="utf-8")
    return web.Response(text=text, content_type=KINDS[Path(name).suffix])


@cache
def _page_files() -> Mapping[str, Traversable]:
    """Return what the page is made of by its path: nothing else is ever opened for a request."""
    found: dict[str, Traversable] = {}
    folders = [("", PAGE)]
    while folders:
        path, folder = folders.pop()
        for entry in folder.iterdir():
            if entry.is_dir():
                folders.append((f"{path}{entry.name}/", entry))
            elif Path(entry.name).suffix in KINDS:
                found[path + entry.name] = entry
    return found


def _number(request: web.Request, name: str) -> float:
    told = request.query.get(name, "")
    try:
        number = float(told)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise UsageError(f"{name}: '{told[:80]}' is no number")
    return number


def _word(request: web.Request, name: str) -> str:
    if not (word := request.query.get(name, "")):
        raise UsageError(f"{name}: is missing")
    return word[:200]
