"""Find installed drivers; a driver that fails to load hides no other."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points

from motorctl.entry_points import registered
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
    """Load every registered driver.

    Returns
    -------
    list
        An entry for each, in order of their names; of one that fails to load the reason.
    """
    return [_load(point) for point in sorted(entry_points(group=GROUP), key=lambda p: p.name)]


def driver_class(type_name: str) -> type[Driver]:
    """Return the class that a configuration's ``type`` names.

    Parameters
    ----------
    type_name
        A name of the entry-point group ``motorctl.drivers``, or ``package.module:Class``.

    Returns
    -------
    type
        A subclass of `Driver`.

    Raises
    ------
    UsageError
        Where there is no such driver or it fails to load; it names what is installed.
    """
    if ":" in type_name:
        return _import(type_name, type_name, "")
    points = registered(GROUP)
    if type_name not in points:
        known = ", ".join(sorted(points)) or "none"
        raise UsageError(f"unknown driver '{type_name}'; installed: {known}")
    point = points[type_name]
    return _import(point.value, point.name, _remedy(point))


def _load(point: EntryPoint) -> DriverEntry:
    name, version = (point.dist.name, point.dist.version) if point.dist else ("?", "?")
    try:
        driver = _import(point.value, point.name, _remedy(point))
    except UsageError as error:
        return DriverEntry(point.name, point.value, name, version, None, str(error))
    return DriverEntry(point.name, point.value, name, version, driver, None)


def _remedy(point: EntryPoint) -> str:
    """Return how to install what a driver needs, where its package has an extra of its name."""
    extras = point.dist.metadata.get_all("Provides-Extra", []) if point.dist else []
    if point.dist is None or point.name not in extras:
        return ""
    return f"pip install '{point.dist.name}[{point.name}]'"


def _import(target: str, name: str, remedy: str) -> type[Driver]:
    """Import a driver; `remedy` is told where a library is missing. Raises UsageError."""
    module_name, _, attribute = target.partition(":")
    who = f"driver '{name}'" + (f" ({target})" if name != target else "")
    try:
        driver = getattr(importlib.import_module(module_name), attribute)
    except Exception as error:  # a third party's module may fail in any way
        cause = f"{type(error).__name__}: {error}"
        if isinstance(error, ModuleNotFoundError) and error.name:
            own = f"{module_name}.".startswith(f"{error.name}.")
            hint = "is its folder on PYTHONPATH?" if own else remedy
            cause = f"module '{error.name}' is missing" + (f"; {hint}" if hint else "")
        raise UsageError(f"{who} failed to import: {cause}") from error
    if not (isinstance(driver, type) and issubclass(driver, Driver)):
        raise UsageError(f"{who} is not a subclass of motorctl.hal.Driver")
    return driver
