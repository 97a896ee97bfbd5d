"""How commands are told which configuration they are about."""

from __future__ import annotations

from typing import Annotated

import typer

from motorctl.cli.completion import configurations

ConfigArgument = Annotated[
    str,
    typer.Argument(
        help="A YAML file, or a shipped configuration's name.", autocompletion=configurations
    ),
]
