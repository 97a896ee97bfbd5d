"""Change values in YAML text and leave every other character as its author wrote it.

The nodes of the parsed text say where each value stands; what is changed is cut out and written
anew. Aliases and merged keys are never followed: a change of what they name would change it
elsewhere too.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import yaml

from motorctl.located_yaml import CoreLoader

KeyPath = tuple[str, ...]

COMMENT_GAP = 2
"""Spaces between a value and the comment after it. Only looks depend on it. Convention of YAML
files."""
INDENT = 2
"""Spaces by which a block is indented. Only looks depend on it. Convention of YAML files."""


@dataclass(frozen=True)
class Item:
    """A key to be written, its value as flow YAML or as further keys, and a comment."""

    key: str
    value: str | Sequence[Item]
    comment: str = ""
    above: Sequence[str] = ()
    """Comment lines that stand before it."""


@dataclass(frozen=True, order=True)
class _Change:
    """New text in place of some; what is put into the same place stands in this order."""

    begin: int
    end: int
    outwards: int
    """Minus the indent: what belongs to an inner mapping stands before what belongs to an outer."""
    number: int
    text: str


class YamlText:
    """A YAML text whose top level is a mapping, and changes to be made to it.

    Raises yaml.YAMLError where the text is no YAML.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._newline = "\r\n" if "\r\n" in text else "\n"
        loader = CoreLoader(text)
        try:
            self._root = loader.get_single_node()
        finally:
            loader.dispose()
        self._aliases = loader.aliases
        self._tokens = [
            token for token in yaml.scan(text) if token.end_mark.index > token.start_mark.index
        ]
        self._ends = [token.end_mark.index for token in self._tokens]
        self._changes: list[_Change] = []

    def mapping(self, path: KeyPath) -> bool:
        """Return whether a mapping stands at `path`, written there and not named by an alias."""
        return self._mapping(path) is not None

    def has(self, path: KeyPath) -> bool:
        """Return whether the key itself stands in the text, whatever its value."""
        return self._entry(path) is not None

    def keys_of_block(self, path: KeyPath) -> frozenset[str]:
        """Return the keys of the mapping in block style at `path`; none where there is none."""
        node = self._mapping(path)
        if node is None or not _is_block(node):
            return frozenset()
        return frozenset(str(key.value) for key, _ in node.value)

    def replace(self, path: KeyPath, value: str) -> None:
        """Write another value behind the key at `path`, which stands in the text; keep an anchor.

        A mapping in block style cannot be replaced so; raises KeyError where there is no such key.
        """
        entry = self._entry(path)
        if entry is None or _is_block(entry[1]):
            raise KeyError(path)
        key, node = entry
        if id(key) in self._aliases:
            self._change(*self._aliases[id(key)], value)
            return
        begin, end = node.start_mark.index, node.end_mark.index
        if isinstance(node, yaml.ScalarNode) and begin == end:  # a key with nothing behind it
            colon = self._after_colon(key)
            self._change(colon, colon, f" {value}")
            return
        if isinstance(node, yaml.SequenceNode) and not node.flow_style and node.value:
            self._change(self._after_colon(key), self._content_end(node), f" {value}")
            return
        for token in self._tokens:  # an anchor belongs to the key, not to its value
            if token.start_mark.index >= begin and not isinstance(
                token, yaml.AnchorToken | yaml.TagToken
            ):
                begin = token.start_mark.index
                break
        self._change(begin, end, value)

    def replace_mapping(self, path: KeyPath, value: str) -> None:
        """Write a value in place of the mapping in block style behind the key at `path`.

        What is said beside its keys goes with them. Raises KeyError where none is written there, or
        an anchor would go with it.
        """
        entry = self._entry(path)
        if entry is None or not _is_block(entry[1]) or id(entry[0]) in self._aliases:
            raise KeyError(path)
        begin, end = self._after_colon(entry[0]), self._content_end(entry[1])
        if any(
            isinstance(token, yaml.AnchorToken) and begin <= token.start_mark.index < end
            for token in self._tokens
        ):
            raise KeyError(path)
        self._change(begin, begin, f" {value}")
        self._change(self._line_end(begin), self._line_end(end), "")

    def replace_with_block(self, path: KeyPath, item: Item) -> None:
        """Write keys in place of an alias, or of nothing, behind the key at `path`.

        Raises KeyError where there is no such key, or something else is written behind it.
        """
        entry = self._entry(path)
        parent = self._mapping(path[:-1])
        if entry is None or parent is None:
            raise KeyError(path)
        key, node = entry
        begin = self._after_colon(key)
        end = begin
        if id(key) in self._aliases:
            end = self._aliases[id(key)][1]
        elif node.start_mark.index != node.end_mark.index:
            raise KeyError(path)
        if parent.flow_style or isinstance(item.value, str):
            self._change(begin, end, f" {flow(item.value)}")
            return
        indent = key.start_mark.column + INDENT
        lines = [line for part in item.value for line in block(part, indent)]
        end_of_line = self._line_end(end)
        behind = self._text[end:end_of_line].strip()
        head = f"  {behind}" if behind else f"  # {item.comment}" if item.comment else ""
        self._change(begin, end_of_line, self._newline.join([head, *lines]))

    def append(self, path: KeyPath, items: Sequence[Item]) -> None:
        """Write further keys at the end of the mapping at `path`.

        Raises KeyError where no mapping is written there.
        """
        node = self._mapping(path)
        if node is None:
            raise KeyError(path)
        if node.flow_style:
            self._append_flow(node, items)
            return
        indent = node.value[0][0].start_mark.column
        place = self._line_end(self._content_end(node))
        lines = [line for item in items for line in block(item, indent)]
        self._change(place, place, "".join(self._newline + line for line in lines), indent)

    def applied(self) -> str:
        """Return the text with all changes made."""
        text = self._text
        changes = sorted(self._with_comments_in_place())
        for change in reversed(changes):  # what is behind moves no place
            text = text[: change.begin] + change.text + text[change.end :]
        return text

    def _change(self, begin: int, end: int, text: str, indent: int = 0) -> None:
        self._changes.append(_Change(begin, end, -indent, len(self._changes), text))

    def _append_flow(self, node: yaml.MappingNode, items: Sequence[Item]) -> None:
        before = max(i for i, end in enumerate(self._ends) if end < node.end_mark.index)
        last = self._tokens[before]
        place = last.end_mark.index
        opening = isinstance(last, yaml.FlowMappingStartToken | yaml.FlowEntryToken)
        over_lines = node.start_mark.line != node.end_mark.line or any(
            item.comment or item.above for item in items
        )
        if not over_lines:
            text = ", ".join(f"{item.key}: {flow(item.value)}" for item in items)
            self._change(place, place, text if opening else f", {text}")
            return
        first = node.value[0][0].start_mark.column if node.value else node.start_mark.column + 1
        pad = " " * first
        lines = []
        for k, item in enumerate(items):
            lines += [f"{pad}# {words}" for words in item.above]
            comma = "," if k + 1 < len(items) else ""
            remark = f"  # {item.comment}" if item.comment else ""
            lines.append(f"{pad}{item.key}: {flow(item.value)}{comma}{remark}")
        text = "" if opening else ","
        text += "".join(self._newline + line for line in lines)
        if items[-1].comment:  # what follows on this line would be part of the comment
            text += self._newline + pad
        self._change(place, place, text)

    def _with_comments_in_place(self) -> Iterator[_Change]:
        """Take from the space before a comment what its line has grown."""
        growth: dict[int, int] = {}
        for change in self._changes:
            yield change
            line_end = self._line_end(change.end)
            old = self._text[change.begin : change.end]
            if "\n" not in change.text and "\n" not in old:
                growth[line_end] = growth.get(line_end, 0) + len(change.text) - len(old)
        for line_end, grown in growth.items():
            last = max((end for end in self._ends if end <= line_end), default=0)
            space = re.match(r" {3,}(?=#)", self._text[last:line_end])
            if space:
                width = max(COMMENT_GAP, len(space.group()) - grown)
                yield _Change(last, last + len(space.group()), 0, 0, " " * width)

    def _mapping(self, path: KeyPath) -> yaml.MappingNode | None:
        node: yaml.Node | None = self._root
        if path:
            entry = self._entry(path)
            if entry is None or id(entry[0]) in self._aliases:
                return None
            node = entry[1]
        return node if isinstance(node, yaml.MappingNode) else None

    def _entry(self, path: KeyPath) -> tuple[yaml.Node, yaml.Node] | None:
        parent = self._mapping(path[:-1]) if path else None
        for key, value in parent.value if parent is not None else ():
            if isinstance(key, yaml.ScalarNode) and key.value == path[-1]:
                return key, value
        return None

    def _after_colon(self, key: yaml.Node) -> int:
        for token in self._tokens:
            if token.start_mark.index >= key.end_mark.index:
                if isinstance(token, yaml.ValueToken):
                    return int(token.end_mark.index)
                break
        raise KeyError(key.value)

    def _content_end(self, node: yaml.Node, key: yaml.Node | None = None) -> int:
        """Return the place of a node's last character; a block's own mark lies beyond it."""
        if key is not None and id(key) in self._aliases:
            return self._aliases[id(key)][1]
        if isinstance(node, yaml.MappingNode) and _is_block(node) and node.value:
            last_key, last = node.value[-1]
            end = self._content_end(last, last_key)
            return max(end, self._after_colon(last_key))
        if isinstance(node, yaml.SequenceNode) and not node.flow_style and node.value:
            return self._content_end(node.value[-1])
        return int(node.end_mark.index)

    def _line_end(self, index: int) -> int:
        found = re.compile(r"\r?\n|\Z").search(self._text, index)
        assert found is not None
        return found.start()


def block(item: Item, indent: int) -> list[str]:
    """Write a key over as many lines as it needs."""
    pad = " " * indent
    lines = [f"{pad}# {words}" for words in item.above]
    remark = f"  # {item.comment}" if item.comment else ""
    if isinstance(item.value, str):
        return [*lines, f"{pad}{item.key}: {item.value}{remark}"]
    lines.append(f"{pad}{item.key}:{remark}")
    for part in item.value:
        lines += block(part, indent + INDENT)
    return lines


def flow(value: str | Sequence[Item]) -> str:
    """Write a value on one line."""
    if isinstance(value, str):
        return value
    return "{" + ", ".join(f"{item.key}: {flow(item.value)}" for item in value) + "}"


def _is_block(node: yaml.Node) -> bool:
    return isinstance(node, yaml.MappingNode) and not node.flow_style
