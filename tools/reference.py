"""Write the reference pages of keys, log columns, commands and effects, in `docs/reference/`.

    python tools/reference.py           # writes all
    python tools/reference.py --check   # exits with 1 where one of them is behind

The keys come from the schema that configurations are checked by, the columns from the sample that
the loop records, the codes from the enumerations that it writes, the commands from their own help
and the effects from their files, their curves from their kernels, so that a page can only say
what the program does.
"""

from __future__ import annotations

import ast
import inspect
import json
import sys
import textwrap
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from functools import cache
from pathlib import Path
from typing import Any

from curve_picture import same_picture
from reference_commands import commands_page
from reference_effects import effect_pictures, effects_page

from motorctl.config import config_schema
from motorctl.hal import Status
from motorctl.log.sample import (
    AXIS_FIELDS,
    TICK_FIELDS,
    AxisState,
    FaultCause,
    SampleFlag,
    Signal,
)

ROOT = Path(__file__).parents[1]
KEYS = Path("docs") / "reference" / "keys.md"
COLUMNS = Path("docs") / "reference" / "log_columns.md"
COMMANDS = Path("docs") / "reference" / "commands.md"
EFFECTS = Path("docs") / "reference" / "effects.md"
MADE_BY = "<!-- made by tools/reference.py -->"

Schema = dict[str, Any]


@cache
def pages() -> dict[Path, str]:
    """Return each page's text by its place below the repository."""
    return {
        KEYS: keys_page(config_schema()),
        COLUMNS: columns_page(),
        COMMANDS: commands_page(MADE_BY),
        EFFECTS: effects_page(MADE_BY),
        **{EFFECTS.with_suffix("") / name: text for name, text in effect_pictures().items()},
    }


# The keys.


@dataclass(frozen=True)
class Part:
    """A part of the file that is told in a table of its own."""

    path: str
    title: str
    properties: Schema
    required: Sequence[str]


def keys_page(schema: Schema) -> str:
    """Return every key of a configuration, a table for each part of the file."""
    book = Book(schema["$defs"], {})
    parts = list(_parts(schema, book))
    count = sum(len(part.properties) for part in parts)
    lines = [
        "# Every key of a configuration",
        "",
        MADE_BY,
        "",
        f"{count} keys, from the schema that `motorctl check` checks by. Units are in the names of "
        "the keys: `_m` metres, `_v` volts of command, `_1_s` 1/s. NAME is a name of your own. "
        "What the columns of a log mean: [log_columns.md](log_columns.md). A file to begin with: "
        "[`motorctl init`](../init.md).",
        "",
        *(f"- [`{part.path}`](#{_anchor(part.path)})" for part in parts),
    ]
    for part in parts:
        lines += ["", f"## {part.path}", "", part.title, ""]
        lines += ["| key | meaning | may be | default |", "|---|---|---|---|"]
        for key, value in part.properties.items():
            default = "required" if key in part.required else _default(value)
            meaning = _cell(_sentence(value["description"]))
            words = _cell(_values(value, book))
            lines.append(f"| `{key}` | {meaning} | {words} | {_cell(default)} |")
    return "\n".join(lines) + "\n"


TOP = "the file"


@dataclass(frozen=True)
class Book:
    """What the schema defines, and where on the page it is told."""

    definitions: Schema
    places: dict[str, str]
    """The path of each part that has keys, by the name of its definition."""


def _parts(schema: Schema, book: Book) -> Iterator[Part]:
    """Yield every part of the file once, outer ones first; note in the book where it is told."""
    definitions, met = book.definitions, set[str]()

    def walk(path: str, part: Schema, besides: Collection[str] = ()) -> Iterator[Part]:
        properties = part.get("properties", {})
        own = {key: value for key, value in properties.items() if key not in besides}
        if own:
            title = _cell(_sentence(part.get("description", "").partition("\n\n")[0]))
            if besides:
                title = f"{title.rstrip('.')}. Besides what stands above."
            yield Part(path, title, own, part.get("required", ()))
        for key, value in own.items():
            below = key if path == TOP else f"{path}.{key}"
            for suffix, name in _inner(value):
                if name in met:
                    continue
                met.add(name)
                inner = definitions[name]
                effect = name.startswith("effect_")
                common = definitions["EffectKeys"]["properties"] if effect else ()
                if set(inner.get("properties", ())) - set(common):
                    book.places[name] = below + suffix
                yield from walk(below + suffix, inner, common)
                for further, deeper in _inner(inner):  # a part that is a map of parts
                    if "properties" not in inner and deeper not in met:
                        met.add(deeper)
                        yield from walk(below + suffix + further, definitions[deeper])
        for condition in part.get("allOf", []):
            (kind,) = (told["const"] for told in condition["if"]["properties"].values())
            below = definitions[_name(condition["then"]["$ref"])]
            yield from walk(f"{path}, type {kind}", below, properties)

    yield from walk(TOP, {**schema, "description": "All of it."})


