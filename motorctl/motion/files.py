"""Programs from YAML, checked: in a configuration, or in a file of their own."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from itertools import islice
from pathlib import Path
from typing import Annotated

from pydantic import Field, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from motorctl.errors import ConfigError, Problem
from motorctl.located_yaml import read_document
from motorctl.motion.back_and_forth import BackAndForth
from motorctl.motion.circle import Circle
from motorctl.motion.move import PointToPoint
from motorctl.motion.moves import Moves
from motorctl.motion.points import Points
from motorctl.motion.program import Program, ProgramModel
from motorctl.motion.table import axes_of_header

AnyProgram = Annotated[
    PointToPoint | BackAndForth | Circle | Points | Moves, Field(discriminator="kind")
]
KINDS: dict[str, type[ProgramModel]] = {
    "point_to_point": PointToPoint,
    "back_and_forth": BackAndForth,
    "circle": Circle,
    "points": Points,
    "moves": Moves,
}
_ADAPTER: TypeAdapter[Program] = TypeAdapter(AnyProgram)

MOST_PROBLEMS = 1000
"""So many problems of one program are told one by one. More: somebody waits while words are made of
them, 4 µs each. Fewer: a long list of moves is mended in rounds. By hand."""
MOST_KEYS_TOLD = 32
"""Of a program, or of a move, with more problems than that, so many keys are looked at. Larger:
more words; smaller: a wrong key behind right ones is not named. By hand: all kinds have fewer."""
MOST_ITEMS_TOLD = 20
"""The same, of moves in a list."""

Location = tuple[str | int, ...]


def _no_line(location: Location) -> int | None:
    return None


def parse_program(
    name: str,
    keys: object,
    *,
    directory: Path,
    axis_names: Collection[str],
    file: str,
    line_of: Callable[[Location], int | None] = _no_line,
    prefix: str = "",
) -> Program:
    """Make a program from the keys that YAML has for it.

    Parameters
    ----------
    name
        What the program is called.
    keys
        Its keys and values.
    directory
        Where a relative CSV file is looked for.
    axis_names
        The axes that it may move.
    file, prefix, line_of
        For messages: the file's name, what precedes a key, and the line of the path to a key within
        `keys`.

    Returns
    -------
    Program
        The program, checked by itself; whether an axis can follow it is not.

    Raises
    ------
    ConfigError
        With all problems.
    """
    if not isinstance(keys, Mapping):
        message = f"must be a mapping with kind: {', '.join(KINDS)}"
        raise ConfigError([Problem(file, line_of(()), prefix.rstrip("."), message)])
    if "name" in keys:
        message = "unknown key: the name of a program is its key, or the name of its file"
        raise ConfigError([Problem(file, line_of(("name",)), prefix + "name", message)])
    try:
        program = _ADAPTER.validate_python({**keys, "name": name}, context={"directory": directory})
    except ValidationError as error:
        details = [_located(detail) for detail in _told(error, keys, directory)]
        if error.error_count() > len(details):
            more = f"{error.error_count() - len(details)} more problems are not told one by one"
            details.append(((), more))
        raise ConfigError(
            [
                Problem(file, line_of(location), prefix + ".".join(map(str, location)), message)
                for location, message in details
            ]
        ) from error
    axis_key = "axis" if "axis" in keys else "axes"
    unknown = [axis for axis in program.axes if axis not in axis_names]
    if unknown:
        known = ", ".join(axis_names) or "none"
        message = f"unknown axis {', '.join(map(repr, unknown))}; known: {known}"
        raise ConfigError([Problem(file, line_of((axis_key,)), prefix + axis_key, message)])
    return program


def load_program_file(path: Path, axis_names: Collection[str]) -> Program:
    """Load the one program of a YAML file, or the points of a CSV file; named after the file.

    Parameters
    ----------
    path
        The file; what ends in .csv is read as points.
    axis_names
        The axes that it may move.

    Returns
    -------
    Program
        The program, checked by itself; whether an axis can follow it is not.

    Raises
    ------
    ConfigError
        With file, line and key of every problem.
    """
    if path.suffix.lower() == ".csv":
        return Points(name=path.stem, axes=axes_of_header(path, axis_names), file=path)
    document = read_document(path, such_as=f"kind: {', '.join(KINDS)}")
    document.refuse(())
    return parse_program(
        path.stem,
        document.data,
        directory=path.parent,
        axis_names=axis_names,
        file=document.file,
        line_of=document.line,
    )


def _told(
    error: ValidationError, keys: Mapping[str, object], directory: Path
) -> list[ErrorDetails]:
    """Return what is wrong: all of it, or, where that is more than anybody reads, the first of it.

    Making words of each takes long, and nothing else is done in a process meanwhile.
    """
    if error.error_count() <= MOST_PROBLEMS:
        return error.errors(include_url=False)
    short = dict(islice(keys.items(), MOST_KEYS_TOLD))
    for key, value in short.items():
        if isinstance(value, list):
            short[key] = [_first_keys(item) for item in value[:MOST_ITEMS_TOLD]]
    try:
        _ADAPTER.validate_python({**short, "name": ""}, context={"directory": directory})
    except ValidationError as first:
        return first.errors(include_url=False)
    except ConfigError:  # of the points in its file
        pass
    return []


def _first_keys(item: object) -> object:
    return dict(islice(item.items(), MOST_KEYS_TOLD)) if isinstance(item, Mapping) else item


def _located(detail: ErrorDetails) -> tuple[Location, str]:
    """Turn a finding of pydantic's into the path to a key and a message for its author."""
    location = detail["loc"]
    if location and location[0] in KINDS:  # the discriminator's tag is not a key
        kind, location = KINDS[str(location[0])], location[1:]
    given = detail["input"]
    match detail["type"]:
        case "union_tag_not_found":
            return ("kind",), f"this key is missing; it is one of: {', '.join(KINDS)}"
        case "union_tag_invalid":
            kind_given = given.get("kind") if isinstance(given, Mapping) else given
            return ("kind",), f"unknown kind '{kind_given}'; known: {', '.join(KINDS)}"
        case "missing":
            return location, "this key is missing"
        case "extra_forbidden":
            known = [key for key in kind.model_fields if key != "name"]
            return location, f"unknown key; known: {', '.join(known)}"
        case _:
            message = detail["msg"].removeprefix("Value error, ")
            return location, f"{message} (given: {repr(given)[:80]})"
