"""Which code a configuration would run, told without running any of it, and who allowed it.

A configuration names drivers and effects. By a plain name it gets what comes with motorctl or what
a package has registered: whoever installed that has allowed it. As ``package.module:Class`` it
gets any module that Python can import, and importing a module runs it. A service therefore takes
such names from a list only that an administrator keeps.
"""

from __future__ import annotations

import importlib.util
import os
import re
import stat
from dataclasses import dataclass
from functools import cache
from importlib.machinery import PathFinder
from importlib.metadata import PackageNotFoundError, packages_distributions
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Literal

from motorctl.config.shipped import locate
from motorctl.entry_points import registered
from motorctl.errors import Problem, UsageError
from motorctl.hal.registry import GROUP as DRIVERS
from motorctl.located_yaml import Document, KeyPath, dotted, read_document
from motorctl.model.catalog import GROUP as EFFECTS

ALLOWED_CODE = Path("/etc/motorctl/allowed_code")
"""Where the service looks for the list."""
OWN_PACKAGE = "motorctl"
_MODULE = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")
_MOST_BYTES = 100_000


@dataclass(frozen=True)
class NamedCode:
    """A class that a configuration would have imported."""

    key: KeyPath
    """Where it is named."""
    kind: Literal["driver", "effect"]
    target: str
    """``package.module:Class``."""
    origin: Literal["motorctl", "installed", "named"]
    """Comes with motorctl, is registered by an installed package, or only named here."""
    package: str | None
    """The installed package that it belongs to, and its version; None: of none."""
    version: str | None
    file: str | None
    """The module's file; None where Python would find none."""

    @property
    def module(self) -> str:
        """The module's name."""
        return self.target.partition(":")[0]

    def plain(self, allowed: bool) -> dict[str, object]:
        """Return what is told of it, as plain data, with whether it is allowed."""
        told = {key: value for key, value in vars(self).items() if key != "key"}
        return {"key": dotted(self.key), **told, "allowed": allowed}


class AllowedCode:
    """The modules that an administrator allowed.

    Parameters
    ----------
    source
        The file that says so, for messages.
    modules
        Their names; one of a package allows all that is in it.
    """

    def __init__(self, source: Path, modules: frozenset[str]) -> None:
        self.source = source
        self.modules = modules

    @classmethod
    def read(cls, path: Path) -> AllowedCode:
        """Read a list: a module a line, and what follows a # is a comment.

        Parameters
        ----------
        path
            The file; where it is not there, nothing is allowed.

        Returns
        -------
        AllowedCode
            What it says.

        Raises
        ------
        UsageError
            Where it cannot be read, where others than root and who asks might have written it, or
            where a line is no module's name.
        """
        try:
            with path.open("rb") as file:
                _insist_on_its_owner(path, os.fstat(file.fileno()))
                text = file.read(_MOST_BYTES + 1).decode()
        except FileNotFoundError:
            return cls(path, frozenset())
        except (OSError, UnicodeDecodeError) as error:
            why = error.strerror if isinstance(error, OSError) else "it is no text"
            raise UsageError(f"{path}: the list of allowed code cannot be read: {why}") from error
        if len(text) > _MOST_BYTES:
            raise UsageError(f"{path}: more than {_MOST_BYTES} bytes; is it a list of modules?")
        modules = set()
        for number, line in enumerate(text.splitlines(), 1):
            name = line.partition("#")[0].strip()
            if name and not _MODULE.fullmatch(name):
                raise UsageError(
                    f"{path}:{number}: '{name}' should be the name of a module, such as my_driver"
                )
            modules |= {name} if name else set()
        return cls(path, frozenset(modules))

    def allows(self, code: NamedCode) -> bool:
        """Return whether this code may run."""
        if code.origin != "named":
            return True
        parts = code.module.split(".")
        return any(".".join(parts[:count]) in self.modules for count in range(1, len(parts) + 1))


