"""A client of expedited SDO transfers: all that is asked of a drive fits into one frame."""

from __future__ import annotations

import time
from collections.abc import Callable

import can

from motorctl_can.link import Link
from motorctl_canopen.objects import SDO_ANSWER_ID, SDO_REQUEST_ID, Object, abort_words

DOWNLOAD, UPLOAD = 0x23, 0x40
DOWNLOADED, UPLOADED, ABORTED = 0x60, 0x40, 0x80
COMMAND_BITS, EXPEDITED, SIZE_TOLD = 0xE0, 0x02, 0x01


class SdoError(Exception):
    """A transfer that failed; the message says what was asked, and why not."""

    def __init__(self, message: str, code: int | None = None) -> None:
        super().__init__(message)
        self.code = code
        """Of the abort; None where there was no answer."""


class SdoClient:
    """Reads and writes the objects of one node, each with one frame there and one back."""

    def __init__(
        self, link: Link, node: int, timeout_s: float, heard: Callable[[can.Message], None]
    ) -> None:
        self._link = link
        self._timeout_s = timeout_s
        self._heard = heard
        """Gets what comes besides."""
        self._request = request_message(node)
        self._answer_id = SDO_ANSWER_ID + node

    def read(self, entry: Object) -> int:
        """Return the value of an entry, as an unsigned number. Raises SdoError."""
        put_request(self._request, UPLOAD, entry, 0)
        answer = self._exchange(f"reading {entry.address} ({entry.name})", entry, UPLOADED)
        if not answer[0] & EXPEDITED:
            message = f"{entry.address} ({entry.name}) is longer than {entry.size} B"
            raise SdoError(message)
        size = 4 - (answer[0] >> 2 & 3) if answer[0] & SIZE_TOLD else entry.size
        return int.from_bytes(answer[4 : 4 + size], "little")

    def write(self, entry: Object, value: int) -> None:
        """Set the value of an entry. Raises SdoError."""
        put_request(self._request, download_command(entry), entry, value)
        what = f"writing {value:#x} to {entry.address} ({entry.name})"
        self._exchange(what, entry, DOWNLOADED)

    def _exchange(self, what: str, entry: Object, expected: int) -> bytes:
        link = self._link
        link.send(self._request)
        deadline = time.monotonic() + self._timeout_s
        while (left := deadline - time.monotonic()) > 0:
            message = link.receive(left)
            if message is None:
                if link.lost:
                    break
                continue
            if message.arbitration_id != self._answer_id or len(message.data) != 8:
                self._heard(message)
                continue
            data = bytes(message.data)
            if data[1:4] != entry.index.to_bytes(2, "little") + bytes([entry.subindex]):
                continue  # the answer to what `safe` asked, and did not wait for
            if data[0] == ABORTED:
                code = int.from_bytes(data[4:], "little")
                raise SdoError(f"{what} was refused: {abort_words(code)}", code)
            if data[0] & COMMAND_BITS == expected:
                return data
        why = f"; the bus says: {link.complaint}" if link.complaint else ""
        raise SdoError(f"{what}: no answer within {self._timeout_s:g} s{why}")


def request_message(node: int) -> can.Message:
    """Return an empty request to a node, to be filled by `put_request`."""
    return can.Message(
        arbitration_id=SDO_REQUEST_ID + node,
        is_extended_id=False,
        data=bytearray(8),
        is_rx=False,
    )


def download_command(entry: Object) -> int:
    """Return the first byte of a request that writes an entry."""
    return DOWNLOAD | (4 - entry.size) << 2


def put_request(message: can.Message, command: int, entry: Object, value: int) -> None:
    """Fill a request."""
    data = message.data
    data[0] = command
    data[1:3] = entry.index.to_bytes(2, "little")
    data[3] = entry.subindex
    data[4:8] = (value & 0xFFFFFFFF).to_bytes(4, "little")
