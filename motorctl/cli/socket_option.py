"""The option that names a daemon's control socket."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

SocketOption = Annotated[
    Path | None,
    typer.Option(
        "--socket",
        metavar="PATH",
        help="Control socket. Usual: $RUNTIME_DIRECTORY/motorctl.sock under systemd, "
        "/run/motorctl/motorctl.sock for root, else $XDG_RUNTIME_DIR/motorctl.sock; a command also "
        "finds the only service, /run/motorctl/NAME/motorctl.sock.",
        show_default=False,
    ),
]
