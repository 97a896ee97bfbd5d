"""One client's connection: bytes to lines, and what a client must keep to. No request is read.

While lines wait, little is read: a flood waits in the kernel, where it costs nothing, and what is
held of a client is at most one request and twice READ_BYTES.
"""

from __future__ import annotations

import asyncio
import os
import socket
import time
from collections.abc import Callable

from motorctl.daemon.access import Role
from motorctl.daemon.protocol import MAX_LINE_BYTES, SHORT_LINE_BYTES, Code, refusal
from motorctl.daemon.request_pace import RequestPace

READ_BYTES = 64 << 10
"""Taken from one client before the others have their turn."""
WAITING_ANSWERS_BYTES = 64 << 10
LINE_TIMEOUT_S = 10.0
"""A line that was begun must end within this time."""
WRITE_TIMEOUT_S = 5.0
"""A client that does not take its answers for so long is dropped."""
STOP_LINE_BYTES = 256
"""A longer line is no emergency stop of a sane client, and waits for its turn."""

# What was read is taken out at once, so one is enough for all; it is never sent anywhere.
_shared = memoryview(bytearray(READ_BYTES))


class Connection(asyncio.BufferedProtocol):
    """Takes lines of a client apart and tells when one may be answered.

    Parameters
    ----------
    role
        What the client may do.
    on_line
        Called when there is a line that `next_line` gives, and it is its time.
    on_stop
        Called with a line that may be an emergency stop, as soon as it is here, before the lines
        that wait; returns whether it was one and is taken care of.
    on_end
        Called when the connection is gone.
    """

    def __init__(
        self,
        role: Role,
        on_line: Callable[[Connection], None],
        on_stop: Callable[[Connection, bytes], bool],
        on_end: Callable[[Connection], None],
    ) -> None:
        self.role = role
        self.ended = False
        self._on_line, self._on_stop, self._on_end = on_line, on_stop, on_end
        self._pace = RequestPace(time.monotonic())
        # A program is the only long request, and none of theirs.
        self._longest = SHORT_LINE_BYTES if role is Role.OBSERVE else MAX_LINE_BYTES
        self._held = bytearray()
        self._searched = 0
        """So much of what is held has no end of a line in it."""
        self._line_end = -1
        self._busy = False
        """A line is being answered, or waits for its turn or its time."""
        self._overtaken = 0
        """So many of the bytes that are held came before an emergency stop."""
        self._stops = 0
        """Emergency stops under way."""
        self._heard_all = False
        self._handed_over = False
        self._deaf = False
        self._timer: asyncio.TimerHandle | None = None
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin to listen."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        transport.set_write_buffer_limits(high=WAITING_ANSWERS_BYTES)

    def get_buffer(self, sizehint: int) -> memoryview:
        """Return where the next bytes go."""
        return _shared

    def buffer_updated(self, nbytes: int) -> None:
        """Take bytes that came."""
        assert self._transport is not None
        before = len(self._held)
        self._held += _shared[:nbytes]
        self._let_stop_overtake(before - STOP_LINE_BYTES)
        self._look_for_line()
        if self._busy and len(self._held) >= READ_BYTES:
            self._transport.pause_reading()

    def eof_received(self) -> bool:
        """Answer what was asked before the client stopped to talk, then hang up."""
        self._heard_all = True
        self._look_for_line()
        return True

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the client."""
        self.ended = True
        self._forget_timer()
        self._held.clear()
        self._on_end(self)

    def pause_writing(self) -> None:
        """Wait for a client that takes no answers, but not for long."""
        self._deaf = True
        self._set_timer(WRITE_TIMEOUT_S, self.drop)

    def resume_writing(self) -> None:
        """Go on with a client that takes its answers again."""
        self._deaf = False
        self._forget_timer()
        if not self._busy:
            self._look_for_line()

    def waiting_line(self) -> bytes:
        """Return the beginning of the line that waits: as much as a request to stop is long."""
        return bytes(self._held[: min(self._line_end, STOP_LINE_BYTES)])

    def next_line(self) -> tuple[bytes, bool]:
        """Take the line that waits; `answer` or `pass_over` says that it is done with.

        Returns
        -------
        bytes
            The line.
        bool
            Whether it began to come before an emergency stop.
        """
        line, overtaken = bytes(self._held[: self._line_end]), self._overtaken > 0
        del self._held[: self._line_end + 1]
        self._overtaken = max(self._overtaken - self._line_end - 1, 0)
        self._line_end, self._searched = -1, 0
        return line, overtaken

    def overtake(self) -> None:
        """Hold it against all that is here so far that an emergency stop came before its turn."""
        self._overtaken = len(self._held)

    def answer(self, line: bytes) -> None:
        """Send an answer to a line of `next_line`, and go on to the next."""
        self.send(line)
        self.pass_over()

    def answer_with_descriptor(self, opened: Callable[[], int], line: bytes) -> None:
        """Send an answer with what `opened` opens beside its first byte, the first time only.

        One for each connection: what waits in a socket that nobody reads would add up. A client
        that has not taken its earlier answers is dropped, as asyncio, which keeps them, can hand
        nothing over.
        """
        if self._handed_over or self._transport is None or self.ended:
            self.answer(line)
            return
        self._handed_over = True
        descriptor = opened()
        try:
            sent = 0
            if not self._transport.get_write_buffer_size():
                sent = _send(self._transport.get_extra_info("socket").fileno(), line, descriptor)
        except OSError:
            sent = 0
        finally:
            os.close(descriptor)
        if not sent:
            self.drop()
            return
        self.answer(line[sent:])

    def pass_over(self) -> None:
        """Go on to the next line, when it is time."""
        if self.ended:
            return
        wait_s = self._pace.wait_s(time.monotonic())
        if wait_s > 0:
            asyncio.get_running_loop().call_later(wait_s, self._go_on)
        else:
            self._go_on()

    def answer_stop(self, line: bytes) -> None:
        """Send the answer to what `on_stop` took care of."""
        self._stops -= 1
        self.send(line)
        if not self._busy:
            self._look_for_line()

    def answer_stop_and_end(self, line: bytes) -> None:
        """Send it, and hang up."""
        self._stops -= 1
        self.hang_up(line)

    def send(self, line: bytes) -> None:
        """Send a line."""
        if not self.ended and self._transport is not None:
            self._transport.write(line)

    def hang_up(self, last: bytes = b"") -> None:
        """Send a last line and close; a client that does not take it is dropped."""
        if self._transport is None or self.ended:
            return
        self._busy = True
        self._transport.pause_reading()
        self.send(last)
        self._set_timer(WRITE_TIMEOUT_S, self.drop)
        self._transport.close()

    def hang_up_if_silent(self, last: bytes) -> None:
        """The same, unless an emergency stop is under way."""
        if not self._stops:
            self.hang_up(last)

    def drop(self) -> None:
        """Close at once."""
        if self._transport is not None:
            self._transport.abort()

    def _go_on(self) -> None:
        self._busy = False
        if not self._deaf:
            self._look_for_line()

    def _look_for_line(self) -> None:
        """Offer the next line, or read on; whoever does not end a line is hung up on."""
        if self.ended or self._busy or self._transport is None:
            return
        self._line_end = self._held.find(b"\n", self._searched)
        self._searched = len(self._held)
        if self._line_end > self._longest or (
            self._line_end < 0 and self._searched > self._longest
        ):
            message = f"the request is longer than the limit of {self._longest} bytes"
            self.hang_up(refusal(None, Code.TOO_LARGE, message))
            return
        if self._line_end >= 0:
            self._forget_timer()
            self._busy = True
            self._on_line(self)
            return
        if self._heard_all:
            if not self._stops:
                self.hang_up()
            return
        if not self._held:
            self._forget_timer()
        elif self._timer is None:
            self._set_timer(LINE_TIMEOUT_S, self.drop)
        self._transport.resume_reading()

    def _let_stop_overtake(self, place: int) -> None:
        """Let the first line behind a place that may be an emergency stop be looked at now."""
        # What is before is a line that has been looked at, and waits for its turn.
        at = self._held.find(b"estop", max(place, self._line_end + 1, 0))
        if at < 0:
            return
        begin, end = self._held.rfind(b"\n", 0, at) + 1, self._held.find(b"\n", at)
        if end < 0 or end - begin > STOP_LINE_BYTES:
            return
        if self._on_stop(self, bytes(self._held[begin:end])):
            self._stops += 1
            self._overtaken = begin
            del self._held[begin : end + 1]
            self._searched = 0

    def _set_timer(self, seconds: float, then: Callable[[], None]) -> None:
        self._forget_timer()
        self._timer = asyncio.get_running_loop().call_later(seconds, then)

    def _forget_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


def _send(place: int, line: bytes, descriptor: int) -> int:
    """Send as much of a line as goes at once, with a descriptor; return how many bytes went."""
    with socket.socket(fileno=os.dup(place)) as own:
        return socket.send_fds(own, [line], [descriptor])
