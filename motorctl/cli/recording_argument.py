"""How commands are told which recording they are to read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

RecordingParts = Annotated[
    list[Path],
    typer.Argument(
        metavar="RECORDING...",
        help="A log, a CSV, Parquet, MAT or HDF5 file, or its YAML description. Several logs of "
        "one run, a folder of them, or the run's name: all of it as one recording.",
        show_default=False,
    ),
]
WholeRun = Annotated[
    bool, typer.Option("--whole-run", help="A log stands for all logs of its run in its folder.")
]
AllowCode = Annotated[
    list[str] | None,
    typer.Option(
        metavar="MODULE",
        help="Import this module, or this package, where the log's configuration names effects in "
        "it. As often as needed.",
    ),
]
