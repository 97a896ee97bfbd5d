"""Find effects by name: built-in ones, installed ones, or ``package.module:Class``.

Built in is every module in `motorctl.model.effects`. A package installs further ones through the
entry-point group `motorctl.effects`. One that fails to load, built in or not, hurts no other.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from types import ModuleType

from pydantic import ValidationError

from motorctl.errors import UsageError
from motorctl.model import effects
from motorctl.model.contract import ORDINARY, check_class, check_effect
from motorctl.model.effect import Effect
from motorctl.model.first_run import run_kernels
from motorctl.model.knowledge import Signal

GROUP = "motorctl.effects"


@dataclass(frozen=True)
class EffectEntry:
    """An effect that is there: its name and version, and why it was refused if it was."""

    name: str
    """Its own; of a file that was refused, the file's."""
    target: str
    """``package.module:Class``, or the file of a built-in one."""
    package: str
    version: str | None
    effect: type[Effect] | None
    error: str | None


@cache
def known_effects() -> dict[str, type[Effect]]:
    """Return every effect that is built in or installed, by its name."""
    installed = {entry.name: entry.effect for entry in installed_effects() if entry.effect}
    return {**built_in_effects(), **installed}


@cache
def built_in_effects() -> dict[str, type[Effect]]:
    """Return every effect that stands in the effects folder, by its name."""
    return {entry.name: entry.effect for entry in built_in_entries() if entry.effect}


@cache
def built_in_entries() -> tuple[EffectEntry, ...]:
    """Return what stands in the effects folder, file by file; of what was refused, why."""
    entries: list[EffectEntry] = []
    for module in pkgutil.iter_modules(effects.__path__, effects.__name__ + "."):
        entries += _of_file(module.name, {entry.name: entry.target for entry in entries})
    return tuple(entries)


def _of_file(module: str, before: Mapping[str, str]) -> list[EffectEntry]:
    """Return the effects of a built-in module; before are those of others, with their files."""
    stem = module.rpartition(".")[2]
    spec = importlib.util.find_spec(module)
    file = (spec.origin if spec else None) or module

    def entry(name: str, cls: type[Effect] | None, error: str | None) -> EffectEntry:
        return EffectEntry(name, file, "motorctl", None, cls, error)

    try:
        found = vars(_imported(module, f"effect '{stem}' ({file})")).values()
    except UsageError as error:
        return [entry(stem, None, str(error))]
    classes = [item for item in found if _is_effect(item) and item.__module__ == module]
    if not classes:
        told = f"effect '{stem}' ({file}): no class derived from Effect has name = '{stem}'"
        return [entry(stem, None, told)]
    entries = []
    for cls in classes:
        who = f"effect '{cls.name}' ({file})"
        if cls.name in before:
            told = f"{who}: name is that of {before[cls.name]}; choose another"
            entries.append(entry(stem, None, told))
            continue
        try:
            check_class(cls, who)
            if (form := sample_form(cls)) is not None:
                check_effect(form, who)
        except UsageError as error:
            entries.append(entry(cls.name, None, str(error)))
        else:
            entries.append(entry(cls.name, cls, None))
    return entries


def _imported(module: str, who: str) -> ModuleType:
    """Return a module. Raises UsageError where it fails to import, in whatever way."""
    try:
        return importlib.import_module(module)
    except Exception as error:
        cause = f"{type(error).__name__}: {error}"
        raise UsageError(f"{who} failed to import: {cause}") from error


def failed_effects() -> dict[str, str]:
    """Return why effects that are there could not be loaded, by their names."""
    entries = (*built_in_entries(), *installed_effects())
    return {entry.name: entry.error for entry in entries if entry.error}


@cache
def basic_effects() -> dict[Signal, type[Effect]]:
    """Return the basic effects by the signal that each one's column is: those of every machine.

    Raises UsageError where the file of one was refused.
    """
    basic = {cls.proportional_to: cls for cls in built_in_effects().values()}
    order: tuple[Signal, ...] = ("acceleration", "velocity", "direction", "one")
    for signal in order:
        if signal not in basic:
            refused = "; ".join(entry.error for entry in built_in_entries() if entry.error)
            raise UsageError(
                f"no effect has proportional_to = '{signal}', which every machine needs: {refused}"
            )
    return {signal: basic[signal] for signal in order}


