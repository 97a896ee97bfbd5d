"""The one reader of YAML files: plain data, and the line on which every key stands.

Scalars follow YAML 1.2's core schema, so ``60e-6`` is a number and ``yes`` is text. Keys are
always text. A key that stands twice, an unknown tag or an alias of itself is a problem. Why it
stands on PyYAML and not on ruamel.yaml: docs/decisions/0006-one-yaml-reader-on-pyyaml.md.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from motorctl.errors import ConfigError, Problem

KeyPath = tuple[str | int, ...]

MAX_BYTES = 4_000_000
MAX_VALUES = 100_000
"""Aliases of aliases can make a small file arbitrarily large."""
MAX_DEPTH = 32
DISPUTED = "\t?"
"""Signs that libyaml takes for a part of a word where PyYAML refuses the text."""

_TAG = "tag:yaml.org,2002:"
_TRUE = ("true", "True", "TRUE")
_KINDS: dict[type[yaml.Node], tuple[str, ...]] = {
    yaml.MappingNode: ("map",),
    yaml.SequenceNode: ("seq",),
    yaml.ScalarNode: ("str", "int", "float", "bool", "null", "merge"),
}


class CoreLoader(yaml.SafeLoader):
    """PyYAML's reader with the implicit types of YAML 1.2's core schema; no .nan.

    Attributes
    ----------
    aliases
        Where the aliases stand that are values of keys, begin and end in characters, by the `id`
        of the key's node.
    """

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.aliases: dict[int, tuple[int, int]] = {}

    def compose_node(self, parent: yaml.Node | None, index: object) -> yaml.Node | None:
        """Compose a node, and note where it is an alias."""
        if self.check_event(yaml.AliasEvent) and isinstance(index, yaml.Node):
            event = self.peek_event()  # type: ignore[no-untyped-call]
            self.aliases[id(index)] = (event.start_mark.index, event.end_mark.index)
        return super().compose_node(parent, index)  # type: ignore[arg-type]


for _name, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9]+|0x[0-9a-fA-F]+|0o[0-7]+", list("-+0123456789")),
    (
        "float",
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)",
        list("-+.0123456789"),
    ),
    ("merge", r"<<", ["<"]),
):
    CoreLoader.add_implicit_resolver(_TAG + _name, re.compile(rf"^(?:{_pattern})$"), _first)


@dataclass(frozen=True)
class Document:
    """A YAML file, or plain data that stand for one, and where in it everything stands."""

    file: str
    data: dict[str, Any]
    lines: Mapping[KeyPath, int] = field(default_factory=dict)
    problems: tuple[Problem, ...] = ()
    """What is wrong with the text itself, such as keys that stand twice."""

    def line(self, path: KeyPath) -> int | None:
        """Return the line of a key, or of the nearest key around it that is in the file."""
        for end in range(len(path), -1, -1):
            if path[:end] in self.lines:
                return self.lines[path[:end]]
        return None

    def problem(self, path: KeyPath, message: str) -> Problem:
        """Return a problem with the value at `path`, located."""
        return Problem(self.file, self.line(path), dotted(path), message)

    def at(self, path: KeyPath) -> Any:
        """Return the value at `path`, None where there is none."""
        return find(self.data, path)

    def part(self, path: KeyPath) -> dict[str, Any]:
        """Return the mapping at `path`, an empty one where there is none."""
        found = self.at(path)
        return found if isinstance(found, dict) else {}

    def refuse(self, problems: Iterable[Problem]) -> None:
        """Raise the problems of the text and those given, if there is one: all at once.

        Raises
        ------
        ConfigError
            With every problem once: this file's first, by lines.
        """
        unique = dict.fromkeys((*self.problems, *problems))
        if unique:
            here = self.file
            raise ConfigError(sorted(unique, key=lambda p: (p.file != here, p.line or 0, p.key)))


def holds(value: Any, part: str | int) -> bool:
    """Tell whether a mapping has this key, or a list this place."""
    if isinstance(value, Mapping):
        return part in value
    return isinstance(value, list) and isinstance(part, int) and part < len(value)


def find(data: Any, path: KeyPath) -> Any:
    """Return the value at `path` within plain data, None where there is none."""
    for part in path:
        if not holds(data, part):
            return None
        data = data[part]
    return data


def dotted(path: KeyPath) -> str:
    """Write a path as people do: ``axes.x.limits.travel_m[0]``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def read_document(
    path: Path, *, such_as: str = "name: my-machine", as_text: bool = False
) -> Document:
    """Read a YAML file whose top level is a mapping.

    Parameters
    ----------
    path
        The file, UTF-8, of at most MAX_BYTES.
    such_as
        A key and a value of such a file, for who gave another one.
    as_text
        Leave scalars as they are written, for models that decide by themselves what is a number:
        a column of a table may be called 007. Nothing stays None.

    Returns
    -------
    Document
        With the problems of parts of the text, such as a key that stands twice, so that they can
        be told with the others.

    Raises
    ------
    ConfigError
        Where the file cannot be read, is no text, no YAML or no mapping.
    """
    text = _read_text(path)
    try:
        node = _composed(text)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        what = " ".join(part for part in (error.problem, error.context) if part)
        if "character '%'" in what:
            what += '; YAML has % in quotes: "%"'
        line = mark.line + 1 if mark else None
        raise ConfigError([Problem(str(path), line, "", f"not valid YAML: {what}")]) from error
    except yaml.YAMLError as error:
        reason = str(error).splitlines()[0]
        raise ConfigError([Problem(str(path), None, "", f"not valid YAML: {reason}")]) from error
    except RecursionError as error:
        raise ConfigError([Problem(str(path), None, "", "nested too deeply")]) from error
    if node is None:
        message = f"the file is empty; should have keys and values, such as {such_as}"
        raise ConfigError([Problem(str(path), None, "", message)])
    if not isinstance(node, yaml.MappingNode):
        line = node.start_mark.line + 1
        message = f"should be a mapping of keys to values, such as {such_as}"
        raise ConfigError([Problem(str(path), line, "", message)])
    reader = _Reader(str(path), as_text)
    reader.lines[()] = node.start_mark.line + 1
    data = reader.value(node, ())
    return Document(str(path), data, reader.lines, tuple(reader.problems))


