"""What a shell offers where the tabulator is pressed: configurations and axes."""

from __future__ import annotations

from pathlib import Path

import typer

from motorctl.errors import MotorctlError


def configurations(incomplete: str) -> list[str]:
    """Return the shipped configurations, folders and YAML files that begin with some characters."""
    from motorctl.config.shipped import shipped_configs

    shipped = [name for name in shipped_configs() if name.startswith(incomplete)]
    typed = Path(incomplete)
    folder, begin = (typed, "") if incomplete.endswith("/") else (typed.parent, typed.name)
    try:
        beside = sorted(path for path in folder.iterdir() if path.name.startswith(begin))
    except OSError:
        return shipped
    return shipped + [
        f"{path}/" if path.is_dir() else str(path)
        for path in beside
        if not path.name.startswith(".") and (path.is_dir() or path.suffix in (".yaml", ".yml"))
    ]


def axes(context: typer.Context, incomplete: str) -> list[str]:
    """Return the axes of the daemon that begin with some characters; none where none runs."""
    from motorctl import connect

    try:
        with connect(context.params.get("socket")) as machine:
            return [name for name in machine.status().axes if name.startswith(incomplete)]
    except (MotorctlError, OSError):
        return []
