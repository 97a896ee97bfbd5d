"""YAML as a person would write it: small parts on one line, comments where they belong."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

Path = tuple[str | int, ...]

WIDTH = 100
"""Longest line, as in the shipped configurations."""
COMMENT_COLUMN = 36
"""Where comments stand behind short lines."""
PLAIN = re.compile(r"[A-Za-z/][A-Za-z0-9_./-]*(:[A-Za-z0-9_./-]+)*")
RESERVED = {"null", "Null", "NULL", "true", "True", "TRUE", "false", "False", "FALSE"}


def yaml_text(data: Mapping[str, Any], told: Mapping[Path, str]) -> str:
    """Return plain data as YAML.

    Parameters
    ----------
    data
        Mappings, lists, numbers, texts and None. A part of small parts is written in one line.
    told
        Comments, by the path of the key that each belongs to.
    """
    return "\n".join(_lines(data, told, (), "")) + "\n"


def comment_lines(words: str, indent: str = "") -> list[str]:
    """Return words as lines of a comment."""
    begin = f"{indent}# "
    return textwrap.wrap(
        words, WIDTH, initial_indent=begin, subsequent_indent=begin, break_long_words=False
    )


def _lines(
    data: Mapping[Any, Any], told: Mapping[Path, str], path: Path, indent: str
) -> Iterator[str]:
    for key, value in data.items():
        where = (*path, key)
        if isinstance(value, list) and value and isinstance(value[0], Mapping):
            yield from _with_comment(f"{indent}{key}:", told.get(where), indent)
            yield from (f"{indent}  - {_flow(part)}" for part in value)
            continue
        below = isinstance(value, Mapping) and bool(value)
        inside = any(place[: len(where)] == where and place != where for place in told)
        flow = f"{indent}{key}: {_flow(value)}"
        comment = told.get(where)
        deep = below and any(isinstance(part, Mapping) for part in value.values())
        if not below or (not inside and not deep and len(flow) <= WIDTH and path):
            yield from _with_comment(flow, comment, indent)
            continue
        if not path:
            yield ""
        yield from _with_comment(f"{indent}{key}:", comment, indent)
        yield from _lines(value, told, where, f"{indent}  ")


def _with_comment(line: str, comment: str | None, indent: str) -> Iterator[str]:
    if comment is None:
        yield line
        return
    behind = f"{line:<{COMMENT_COLUMN - 2}}  # {comment}"
    if len(behind) <= WIDTH:
        yield behind
    else:
        yield from comment_lines(comment, indent)
        yield line


def _flow(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_flow(part)}" for key, part in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_flow(part) for part in value) + "]"
    if isinstance(value, bool) or value is None:
        return json.dumps(value)
    if isinstance(value, float):
        return f"{value:.10g}".replace("e-0", "e-")
    if isinstance(value, str) and not (PLAIN.fullmatch(value) and value not in RESERVED):
        return json.dumps(value, ensure_ascii=False)
    return str(value)
