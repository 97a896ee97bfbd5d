"""The first word of a command, before the libraries are loaded that take seconds the first time.

So nothing is imported here that is not Python's own, or next to nothing.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress

from motorctl.cache_folder import cache_root
from motorctl.cli.say import say

DAEMON = "run"
SHORT = ("--help", "--version")
"""What is answered at once."""


def say_first(words: Sequence[str]) -> None:
    """Tell that a command begins, where it may be silent for seconds before it says more.

    Of the daemon always, and a SIGTERM or Ctrl-C from here on is told too; of any other command the
    first time that this user runs one, where a person sees it.

    Parameters
    ----------
    words
        The command line, without the program's name.
    """
    command = next((word for word in words if not word.startswith("-")), None)
    if command is None or any(word in SHORT for word in words):
        return
    if command == DAEMON:
        # Before the word: whoever reads it may send the signal at once.
        for number in (signal.SIGTERM, signal.SIGINT):
            if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                signal.signal(number, _end)
        say("motorctl: starting", err=True)
    elif sys.stderr and sys.stderr.isatty() and not cache_root().exists():
        say("motorctl: loading libraries, which takes some seconds the first time", err=True)


def _end(number: int, frame: object) -> None:
    """End before there is a supervisor that could: nothing is switched on yet.

    Not by an exception: libraries that are being loaded drop it where it comes up in a callback of
    theirs, and the daemon would go on.
    """
    # Not by print, which may be what is interrupted; where nobody reads there is nobody to tell.
    with suppress(OSError):
        told = "motorctl: told to stop while starting, before anything was switched on\n"
        os.write(2, told.encode())
    os._exit(0)
