"""Programs on their way from a client's file to the daemon: the file's content travels.

The client reads files with its user's rights and tells problems with file and line. The daemon
checks everything again, and opens no file on a client's word.
"""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from motorctl.daemon.protocol import Code, RefusedError
from motorctl.errors import MotorctlError
from motorctl.motion import Points, Program, load_program_file, parse_program

_POINTS = "points.csv"


def packed(path: Path, axis_names: Collection[str]) -> dict[str, Any]:
    """Read a program's file into the arguments of a `program` request.

    Raises
    ------
    ConfigError
        With file, line and key of every problem.
    """
    program = load_program_file(path, axis_names)
    # Every kind of program that a file can hold is a pydantic model; the protocol asks for less.
    document = program.model_dump(mode="json", exclude={"name"})  # type: ignore[attr-defined]
    files = {}
    if isinstance(program, Points):
        document["file"] = _POINTS
        files[_POINTS] = program.file.read_text(encoding="utf-8-sig")
    return {"name": program.name, "document": document, "files": files}


def unpacked(
    name: str,
    document: Mapping[str, Any],
    files: Mapping[str, str],
    axis_names: Collection[str],
) -> Program:
    """Make the program of a `program` request.

    Parameters
    ----------
    name
        What the program is called.
    document
        Its keys, as YAML has them.
    files
        Text of the file that the document names.
    axis_names
        The machine's axes.

    Raises
    ------
    RefusedError
        With BAD_PROGRAM and every problem.
    """
    wanted = document.get("file")
    if wanted is not None and wanted not in files:
        raise RefusedError(
            Code.BAD_PROGRAM, f"{name}: file: its text is not in the request's files"
        )
    with tempfile.TemporaryDirectory(prefix="motorctl-") as folder:
        keys = dict(document)
        if wanted is not None:
            (Path(folder) / _POINTS).write_text(files[wanted])
            keys["file"] = _POINTS
        try:
            return parse_program(
                name, keys, directory=Path(folder), axis_names=axis_names, file=name
            )
        except MotorctlError as error:
            raise RefusedError(Code.BAD_PROGRAM, str(error).replace(f"{folder}/", "")) from error
