"""What the two processes hand each other: a look at a word, and its announcement.

Each of these words has one writer. What was written before a word was announced is seen by whoever
has looked at the word; see `motorctl.loop.fences`.
"""

from __future__ import annotations

from typing import Any

from numba import njit

from motorctl.loop.fences import fence_acquire, load_acquire, store_release
from motorctl.loop.vocabulary import Word

PHASE = int(Word.PHASE)
RING_HEAD = int(Word.RING_HEAD)
MAIL_HEAD = int(Word.MAIL_HEAD)
MAIL_TAIL = int(Word.MAIL_TAIL)
REOPEN_ASKED = int(Word.REOPEN_ASKED)
REOPEN_DONE = int(Word.REOPEN_DONE)
MODELS_DONE = int(Word.MODELS_DONE)


@njit(cache=True)
def look_at(status: Any, word: int) -> int:
    """Return the word's value: what was read before stays before, what is read next comes after."""
    fence_acquire()
    if word == PHASE:
        return load_acquire(status[0], "phase")  # type: ignore[no-any-return]
    if word == RING_HEAD:
        return load_acquire(status[0], "ring_head")  # type: ignore[no-any-return]
    if word == MAIL_HEAD:
        return load_acquire(status[0], "mail_head")  # type: ignore[no-any-return]
    if word == REOPEN_ASKED:
        return load_acquire(status[0], "reopen_asked")  # type: ignore[no-any-return]
    if word == REOPEN_DONE:
        return load_acquire(status[0], "reopen_done")  # type: ignore[no-any-return]
    if word == MODELS_DONE:
        return load_acquire(status[0], "models_done")  # type: ignore[no-any-return]
    return load_acquire(status[0], "mail_tail")  # type: ignore[no-any-return]


@njit(cache=True)
def announce(status: Any, word: int, value: int) -> None:
    """Write a word after everything that it announces."""
    if word == PHASE:
        store_release(status[0], "phase", value)
    elif word == RING_HEAD:
        store_release(status[0], "ring_head", value)
    elif word == MAIL_HEAD:
        store_release(status[0], "mail_head", value)
    elif word == REOPEN_ASKED:
        store_release(status[0], "reopen_asked", value)
    elif word == REOPEN_DONE:
        store_release(status[0], "reopen_done", value)
    elif word == MODELS_DONE:
        store_release(status[0], "models_done", value)
    else:
        store_release(status[0], "mail_tail", value)
