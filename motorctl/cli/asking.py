"""Ask a person before something moves."""

from __future__ import annotations

import sys

import typer

from motorctl.errors import UsageError


def insist_on_yes(question: str, *, nobody: str, refused: str) -> None:
    """Return once a person has said yes.

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
    if not typer.confirm(question, err=True):
        raise UsageError(refused)
