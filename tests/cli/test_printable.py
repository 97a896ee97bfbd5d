"""What others wrote is shown, and never obeyed by the terminal."""

import sys

import pytest

from motorctl.cli import main
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
