"""What devices and users call themselves is told in status and journal, and obeyed by none."""

from __future__ import annotations

import copy
import logging
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import typer
from served_socket import served
from test_daemon_status_view import DOCUMENT
from typer.testing import CliRunner

from motorctl.cli import axis_commands, status
from motorctl.daemon.journal import journal

UP_AND_ERASE = "\x1b[1A\x1b[2K"
"""Goes to the line above and rubs it out."""


def run(group: ModuleType, *arguments: object) -> str:
    app = typer.Typer()
    group.register(app)
    app.command("other")(lambda: None)  # so that the command's name stays a word
    result = CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def harmless(shown: str) -> bool:
    return all(c.isprintable() or c == "\n" for c in shown)


@pytest.fixture
def answers(tmp_path: Path) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Let a daemon answer every request with a document, and return its socket and that."""
    document: dict[str, Any] = {}

    async def answer(_: object) -> dict[str, Any]:
        return document

    with served(tmp_path / "s.sock", answer) as path:
        yield path, document


@pytest.mark.parametrize("spoilt", ["motion", "fault", "device", "note", "file"])
def test_the_status_shows_words_of_others_and_obeys_none(
    answers: tuple[Path, dict[str, Any]], spoilt: str
) -> None:
    path, document = answers
    document |= copy.deepcopy(DOCUMENT)
    words = f"mine{UP_AND_ERASE}"
    axis = document["axes"]["x"]
    if spoilt == "motion":
        axis["motion"]["name"] = words
    elif spoilt == "fault":
        axis["fault"] = {"message": words, "cause": "estop"}
    elif spoilt == "device":
        axis["device"] = words
    elif spoilt == "note":
        document["loop"]["degraded"] = [words]
    else:
        document["recording"]["file"] = words
    shown = run(status, "status", "--socket", path)
    assert harmless(shown)
    assert r"mine\x1b[1A\x1b[2K" in shown


def test_a_programs_name_begins_no_line_of_the_status(
    answers: tuple[Path, dict[str, Any]],
) -> None:
    path, document = answers
    document |= copy.deepcopy(DOCUMENT)
    before = run(status, "status", "--socket", path)
    document["axes"]["x"]["motion"]["name"] = "a\nb"
    shown = run(status, "status", "--socket", path)
    assert len(shown.splitlines()) == len(before.splitlines())
    assert r"follows a\nb" in shown


def test_a_command_shows_a_programs_name_harmlessly(
    answers: tuple[Path, dict[str, Any]],
) -> None:
    path, document = answers
    name = f"a{UP_AND_ERASE}"
    document |= {"program": name, "axes": ["x"], "duration_s": 1.0, "approach_s": 0.0}
    shown = run(axis_commands, "program", "x", name, "--socket", path)
    assert harmless(shown)
    assert r"program a\x1b[1A\x1b[2K on x" in shown


def raise_error(words: str) -> None:
    raise ValueError(words)


def test_the_journal_writes_out_what_a_terminal_would_obey(
    capfd: pytest.CaptureFixture[str],
) -> None:
    log = logging.getLogger("motorctl")
    with journal():
        name = f"box{UP_AND_ERASE}\nmotorctl: axis x: off"
        log.warning("the device calls itself %s", name)
        try:
            raise_error(name)
        except ValueError:
            log.exception("it failed")
    told = capfd.readouterr().err
    assert harmless(told)
    assert r"motorctl: the device calls itself box\x1b[1A\x1b[2K" in told
    # what goes on in another line is no message of its own
    messages = [line for line in told.splitlines() if not line.startswith(" ")]
    assert [line.partition(" box")[0] for line in messages] == [
        "motorctl: the device calls itself",
        "motorctl: it failed",
    ]
