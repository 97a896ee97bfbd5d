"""Find installed drivers; a driver that fails to load hides no other."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points

from motorctl.errors import UsageError
from motorctl.hal.contract import Driver

GROUP = "motorctl.drivers"


@dataclass(frozen=True)
class DriverEntry:
    """An installed driver: its name and version, and why it failed to load if it did."""

    name: str
    target: str
    distribution: str
    version: str
    driver: type[Driver] | None
    error: str | None


def installed_drivers() -> list[DriverEntry]:
    """Load every registered driver, in order of their names."""
    return [_load(point) for point in sorted(entry_points(group=GROUP), key=lambda p: p.name)]


def driver_class(type_name: str) -> type[Driver]:
    """Give the class that a configuration's ``type`` names.

    Raises UsageError, naming what is installed, where there is no such driver or it fails to load.
    """
    if ":" in type_name:
        return _import(type_name, type_name)
    points = {point.name: point for point in entry_points(group=GROUP)}
    if type_name not in points:
        known = ", ".join(sorted(points)) or "none"
        raise UsageError(f"unknown driver '{type_name}'; installed: {known}")
    return _import(points[type_name].value, type_name)


def _load(point: EntryPoint) -> DriverEntry:
    name, version = (point.dist.name, point.dist.version) if point.dist else ("?", "?")
    try:
        driver = _import(point.value, point.name)
    except UsageError as error:
        return DriverEntry(point.name, point.value, name, version, None, str(error))
    return DriverEntry(point.name, point.value, name, version, driver, None)


def _import(target: str, name: str) -> type[Driver]:
    module_name, _, attribute = target.partition(":")
    try:
        driver = getattr(importlib.import_module(module_name), attribute)
    except Exception as error:  # a third party's module may fail in any way
        cause = f"{type(error).__name__}: {error}"
        raise UsageError(f"driver '{name}' ({target}) failed to import: {cause}") from error
    if not (isinstance(driver, type) and issubclass(driver, Driver)):
        raise UsageError(f"driver '{name}' ({target}) is not a subclass of motorctl.hal.Driver")
    return driver
