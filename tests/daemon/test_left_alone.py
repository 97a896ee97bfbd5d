"""Work in threads that the end of a daemon does not wait for."""

from __future__ import annotations

import asyncio
import time

import pytest

from motorctl.daemon.left_alone import left_alone

LONG_S = 5.0


def test_an_end_does_not_wait_for_what_is_left_alone() -> None:
    async def begin() -> None:
        working = left_alone("long", lambda: time.sleep(LONG_S))
        await asyncio.wait({working}, timeout=0.01)

    began_s = time.monotonic()
    asyncio.run(begin())
    assert time.monotonic() - began_s < 0.5 * LONG_S


def test_what_it_returns_or_raises_is_passed_on() -> None:
    def fails() -> None:
        raise OSError("no such disk")

    async def begin() -> int:
        with pytest.raises(OSError, match="no such disk"):
            await left_alone("fails", fails)
        return await left_alone("works", lambda: 42)

    assert asyncio.run(begin()) == 42
