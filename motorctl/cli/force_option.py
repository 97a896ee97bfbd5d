"""The option of commands that write a file of a person's own."""

from __future__ import annotations

from typing import Annotated

import typer

ForceOption = Annotated[
    bool, typer.Option("--force", help="Replace what is there already under that name.")
]
