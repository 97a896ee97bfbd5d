"""How a command writes to a person or a script: what others wrote is shown, and never obeyed."""

from __future__ import annotations

import sys

from motorctl.printable import printable


def say(text: object = "", *, err: bool = False) -> None:
    """Write a line, or several, to standard output, without what a terminal would obey.

    Parameters
    ----------
    text
        A sentence, a path or a JSON document.
    err
        Write to standard error instead.
    """
    print(printable(str(text)), file=sys.stderr if err else sys.stdout, flush=True)