def _composed(text: str) -> yaml.Node | None:
    """Return the nodes of a text, through libyaml where PyYAML has it, which takes a twentieth.

    What it refuses, PyYAML's own reader refuses in its own words; where it is known to accept more
    than that, that one reads.
    """
    if yaml.__with_libyaml__ and not any(sign in text for sign in DISPUTED):
        with suppress(yaml.YAMLError):
            return yaml.compose(text, Loader=_quick_loader())
    return yaml.compose(text, Loader=CoreLoader)


@cache
def _quick_loader() -> type[yaml.CSafeLoader]:
    """Return the reader of libyaml, with the implicit types of `CoreLoader`."""

    class QuickLoader(yaml.CSafeLoader):
        yaml_implicit_resolvers = CoreLoader.yaml_implicit_resolvers

    return QuickLoader


def _read_text(path: Path) -> str:
    def refuse(message: str) -> ConfigError:
        return ConfigError([Problem(str(path), None, "", message)])

    if path.is_dir():
        raise refuse("is a directory; should be a YAML file")
    try:
        with path.open("rb") as file:
            raw = file.read(MAX_BYTES + 1)
    except FileNotFoundError as error:
        raise refuse("there is no such file") from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise refuse(f"cannot be read: {reason}") from error
    if len(raw) > MAX_BYTES:
        raise refuse(f"is larger than {MAX_BYTES} bytes; should be a YAML configuration")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise refuse(f"is not UTF-8 text (byte {error.start + 1}); should be YAML") from error
    if "\0" in text:
        raise refuse("is a binary file; should be YAML")
    return text


class _Reader:
    """Turns nodes into plain data and notes where each key stands."""

    def __init__(self, file: str, as_text: bool) -> None:
        self._file = file
        self._as_text = as_text
        self.lines: dict[KeyPath, int] = {}
        self.problems: list[Problem] = []
        self._left = MAX_VALUES
        self._open: list[yaml.Node] = []

    def value(self, node: yaml.Node, path: KeyPath) -> Any:
        """Return the data of a node."""
        self._left -= 1
        if self._left < 0 or len(self._open) > MAX_DEPTH or node in self._open:
            if self._left >= 0:
                reason = "nested too deeply" if node not in self._open else "contains itself"
                self._problem(node, path, reason)
            elif self._left == -1:
                self._problem(node, path, f"more than {MAX_VALUES} values")
            return None
        kind = node.tag.removeprefix(_TAG)
        if kind not in _KINDS[type(node)]:
            self._problem(node, path, f"the tag {node.tag} has no meaning here; remove it")
        self._open.append(node)
        try:
            if isinstance(node, yaml.MappingNode):
                return self._mapping(node, path)
            if isinstance(node, yaml.SequenceNode):
                items = []
                for index, item in enumerate(node.value):
                    self.lines[(*path, index)] = item.start_mark.line + 1
                    items.append(self.value(item, (*path, index)))
                return items
            return self._scalar(node, path)
        finally:
            self._open.pop()

    def _mapping(self, node: yaml.MappingNode, path: KeyPath) -> dict[str, Any]:
        data: dict[str, Any] = {}
        own: dict[str, int] = {}
        for key, item, merged in self._entries(node, path):
            line = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode):
                self._problem(key, path, "a key should be a word, found a list or a mapping")
                continue
            name = key.value
            if merged and name in data:
                continue
            if name in own:
                message = f"stands twice, first on line {own[name]}; remove one"
                self._problem(key, (*path, name), message)
                continue
            if not merged:
                own[name] = line
            self.lines[(*path, name)] = line
            data[name] = self.value(item, (*path, name))
        return data

    def _entries(
        self, node: yaml.MappingNode, path: KeyPath, depth: int = 0
    ) -> Iterator[tuple[yaml.Node, yaml.Node, bool]]:
        """Yield the entries of a mapping, its own first, then those that it merges with <<."""
        merges: list[yaml.Node] = []
        for key, item in node.value:
            if key.tag == _TAG + "merge":
                merges += item.value if isinstance(item, yaml.SequenceNode) else [item]
            else:
                yield key, item, depth > 0
        for source in merges:
            if isinstance(source, yaml.MappingNode) and source not in self._open and depth < 8:
                yield from self._entries(source, path, depth + 1)
            else:
                self._problem(source, path, "<< should name a mapping, such as '<<: *anchor'")

    def _scalar(self, node: yaml.Node, path: KeyPath) -> Any:
        text: str = node.value
        kind = node.tag.removeprefix(_TAG)
        if self._as_text:
            return None if kind == "null" else text
        try:
            if kind == "int":
                # A whole number beyond 64 bits is a number all the same.
                return int(text, 0 if text[1:2] in "xo" else 10) if len(text) < 19 else float(text)
            if kind == "float":
                return float(text.replace(".inf", "inf").replace(".I", "I"))
        except ValueError:
            self._problem(node, path, f"found '{text}', should be a number")
            return None
        if kind == "bool":
            return text in _TRUE
        if kind == "null":
            return None
        return text

    def _problem(self, node: yaml.Node, path: KeyPath, message: str) -> None:
        line = node.start_mark.line + 1
        self.problems.append(Problem(self._file, line, dotted(path), message))
