"""A running machine, from an asyncio program: many requests wait at once on one connection."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import Collection, Generator
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TypeVar

from motorctl.api import orders
from motorctl.api.connection import PERIOD_S
from motorctl.api.orders import AT_REST, STOP_TIMEOUT_S, Motion, OnWait, Reset, Started
from motorctl.api.status import AxisStatus, MachineStatus
from motorctl.daemon.client import allowed_s, connected, request_line
from motorctl.daemon.conversation import Ask, Conversation, Pause, answered
from motorctl.errors import MotorctlError, RunError

if TYPE_CHECKING:
    from motorctl.api.samples import Subscription

T = TypeVar("T")
LONGEST_ANSWER_BYTES = 16 << 20
"""Longest line that is read. Larger than any that a daemon sends: a status has some kB an axis."""


class AsyncConnection:
    """A connection to a daemon, as `connect_async` returns it.

    ``async with connect_async() as machine``, or ``machine = await connect_async()`` and
    `close`. The methods are those of `Connection`, and so are their errors. A task that waits can
    be cancelled; the axis goes on. The daemon answers one request of a connection after the other,
    an emergency stop at once.
    """

    def __init__(self, path: Path | None) -> None:
        self._named = path
        self._count = 0
        self._asked: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._gone: MotorctlError | None = RunError("the connection is not open")
        self._reader: asyncio.StreamReader
        self._writer: asyncio.StreamWriter | None = None
        self._reading: asyncio.Task[None] | None = None

    async def open(self) -> Self:
        """Connect and return itself."""
        if self._writer is None:
            connection, self.path = await asyncio.to_thread(connected, self._named)
            connection.setblocking(False)
            self._reader, self._writer = await asyncio.open_unix_connection(
                sock=connection, limit=LONGEST_ANSWER_BYTES
            )
            self._gone = None
            self._reading = asyncio.create_task(self._read())
        return self

    def __await__(self) -> Generator[Any, None, Self]:
        return self.open().__await__()

    async def __aenter__(self) -> Self:
        return await self.open()

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Hang up; whoever still waits for an answer gets RunError."""
        if self._writer is None or self._reading is None:
            return
        self._end(RunError(f"the connection to the daemon on {self.path} was closed here"))
        self._reading.cancel()
        await asyncio.gather(self._reading, return_exceptions=True)
        self._writer.close()
        await asyncio.gather(self._writer.wait_closed(), return_exceptions=True)
        self._writer = None

    async def ask(self, do: str, **arguments: Any) -> dict[str, Any]:
        """Send one request and return its answer without `id` and `ok`.

        Parameters
        ----------
        do
            Name of the command.
        **arguments
            Keys of the request; None leaves one out.
        """
        if self._gone is not None or self._writer is None:
            raise self._gone or RunError("the connection is not open")
        self._count += 1
        number = self._count
        reply = self._asked[number] = asyncio.get_running_loop().create_future()
        try:
            self._writer.write(request_line(number, do, arguments))
            async with asyncio.timeout(allowed_s(do)):
                return answered(await reply)
        except TimeoutError:
            message = f"the daemon on {self.path} did not answer within {allowed_s(do):g} s"
            raise RunError(message) from None
        finally:
            self._asked.pop(number, None)

    async def carry_out(self, conversation: Conversation[T]) -> T:
        """Carry a conversation out to its end, and return what comes of it."""
        try:
            step = next(conversation)
            while True:
                try:
                    answer = await self._take(step)
                except MotorctlError as error:
                    step = conversation.throw(error)
                else:
                    step = conversation.send(answer)
        except StopIteration as end:
            result: T = end.value
            return result

    async def status(self) -> MachineStatus:
        """As `Connection.status`."""
        return await self.carry_out(orders.status())

    async def axis_status(self, axis: str) -> AxisStatus:
        """As `Connection.axis_status`."""
        return await self.carry_out(orders.axis_status(axis))

    async def start(
        self, axis: str, *, hold: bool = False, on_wait: OnWait | None = None
    ) -> Started:
        """As `Connection.start`."""
        return await self.carry_out(orders.start(axis, hold, on_wait))

    async def stop(
        self, axis: str, *, timeout_s: float = STOP_TIMEOUT_S, on_wait: OnWait | None = None
    ) -> AxisStatus:
        """As `Connection.stop`."""
        return await self.carry_out(orders.stop(axis, timeout_s, on_wait))

    async def stop_all(
        self, *, timeout_s: float = STOP_TIMEOUT_S, on_wait: OnWait | None = None
    ) -> tuple[str, ...]:
        """As `Connection.stop_all`."""
        return await self.carry_out(orders.stop_all(timeout_s, on_wait))

    async def home(
        self, axis: str, *, timeout_s: float | None = None, on_wait: OnWait | None = None
    ) -> AxisStatus:
        """As `Connection.home`."""
        return await self.carry_out(orders.home(axis, timeout_s, on_wait))

    async def move(
        self,
        axis: str,
        position_m: float | None = None,
        *,
        by_m: float | None = None,
        velocity_m_s: float | None = None,
        acceleration_m_s2: float | None = None,
        on_wait: OnWait | None = None,
    ) -> Motion:
        """As `Connection.move`."""
        return await self.carry_out(
            orders.move(axis, position_m, by_m, velocity_m_s, acceleration_m_s2, on_wait)
        )

    async def program(
        self, axis: str, name_or_file: str | os.PathLike[str], *, on_wait: OnWait | None = None
    ) -> Motion:
        """As `Connection.program`."""
        return await self.carry_out(orders.program(axis, name_or_file, on_wait))

    async def wait(
        self,
        axis: str,
        states: str | Collection[str] = AT_REST,
        *,
        timeout_s: float | None = None,
    ) -> AxisStatus:
        """As `Connection.wait`."""
        return await self.carry_out(orders.wait(axis, states, timeout_s))

    async def subscribe(
        self, *, period_s: float = PERIOD_S, history_s: float = 0.0, restarts: bool = False
    ) -> Subscription:
        """As `Connection.subscribe`, to be iterated over with ``async for``."""
        from motorctl.api.samples import Subscription

        return await asyncio.to_thread(
            Subscription, self.path, period_s=period_s, history_s=history_s, restarts=restarts
        )

    async def reset(self, axis: str, *, on_wait: OnWait | None = None) -> Reset:
        """As `Connection.reset`."""
        return await self.carry_out(orders.reset(axis, on_wait))

    async def reset_all(self, *, on_wait: OnWait | None = None) -> tuple[Reset, ...]:
        """As `Connection.reset_all`."""
        return await self.carry_out(orders.reset_all(on_wait))

    async def estop(self) -> tuple[str, ...]:
        """As `Connection.estop`."""
        return await self.carry_out(orders.estop())

    async def _take(self, step: Ask | Pause) -> dict[str, Any]:
        if isinstance(step, Ask):
            return await self.ask(step.do, **step.arguments)
        await asyncio.sleep(step.seconds)
        return {}

    async def _read(self) -> None:
        """Hand answers to those who asked, until the daemon hangs up."""
        why = f"the daemon on {self.path} closed the connection"
        try:
            while line := await self._reader.readline():
                reply = json.loads(line)
                if reply["id"] is None:  # nobody is heard on this connection
                    answered(reply)
                elif (asked := self._asked.get(reply["id"])) is not None and not asked.done():
                    asked.set_result(reply)
        except OSError as error:
            why += f": {error.strerror}"
        except (ValueError, KeyError, TypeError):
            why = f"what answers on {self.path} is no daemon: its answers make no sense"
        except MotorctlError as no:
            self._end(no)
            return
        self._end(RunError(why))

    def _end(self, why: MotorctlError) -> None:
        self._gone = why
        for asked in self._asked.values():
            if not asked.done():
                asked.set_exception(why)


def connect_async(socket: str | os.PathLike[str] | None = None) -> AsyncConnection:
    """Return a connection to a running daemon that opens when it is awaited, or entered.

    Parameters
    ----------
    socket
        Its control socket; None: the user's own daemon, else root's, else the only service's.

    Returns
    -------
    AsyncConnection
        ``async with connect_async() as machine``. RunError where no daemon answers, UsageError
        where the socket that nobody named is another user's, or several services run.
    """
    return AsyncConnection(None if socket is None else Path(socket))
