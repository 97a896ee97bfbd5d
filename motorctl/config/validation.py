"""Check data against a pydantic model; every problem becomes one message with key and line."""

from __future__ import annotations

import difflib
import json
import math
import types
import typing
from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from motorctl.config.keys import SMALLEST
from motorctl.errors import Problem
from motorctl.located_yaml import Document, KeyPath, dotted, find, holds

M = TypeVar("M", bound=BaseModel)
Finding = tuple[KeyPath, str]
"""A place within what was checked, and what is wrong there."""

_EXPECTED = {
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "string_type": "text",
    "finite_number": "a finite number",
    "dict_type": "a mapping of keys to values",
    "model_type": "a mapping of keys to values",
    "model_attributes_type": "a mapping of keys to values",
    "list_type": "a list",
    "tuple_type": "a list",
}


def validate(
    document: Document, path: KeyPath, model: type[M], data: Any
) -> tuple[M | None, list[Problem]]:
    """Check data against a model.

    Types are strict as in JSON: text is no number, 1.0 is no whole number, and a list may fill a
    tuple.

    Parameters
    ----------
    document, path
        Where the data stand; the document only locates them.
    model
        What they should be.
    data
        Plain data.

    Returns
    -------
    tuple
        The model, None where the data do not fit, and every problem.
    """
    try:
        return model.model_validate_json(json.dumps(data), strict=True), []
    except ValidationError as error:
        details = error.errors(include_url=False)
        return None, [_problem(document, path, model, data, detail) for detail in details]


def read_keys(model: type[M], data: Any) -> M | None:
    """Return data as a model, None where they do not fit: whoever checks the whole says why."""
    try:
        return model.model_validate_json(json.dumps(data), strict=True)
    except ValidationError:
        return None


def validate_options(
    document: Document,
    path: KeyPath,
    model: type[M],
    data: Any,
    also: Iterable[str],
    context: Mapping[str, Any] | None = None,
) -> tuple[M | None, list[Problem]]:
    """Check the options of a driver or an effect, which a third party may have written.

    Its validators may expand what stands in the file, so they are not held to strict types; text
    and truth values where the file should have numbers are problems all the same.

    Parameters
    ----------
    document, path
        Where the options stand; the document only locates them.
    model
        The options' own model.
    data
        Plain data.
    also
        Names of the keys that may stand beside the options.
    context
        What validators are told: the directory of the file, for names of files in the options.

    Returns
    -------
    tuple
        The options, None where there is a problem, and every problem.
    """
    text = json.dumps(data)
    problems: list[Problem] = []
    options: M | None = None
    try:
        options = model.model_validate_json(text, context=context)
        model.model_validate_json(text, strict=True, context=context)
    except ValidationError as error:
        for detail in error.errors(include_url=False):
            found = find(data, detail["loc"])
            if options is None or (detail["type"] in _EXPECTED and isinstance(found, str | bool)):
                problems.append(_problem(document, path, model, data, detail, also))
    except Exception as error:  # a validator may fail in any way
        message = f"cannot be checked: {type(error).__name__}: {error}"
        problems.append(document.problem(path, message))
    return None if problems else options, problems


def suggest(found: str, known: Iterable[str]) -> str:
    """Return a hint: the known word that was meant, or the known words."""
    words = sorted(known)
    near = difflib.get_close_matches(found, words, 1, 0.6)
    if near:
        return f"did you mean '{near[0]}'?"
    return f"known here: {', '.join(words)}" if words else "nothing is known here"


def shown(value: Any) -> str:
    """Write a value as it may stand in the file, cut to one line."""
    if value is None:
        return "nothing"
    if isinstance(value, str):
        text = f"'{value}'"
    elif isinstance(value, float) and math.isinf(value):
        text = ".inf" if value > 0 else "-.inf"
    else:
        try:
            text = json.dumps(value, ensure_ascii=False)
        except (TypeError, ValueError):
            text = str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _problem(
    document: Document,
    path: KeyPath,
    model: type[BaseModel],
    data: Any,
    detail: ErrorDetails,
    also: Iterable[str] = (),
) -> Problem:
    """Return one of pydantic's errors at the place in the file that it is about."""
    loc = tuple(detail["loc"])
    # pydantic ends the place of a key that is wrong itself with "[key]"; a file may have that key
    if loc[-1:] == ("[key]",) and detail["type"] != "extra_forbidden":
        loc = loc[:-1]
    where: list[int | str] = []
    value = data
    for key in loc:  # some name no place in the file, such as the branch of a union
        # keys of a file are text, of a model they may be numbers
        part = str(key) if isinstance(value, Mapping) else key
        if holds(value, part):
            value = value[part]
            where.append(part)
    if detail["type"] == "missing" and not holds(value, loc[-1]):
        where.append(loc[-1])
    message = _message(model, detail, loc, also)
    if loc and (not where or str(where[-1]) != str(loc[-1])):
        message += f" (at {dotted(loc)})"
    return document.problem((*path, *where), message)


def _message(
    model: type[BaseModel], detail: ErrorDetails, loc: KeyPath, also: Iterable[str]
) -> str:
    kind, found = detail["type"], detail["input"]
    if kind == "missing":
        if isinstance(loc[-1], int):
            return "is missing; the list is too short"
        field = _fields(model, loc[:-1]).get(loc[-1])
        return "is missing" + (f"; {field.description}" if field and field.description else "")
    if kind == "extra_forbidden":
        known = [*_fields(model, loc[:-1]), *(also if len(loc) == 1 else ())]
        return f"unknown key; {suggest(str(loc[-1]), known)}"
    if kind in _EXPECTED:
        return f"found {shown(found)}, should be {_EXPECTED[kind]}"
    if kind == "literal_error":
        expected = detail["ctx"]["expected"]
        words = [word.strip("'") for word in expected.replace(" or ", ", ").split(", ")]
        near = difflib.get_close_matches(str(found), words, 1, 0.6)
        hint = f"; did you mean '{near[0]}'?" if near and near[0] != str(found) else ""
        return f"found {shown(found)}, should be {expected}{hint}"
    if kind == "greater_than_equal" and detail["ctx"]["ge"] == SMALLEST and found <= 0:
        return f"found {shown(found)}, should be greater than 0"
    text = detail["msg"].removeprefix("Value error, ")
    for start in ("Input ", "String ", "Value ", "Dictionary ", "List ", "Tuple "):
        text = text.removeprefix(start)
    return f"found {shown(found)}, {text}"


def _fields(model: type[BaseModel], where: KeyPath) -> Mapping[str, Any]:
    """Return the fields of the model that describes the place `where` within `model`."""
    current: Any = model
    for part in where:
        current = _unwrap(current)
        if isinstance(current, type) and issubclass(current, BaseModel):
            field = current.model_fields.get(str(part))
            current = field.annotation if field else None
        elif typing.get_origin(current) in (dict, list, tuple):
            current = typing.get_args(current)[-1]
        else:
            return {}
    current = _unwrap(current)
    if isinstance(current, type) and issubclass(current, BaseModel):
        return current.model_fields
    return {}


def _unwrap(annotation: Any) -> Any:
    """Take Annotated[X, ...] and X | None to X."""
    while True:
        origin = typing.get_origin(annotation)
        if origin is typing.Annotated:
            annotation = typing.get_args(annotation)[0]
        elif origin in (typing.Union, types.UnionType):
            rest = [a for a in typing.get_args(annotation) if a is not type(None)]
            if len(rest) != 1:
                return annotation
            annotation = rest[0]
        else:
            return annotation
