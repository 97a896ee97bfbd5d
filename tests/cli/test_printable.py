"""What others wrote is shown, and never obeyed by the terminal."""

import sys
from pathlib import Path

import pytest

from motorctl.cli import main
from motorctl.cli.say import say
from motorctl.printable import printable


@pytest.mark.parametrize("text", ["", "following error 2 mm, µ, 軸", "two\nlines\tand a tab"])
def test_plain_text_stays(text):
    assert printable(text) == text


@pytest.mark.parametrize("text", ["\x1b[2J", "\x07", "\r", "\x9b31m", "\u202e", "\u2028"])
def test_what_a_terminal_would_obey_is_written_out(text):
    shown = printable(f"a{text}b")
    assert text not in shown
    assert shown.startswith("a\\")
    assert shown.isprintable()


def test_an_error_that_quotes_a_file_shows_its_name_harmlessly(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["motorctl", "check", "\x1b[31mred.yaml"])
    with pytest.raises(SystemExit):
        main()
    told = capsys.readouterr().err
    assert "\x1b" not in told
    assert "red" in told


@pytest.mark.parametrize("err", [False, True])
def test_what_a_command_says_moves_no_terminal(
    capsys: pytest.CaptureFixture[str], err: bool
) -> None:
    say(Path("a\x1b[2Jb.csv"), err=err)
    said = capsys.readouterr()
    assert (said.out, said.err)[err] == "a\\x1b[2Jb.csv\n"
    assert (said.out, said.err)[not err] == ""