def _inner(part: Schema) -> Iterator[tuple[str, str]]:
    """Yield the parts that stand below a key: what is added to its path, and which it is."""
    if "$ref" in part:
        yield "", _name(part["$ref"])
    for union in ("anyOf", "oneOf"):
        branches = part.get(union, [])
        several = len([b for b in branches if "$ref" in b]) > 1
        for branch in branches:
            for suffix, name in _inner(branch):
                yield (f"{suffix} ({name})" if several else suffix), name
    for inside in (*part.get("patternProperties", {}).values(), part.get("additionalProperties")):
        if isinstance(inside, dict):
            for suffix, name in _inner(inside):
                yield f".NAME{suffix}", name
    for key, value in part.get("properties", {}).items():  # the effects, by their names
        for _, name in _inner(value):
            yield f".{key}", name
    if isinstance(part.get("items"), dict):
        for suffix, name in _inner(part["items"]):
            yield f"[]{suffix}", name


def _name(reference: str) -> str:
    return reference.rpartition("/")[2]


def _values(part: Schema, book: Book) -> str:
    """Return what a key may be, in words."""
    if "const" in part:
        return _shown(part["const"])
    if "enum" in part:
        return ", ".join(_shown(value) for value in part["enum"])
    if "$ref" in part:
        name = _name(part["$ref"])
        if name in book.places:
            return _link(book.places[name])
        return _values(book.definitions[name], book)
    for union in ("anyOf", "oneOf"):
        if union in part:
            told = [_values(branch, book) for branch in part[union]]
            return " or ".join(dict.fromkeys(told))
    if "prefixItems" in part:
        return "[" + ", ".join(_values(item, book) for item in part["prefixItems"]) + "]"
    kind = part.get("type")
    if kind == "array":
        return f"list of: {_values(part.get('items', {}), book)}"
    if kind == "object":
        if "properties" in part:
            return "keys of the names below"
        links = dict.fromkeys(
            _link(book.places[name]) for _, name in _inner(part) if name in book.places
        )
        return " or ".join(links) if links else "keys of your own"
    words = {"string": "text", "boolean": "true, false", "integer": "whole number", "null": "null"}
    word = words.get(str(kind), "number" if kind == "number" else "anything")
    return f"{word}{_range(part)}"


LARGEST = 1e9
"""Bounds from here on only keep numbers finite: they are not told."""


def _link(path: str) -> str:
    return f"[keys](#{_anchor(path)})"


def _range(part: Schema) -> str:
    told = []
    for key, sign in (
        ("minimum", "≥"),
        ("exclusiveMinimum", ">"),
        ("maximum", "≤"),
        ("exclusiveMaximum", "<"),
    ):
        if key in part and abs(part[key]) < LARGEST:
            limit = part[key]
            # What is written as positive is kept off zero by a number that means nothing.
            told.append("> 0" if key == "minimum" and 0 < limit <= 1e-9 else f"{sign} {limit:g}")
    return f" {', '.join(told)}" if told else ""


def _default(part: Schema) -> str:
    if "default" not in part:
        return "of its keys" if any(_inner(part)) else ""
    default = part["default"]
    return "of its keys" if isinstance(default, dict) and default else _shown(default)


def _shown(value: Any) -> str:
    return value if isinstance(value, str) and value else json.dumps(value, ensure_ascii=False)


# The columns.


