"""Find effects by name: built-in ones, installed ones, or ``package.module:Class``.

Built in is every module in `motorctl.model.effects`. A package installs further ones through the
entry-point group `motorctl.effects`; one that fails to load hurts no other.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
from functools import cache
from importlib.metadata import entry_points
from typing import get_args

from numba.core.dispatcher import Dispatcher

from motorctl.errors import UsageError
from motorctl.model import effects
from motorctl.model.effect import Effect, Kind
from motorctl.model.knowledge import Signal

GROUP = "motorctl.effects"


@cache
def known_effects() -> dict[str, type[Effect]]:
    """Return every effect that is built in or installed, by its name."""
    return {**built_in_effects(), **_installed()[0]}


@cache
def built_in_effects() -> dict[str, type[Effect]]:
    """Return every effect that stands in the effects folder, by its name."""
    found: dict[str, type[Effect]] = {}
    for module in pkgutil.iter_modules(effects.__path__, effects.__name__ + "."):
        for item in vars(importlib.import_module(module.name)).values():
            if _is_effect(item) and item.__module__ == module.name:
                found[item.name] = item
    return found


def failed_effects() -> dict[str, str]:
    """Return why installed effects could not be loaded, by the name of their entry point."""
    return dict(_installed()[1])


@cache
def basic_effects() -> dict[Signal, type[Effect]]:
    """Return the basic effects by the signal that each one's column is: those of every machine."""
    basic = {cls.proportional_to: cls for cls in built_in_effects().values()}
    order: tuple[Signal, ...] = ("acceleration", "velocity", "direction", "one")
    return {signal: basic[signal] for signal in order}


@cache
def _installed() -> tuple[dict[str, type[Effect]], dict[str, str]]:
    found: dict[str, type[Effect]] = {}
    failed: dict[str, str] = {}
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        try:
            if entry.name in built_in_effects():
                raise UsageError(f"an effect named '{entry.name}' is built in")  # noqa: TRY301
            found[entry.name] = effect_class(entry.name, entry.value)
        except UsageError as error:
            failed[entry.name] = str(error)
    return found, failed


def effect_class(name: str, type_name: str | None = None) -> type[Effect]:
    """Give the class of an effect, known by its name or named as ``package.module:Class``.

    Raises UsageError where there is no such effect.
    """
    if type_name is None:
        if name not in known_effects():
            known = ", ".join(sorted(known_effects()))
            raise UsageError(f"unknown effect '{name}'; known: {known} (or give its type)")
        return known_effects()[name]
    module_name, _, attribute = type_name.partition(":")
    try:
        found = getattr(importlib.import_module(module_name), attribute)
    except Exception as error:  # a user's module may fail in any way
        cause = f"{type(error).__name__}: {error}"
        raise UsageError(f"effect '{name}' ({type_name}) failed to import: {cause}") from error
    if not _is_effect(found):
        raise UsageError(f"effect '{name}' ({type_name}) is not a motorctl.model.Effect")
    if found.name != name:
        raise UsageError(f"effect '{name}' ({type_name}) calls itself '{found.name}'")
    _insist_on_its_parts(found, f"effect '{name}' ({type_name})")
    return found  # type: ignore[no-any-return]


def _insist_on_its_parts(found: type[Effect], who: str) -> None:
    if not found.name.isidentifier():
        raise UsageError(f"{who}: the name needs letters, digits and _")
    for part in ("kind", "title", "formula", "compensated", "identified", "visible_in"):
        if not isinstance(getattr(found, part, None), str):
            raise UsageError(f"{who}: the class has no text '{part}'")
    if found.kind not in get_args(Kind):
        raise UsageError(f"{who}: its kind is '{found.kind}'; must be one of {get_args(Kind)}")
    module = sys.modules[found.__module__]
    kernels = {"state": ["column"], "input": ["column", "slope"], "measurement": ["correct"]}
    # An effect may remember in some of its forms only: then it says so by `memory_size`.
    remembers = found.memory > 0 or found.memory_size is not Effect.memory_size
    for kernel in [*kernels.get(found.kind, []), *(["advance"] if remembers else [])]:
        # Only compiled functions can be called from the compiled tick.
        if not isinstance(getattr(module, kernel, None), Dispatcher):
            raise UsageError(
                f"{who}: its module {found.__module__} has no function '{kernel}' decorated with "
                f"numba's njit"
            )


def _is_effect(item: object) -> bool:
    return isinstance(item, type) and issubclass(item, Effect) and hasattr(item, "name")
