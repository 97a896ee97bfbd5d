"""Bytes that no client should send, from a seed."""

from __future__ import annotations

import json
import random

REQUESTS = (
    {"id": 1, "do": "status"},
    {"id": 2, "do": "move", "axis": "z", "position_m": 0.1, "velocity_m_s": 0.1},
    {"id": 3, "do": "program", "axis": "z", "name": "none"},
    {"id": 4, "do": "home", "axis": "z"},
)
"""What is mutated; no axis is called z, so that nothing moves where a mutation leaves it whole."""
NASTY = (
    b'{"id":1,"do":"status"',
    b'{"id":1e999,"do":"status"}',
    b'{"id":-9223372036854775809,"do":"status"}',
    b'{"do":"move","axis":"z","position_m":NaN}',
    b'{"do":"move","axis":"z","position_m":1e309}',
    b'{"do":{"do":{"do":"status"}}}',
    b"[" * 5000,
    b'{"a":' * 2000,
    b"null",
    b'"status"',
    b"\xef\xbb\xbf{}",
    b"\x00" * 300,
    b"GET / HTTP/1.1\r\nHost: x\r\n\r",
    b'{"id":1,"id":2,"do":"status"}',
    b'{"id":"' + b"x" * 3000 + b'","do":"status"}',
    '{"id":1,"do":"st\u0430tus"}'.encode(),
    b'{"id":1,"do":"\\ud800"}',
)


def fuzzed(dice: random.Random) -> bytes:
    """Return a line, or a part of one, that is no proper request, or a proper one by accident."""
    kind = dice.random()
    if kind < 0.35:
        line = dice.randbytes(dice.randint(1, 1500))
    elif kind < 0.75:
        line = _mutated(dice)
    elif kind < 0.95:
        line = dice.choice(NASTY)
    else:
        line = b"\n" * dice.randint(1, 50)
    return line + b"\n" if dice.random() < 0.97 else line


def _mutated(dice: random.Random) -> bytes:
    line = bytearray(json.dumps(dice.choice(REQUESTS)).encode())
    for _ in range(dice.randint(1, 8)):
        at = dice.randrange(len(line))
        do = dice.randrange(4)
        if do == 0:
            line[at] = dice.randrange(256)
        elif do == 1:
            del line[at : at + dice.randint(1, 8)]
        elif do == 2:
            line[at:at] = line[: dice.randint(1, len(line))]
        else:
            line[at:at] = dice.randbytes(dice.randint(1, 40))
        line = line or bytearray(b"{")
    return bytes(line)
