"""What a module's source says for its digest: parsed once, and kept beside the compiled kernels.

A start reads the sources of a hundred modules, and parsing them would be a tenth of it. What one
says follows from its bytes alone, so it is kept under their digest, with a checksum.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import platform
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import astuple, dataclass
from functools import cache
from pathlib import Path
from typing import Any

from motorctl.cache_folder import cache_root

FORM = Path(__file__).read_bytes() + platform.python_version().encode()
"""What is kept depends on this file, and on the Python that spells the syntax tree."""


@dataclass(frozen=True)
class Import:
    """One imported name: of a module, or of something in it."""

    bound: str
    module: str
    name: str = ""
    """What of the module; "" for the module itself, "*" for all that is in it."""


@dataclass(frozen=True)
class Said:
    """What a module's source says."""

    digest: bytes
    imports: tuple[Import, ...]
    used: frozenset[str]
    """Names that stand in the code, annotations of functions aside."""
    hands_on: bool
    """Whether it does nothing but import names for others."""


def parsed_folder() -> Path:
    """Return the folder of what sources say; it may not exist yet."""
    return cache_root() / "parsed"


@cache
def said_by_source(content: bytes, package: str) -> Said:
    """Return what a source says.

    Parameters
    ----------
    content
        The source.
    package
        The package that its relative imports start from.

    Returns
    -------
    Said
        What was kept of it, or is parsed and kept now; a disk that refuses costs the time.
    """
    key = hashlib.sha256(b"\0".join((FORM, package.encode(), content))).hexdigest()[:32]
    file = parsed_folder() / key
    said = _kept(file)
    if said is None:
        said = _parsed(content, package)
        with suppress(OSError):
            _keep(said, file)
    return said


def _kept(file: Path) -> Said | None:
    """Return what a file keeps; None where it is not there, or not as it was written."""
    try:
        checksum, _, text = file.read_bytes().partition(b"\n")
    except OSError:
        return None
    if checksum != _checksum(text):
        return None
    with suppress(OSError):  # another user's folder may be read only
        os.utime(file)  # in use: not to be removed as old
    digest, imports, used, hands_on = json.loads(text)
    entries = tuple(Import(*entry) for entry in imports)
    return Said(bytes.fromhex(digest), entries, frozenset(used), hands_on)


def _keep(said: Said, file: Path) -> None:
    kept = (said.digest.hex(), [astuple(entry) for entry in said.imports], sorted(said.used))
    text = json.dumps((*kept, said.hands_on)).encode()
    file.parent.mkdir(parents=True, exist_ok=True)
    written = file.with_name(f"{file.name}.tmp.{os.getpid()}")
    try:
        written.write_bytes(_checksum(text) + b"\n" + text)
        written.replace(file)
    except OSError:
        written.unlink(missing_ok=True)
        raise


def _checksum(text: bytes) -> bytes:
    return hashlib.sha256(text).hexdigest().encode()


def _parsed(content: bytes, package: str) -> Said:
    tree = _Plain().visit(ast.parse(content))
    return Said(
        digest=hashlib.sha256(ast.dump(tree).encode()).digest(),
        imports=tuple(_imports(tree, package)),
        used=frozenset(node.id for node in ast.walk(tree) if isinstance(node, ast.Name)),
        hands_on=all(isinstance(node, ast.ImportFrom) or _names_all(node) for node in tree.body),
    )


class _Plain(ast.NodeTransformer):
    """Leaves out what does not change compiled code."""

    def visit(self, node: ast.AST) -> Any:
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            del node.body[: ast.get_docstring(node, clean=False) is not None]
        if isinstance(node, ast.FunctionDef):
            node.returns = None
        elif isinstance(node, ast.arg):
            node.annotation = None
        return self.generic_visit(node)


def _imports(tree: ast.AST, package: str) -> Iterator[Import]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield Import(alias.asname or alias.name.partition(".")[0], alias.name)
        elif isinstance(node, ast.ImportFrom):
            module = _absolute(node, package)
            for alias in node.names:
                yield Import(alias.asname or alias.name, module, alias.name)


def _absolute(node: ast.ImportFrom, package: str) -> str:
    if not node.level:
        return node.module or ""
    base = package.split(".")
    base = base[: len(base) - node.level + 1]
    return ".".join([*base, *([node.module] if node.module else [])])


def _names_all(node: ast.stmt) -> bool:
    return (
        isinstance(node, ast.Assign)
        and len(node.targets) == 1
        and isinstance(node.targets[0], ast.Name)
        and node.targets[0].id == "__all__"
    )
