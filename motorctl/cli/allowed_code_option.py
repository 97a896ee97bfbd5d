"""The option that names the list of code that a configuration may run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

AllowedCodeOption = Annotated[
    Path | None,
    typer.Option(
        "--only-allowed-code",
        metavar="FILE",
        help="Of drivers and effects that the configuration names as package.module:Class, import "
        "those only whose module has a line in FILE. Usual: all; the service says "
        "/etc/motorctl/allowed_code.",
        show_default=False,
    ),
]