def named_code(document: Document) -> list[NamedCode]:
    """Return the code that a configuration would run, in the order in which it names it.

    Nothing is imported for it. Effects that come with motorctl are left out, as every
    configuration has them.
    """
    found = [_driver(document, name) for name in document.part(("drivers",))]
    for axis in document.part(("axes",)):
        for name in document.part(("axes", axis, "model")):
            found.append(_effect(document, ("axes", axis, "model", name), name))
    for name, target in document.part(("further_effects",)).items():
        if isinstance(target, str):
            found.append(_named(("further_effects", name), "effect", target))
    return [code for code in found if code is not None]


def code_of_file(path: str | Path) -> list[NamedCode]:
    """Return the code that a configuration would run; nothing is imported for it.

    Parameters
    ----------
    path
        The file, or the name of a shipped configuration.

    Returns
    -------
    list of NamedCode
        As `named_code`.

    Raises
    ------
    ConfigError
        Where the file is no YAML that can be read.
    """
    document = read_document(locate(path))
    document.refuse([])
    return named_code(document)


def refused_code(document: Document, allowed: AllowedCode) -> list[Problem]:
    """Return a problem for all code that a configuration names and nobody allowed."""
    return [
        document.problem(
            code.key,
            f"'{code.target}' is code that is not allowed here; whoever trusts it adds a line "
            f"'{code.module}' to {allowed.source}, or installs it as a package that registers it",
        )
        for code in named_code(document)
        if not allowed.allows(code)
    ]


def _driver(document: Document, name: str) -> NamedCode | None:
    key: KeyPath = ("drivers", name, "type")
    type_name = document.at(key)
    if not isinstance(type_name, str):
        return None
    if ":" in type_name:
        return _named(key, "driver", type_name)
    return _registered(key, "driver", DRIVERS, type_name)


def _effect(document: Document, key: KeyPath, name: str) -> NamedCode | None:
    type_name = document.at((*key, "type"))
    if isinstance(type_name, str):
        return _named((*key, "type"), "effect", type_name)
    return _registered(key, "effect", EFFECTS, name)


def _named(key: KeyPath, kind: Literal["driver", "effect"], target: str) -> NamedCode:
    module = target.partition(":")[0]
    package = next(iter(_packages().get(module.partition(".")[0], ())), None)
    try:
        version = version_of(package) if package else None
    except PackageNotFoundError:
        version = None
    return NamedCode(key, kind, target, "named", package, version, _file_of(module))


def _registered(
    key: KeyPath, kind: Literal["driver", "effect"], group: str, name: str
) -> NamedCode | None:
    point = registered(group).get(name)
    if point is None:  # an effect of motorctl, or a name that nobody knows: others tell
        return None
    package, version = (point.dist.name, point.dist.version) if point.dist else (None, None)
    origin: Literal["motorctl", "installed"] = "motorctl" if package == OWN_PACKAGE else "installed"
    file = _file_of(point.value.partition(":")[0])
    return NamedCode(key, kind, point.value, origin, package, version, file)


@cache
def _packages() -> dict[str, list[str]]:
    return dict(packages_distributions())


def _file_of(module: str) -> str | None:
    """Return the file of a module, without importing it or the packages that it is in."""
    first, *rest = module.split(".")
    try:
        spec = importlib.util.find_spec(first)
        name = first
        for part in rest:
            if spec is None or spec.submodule_search_locations is None:
                return None
            name = f"{name}.{part}"
            spec = PathFinder.find_spec(name, list(spec.submodule_search_locations))
    except (ImportError, ValueError, AttributeError):
        return None
    return spec.origin if spec else None


def _insist_on_its_owner(path: Path, found: os.stat_result) -> None:
    """Raise UsageError where somebody else might have written a file."""
    if found.st_uid not in (0, os.geteuid()):
        raise UsageError(
            f"{path}: belongs to user {found.st_uid}; only root may say what is allowed: chown root"
        )
    if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise UsageError(f"{path}: others than its owner may write it: chmod go-w {path}")
