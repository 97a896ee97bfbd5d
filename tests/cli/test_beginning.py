"""A command that takes long to load says so before, and nothing where nobody has to wait."""

import io
import subprocess
import sys

import pytest

from motorctl.cli.beginning import say_first

HEAVY = ("typer", "numpy", "numba", "pydantic", "motorctl.config")


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def said(monkeypatch, tmp_path):
    """Return what a person sees of a command's first word."""
    monkeypatch.delenv("CACHE_DIRECTORY", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))

    def said(*words, stderr=Terminal):
        with monkeypatch.context() as patch:
            patch.setattr(sys, "stderr", stream := stderr())
            say_first(words)
        return stream.getvalue()

    return said


def test_the_first_word_needs_nothing_that_takes_long_to_load():
    code = f"import sys, motorctl.cli; print([m for m in {HEAVY} if m in sys.modules])"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"


def test_the_first_command_on_a_terminal_says_why_it_is_silent(said, tmp_path):
    told = "motorctl: loading libraries, which takes some seconds the first time\n"
    assert said("demo") == told
    (tmp_path / "motorctl").mkdir()  # where a command before has left what it compiled
    assert said("demo") == ""


@pytest.mark.parametrize("words", [[], ["--version"], ["demo", "--help"], ["run", "--help"]])
def test_what_is_answered_at_once_begins_with_its_answer(said, words):
    assert said(*words) == ""


def test_whatever_reads_standard_error_but_a_person_is_told_nothing_first(said):
    assert said("check", "small_stage", stderr=io.StringIO) == ""


DROPPED = """
import ctypes, os, signal
from motorctl.cli.beginning import say_first

def told_meanwhile():
    os.kill(os.getpid(), signal.{order})

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background ignores it
say_first(["run"])
ctypes.CFUNCTYPE(None)(told_meanwhile)()  # as compilers call back: what is raised there is dropped
print("went on")
"""


@pytest.mark.parametrize("order", ["SIGTERM", "SIGINT"])
def test_an_order_to_end_ends_the_start_of_a_daemon_whatever_library_is_being_loaded(order):
    code = DROPPED.format(order=order)
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (told.returncode, told.stdout) == (0, "")
    assert told.stderr.splitlines() == [
        "motorctl: starting",
        "motorctl: told to stop while starting, before anything was switched on",
    ]