def columns_page() -> str:
    """Return every column of a log, and what its codes mean."""
    lines = [
        "# Every column of a log",
        "",
        MADE_BY,
        "",
        "A log is one Parquet file: a row a tick, of the loop's rate. `motorctl log info` tells "
        "what is in one, `motorctl log export` writes CSV, Parquet, MAT or MCAP. The file's "
        "metadata hold the codes below, too, by the keys `states`, `faults`, `flags` and "
        "`device_statuses`; and `config`, whose keys are told in [keys.md](keys.md).",
        "",
        "## Once a tick",
        "",
        *_columns(TICK_FIELDS, ""),
        "",
        "## Of each axis",
        "",
        "`AXIS` is the axis' name. `theta_hat_…` is a column for each parameter of the axis' "
        "model, by the effect's name and, where it has several, the parameter's; its unit stands "
        "in the column's own metadata, and in [effects.md](effects.md).",
        "",
        *_columns([field for field in AXIS_FIELDS if not field.of_dual_drive], "AXIS."),
        "",
        "Axes with two motors have besides:",
        "",
        *_columns([field for field in AXIS_FIELDS if field.of_dual_drive], "AXIS."),
    ]
    for field, (title, codes) in CODES.items():
        lines += ["", f"## {title}: `AXIS.{field}`", ""]
        lines += [f"{_first_sentence(codes)}{_summed(codes)}", "", *_codes(codes)]
    lines += [
        "",
        "Bits 12 to 27 of `device_status` hold the error code of an amplifier that has one.",
    ]
    return "\n".join(lines) + "\n"


CODES: dict[str, tuple[str, type[IntEnum] | type[IntFlag]]] = {
    "state": ("What the axis does", AxisState),
    "fault": ("Why it is in fault", FaultCause),
    "flags": ("What happened in the tick", SampleFlag),
    "device_status": ("What the driver told", Status),
}
"""The columns that hold codes: what they tell, and the enumeration that they are of."""


def _columns(fields: Iterable[Signal], prefix: str) -> Iterator[str]:
    yield "| column | unit | type | meaning |"
    yield "|---|---|---|---|"
    for field in fields:
        name = prefix + field.name + ("_…" if field.per_parameter else "")
        meaning = _sentence(field.description)
        if field.name in CODES:
            title = CODES[field.name][0]
            meaning = f"[{title}](#{_anchor(f'{title}: {name}')})"
        yield f"| `{name}` | {field.unit or '-'} | {field.dtype} | {_cell(meaning)} |"


def _first_sentence(codes: type[IntEnum] | type[IntFlag]) -> str:
    return str(inspect.getdoc(codes)).partition("\n")[0]


def _summed(codes: type[IntEnum] | type[IntFlag]) -> str:
    return " Several may be set: their values are added." if issubclass(codes, IntFlag) else ""


def _codes(codes: type[IntEnum] | type[IntFlag]) -> Iterator[str]:
    told = described_members(codes)
    yield "| value | name | meaning |"
    yield "|---|---|---|"
    for member in codes:
        value = f"{member.value}"
        if isinstance(member, IntFlag):
            value += f" (bit {member.value.bit_length() - 1})"
        yield f"| {value} | `{member.name}` | {_cell(told[str(member.name)])} |"


def described_members(codes: type[IntEnum] | type[IntFlag]) -> dict[str, str]:
    """Return the string under each member of an enumeration, which its class does not keep.

    Raises SystemExit for a member without one: nobody could look its code up.
    """
    (body,) = (
        node.body
        for node in ast.parse(textwrap.dedent(inspect.getsource(codes))).body
        if isinstance(node, ast.ClassDef)
    )
    told = {}
    for statement, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
            name = statement.targets[0].id
            constant = after.value if isinstance(after, ast.Expr) else None
            if not isinstance(constant, ast.Constant) or not isinstance(constant.value, str):
                raise SystemExit(f"{codes.__name__}.{name} has no string under it that tells it")
            told[name] = " ".join(constant.value.split())
    return told


def _sentence(text: str) -> str:
    """Return a description as a sentence begins; symbols and names of modules stay as they are."""
    text = " ".join(text.split())
    first = text.partition(" ")[0].rstrip(",:;")
    begins = first == "a" or (len(first) > 1 and first.isalpha() and first.islower())
    return text[:1].upper() + text[1:] if begins else text


def _cell(text: str) -> str:
    """Return words as they may stand in a cell of a table."""
    return text.replace("|", "\\|").replace("<", "&lt;")


def _anchor(heading: str) -> str:
    """Return the anchor that Markdown gives a heading."""
    kept = "".join(c for c in heading.lower() if c.isalnum() or c in " -_")
    return kept.replace(" ", "-")


def _same(one: str, other: str) -> bool:
    return same_picture(one, other) if "<svg" in other else one == other


def main(arguments: list[str]) -> int:
    """Write the pages, or check them; return the exit status."""
    behind = []
    for place, text in pages().items():
        path = ROOT / place
        if "--check" not in arguments:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        elif not path.exists() or not _same(path.read_text(encoding="utf-8"), text):
            behind.append(place)
    if behind:
        print(f"{' and '.join(map(str, behind))}: behind: python tools/reference.py")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
