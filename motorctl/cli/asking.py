"""Ask a person before something moves."""

from __future__ import annotations

import sys
import termios
from contextlib import suppress

import typer

from motorctl.errors import UsageError


def insist_on_yes(question: str, *, nobody: str, refused: str) -> None:
    """Return once a person has said yes, after the question was asked.

    Parameters
    ----------
    question
        What is asked.
    nobody, refused
        Told where nobody can be asked, and where the answer is no.

    Raises
    ------
    UsageError
        In either case.
    """
    if not sys.stdin.isatty():
        raise UsageError(nobody)
    _forget_what_was_typed()
    if not typer.confirm(question, err=True):
        raise UsageError(refused)


def _forget_what_was_typed() -> None:
    """Drop what was typed before anybody could read the question: it answers none."""
    with suppress(OSError, ValueError, termios.error):  # no terminal of the system's own
        termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)