@cache
def installed_effects() -> tuple[EffectEntry, ...]:
    """Return what other packages install, in the order of the names."""
    entries = [_load(point) for point in sorted(entry_points(group=GROUP), key=_name_and_target)]
    names = [entry.name for entry in entries]
    twice = {name for name in names if names.count(name) > 1}
    return tuple(
        replace(entry, effect=None, error=f"two packages install an effect named '{entry.name}'")
        if entry.name in twice
        else entry
        for entry in entries
    )


def _name_and_target(point: EntryPoint) -> tuple[str, str]:
    return point.name, point.value


def _load(point: EntryPoint) -> EffectEntry:
    package, version = (point.dist.name, point.dist.version) if point.dist else ("?", "?")
    try:
        cls = effect_class(point.name, point.value)
    except UsageError as error:
        return EffectEntry(point.name, point.value, package, version, None, str(error))
    return EffectEntry(point.name, point.value, package, version, cls, None)


def effect_class(name: str, type_name: str | None = None) -> type[Effect]:
    """Return the class of an effect, known by its name or named as ``package.module:Class``.

    Parameters
    ----------
    name
        The effect's own name.
    type_name
        ``package.module:Class``; None: a built-in effect, or one of the entry-point group
        ``motorctl.effects``.

    Returns
    -------
    type
        A subclass of `Effect` that keeps the contract.

    Raises
    ------
    UsageError
        Where there is no such effect, or where it does not keep the contract of an effect: then the
        message names the member and what is expected of it.
    """
    if type_name is None:
        if name in known_effects():
            return known_effects()[name]
        if name in failed_effects():
            raise UsageError(f"installed, but refused: {failed_effects()[name]}")
        known = ", ".join(sorted(known_effects()))
        raise UsageError(f"unknown effect '{name}'; known: {known} (or give its type)")
    who = f"effect '{name}' ({type_name})"
    module_name, _, attribute = type_name.partition(":")
    module = _imported(module_name, who)
    try:
        found = getattr(module, attribute)
    except Exception as error:  # a user's module may fail in any way
        cause = f"{type(error).__name__}: {error}"
        raise UsageError(f"{who} failed to import: {cause}") from error
    if not (isinstance(found, type) and issubclass(found, Effect)):
        raise UsageError(f"{who} is not a motorctl.model.Effect; derive its class from that")
    if not isinstance(getattr(found, "name", None), str) or not found.name:
        raise UsageError(f"{who}: the class has no name; expected name = '{name}'")
    if found.name != name:
        raise UsageError(f"{who} calls itself '{found.name}'; use that name as its key")
    if built_in_effects().get(name) is not found:
        _insist_on_the_contract(found, who)
    return found


@cache
def _insist_on_the_contract(found: type[Effect], who: str) -> None:
    if found.name in built_in_effects():
        raise UsageError(f"{who}: name '{found.name}' is that of a built-in effect; choose another")
    check_class(found, who)
    if (signal := found.proportional_to) is not None:
        owner = basic_effects()[signal].name
        raise UsageError(f"{who}: proportional_to is '{signal}', which is that of '{owner}' alone")
    if (form := sample_form(found)) is not None:
        check_effect(form, who)
        run_kernels(form, who)


def sample_form(cls: type[Effect]) -> Effect | None:
    """Return a form of an effect as an ordinary recording suggests; None where options decide."""
    with contextlib.suppress(ValidationError):
        return cls.typical(ORDINARY) or cls()
    return None


def check_form(effect: Effect) -> None:
    """Check an effect with the options that it was given; of one from outside the kernels, too.

    Raises UsageError where with these it does not keep the contract of an effect.
    """
    check_effect(effect, f"effect '{effect.name}'")
    if built_in_effects().get(effect.name) is not type(effect):
        run_kernels(effect, f"effect '{effect.name}'")


def _is_effect(item: object) -> bool:
    return isinstance(item, type) and issubclass(item, Effect) and hasattr(item, "name")
