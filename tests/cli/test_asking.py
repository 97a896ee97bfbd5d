"""Before something moves a person says yes to what is asked, not to what they have not read yet."""

from __future__ import annotations

import os
import pty
import threading
from collections.abc import Iterator

import pytest

from motorctl.cli.asking import insist_on_yes
from motorctl.errors import UsageError


@pytest.fixture
def person(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Return a person's end of the terminal at standard input."""
    end, terminal = pty.openpty()
    with os.fdopen(terminal, "r") as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        yield end
    os.close(end)


def ask() -> None:
    insist_on_yes("Run it?", nobody="nobody is there", refused="nobody said yes")


@pytest.mark.parametrize("answer", ["y", "n"])
def test_what_was_typed_before_the_question_does_not_answer_it(person: int, answer: str) -> None:
    os.write(person, b"n\n" if answer == "y" else b"y\n")
    answered = threading.Event()

    def types() -> None:
        while not answered.wait(0.2):
            os.write(person, f"{answer}\n".encode())

    types_later = threading.Thread(target=types)
    types_later.start()
    try:
        if answer == "y":
            ask()
        else:
            with pytest.raises(UsageError, match="nobody said yes"):
                ask()
    finally:
        answered.set()
        types_later.join()
