"""Which model is identified: the recording's own, C1, C2, or that of a configuration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeGuard

from motorctl.config import Machine, load, load_resolved
from motorctl.config.chosen_code import MayRun, allowed_by
from motorctl.errors import ConfigError, DataError, UsageError
from motorctl.log import Recording
from motorctl.model import EffectList, basic_effects
from motorctl.model.catalog import built_in_effects


def declared_models(
    recording: Recording,
    model: str | None = None,
    axis: str | None = None,
    may_run: MayRun | None = None,
    machine: Machine | None = None,
) -> dict[str, EffectList]:
    """Return the list of effects of every axis of `recording`, or of `axis` alone.

    Parameters
    ----------
    recording
        Its own configuration is looked at, where its log has one.
    model
        None for what that configuration declares, or C1 where there is none; C1 or C2 for the
        declared list without or with the electromagnetic effects; else the path or name of a
        configuration, whose axis is that of the same name, or its only one.
    axis
        The one axis that is wanted; None for all.
    may_run
        Asked of the code that the recording's own configuration names; None: what was installed,
        or chosen by this user before.
    machine
        What `machine_of` returns of the same three, where that is known already.

    Returns
    -------
    dict
        The list of effects by the axis' name.

    Raises
    ------
    UsageError
        The recording or the configuration has no such axis.
    DataError
        The configuration in the log cannot be read.
    ConfigError
        The configuration `model` is not valid.
    """
    if axis is not None and axis not in recording.axes:
        known = ", ".join(recording.axes)
        raise UsageError(f"{recording.source}: no axis '{axis}'; it has: {known}")
    names = list(recording.axes) if axis is None else [axis]
    if machine is None:
        machine = machine_of(recording, model, may_run)
    if machine is not None and is_file(model):
        return {name: _of_axis(machine, name) for name in names}
    own = {} if machine is None else machine.axes
    return {
        name: controller_list(own[name].declared if name in own else None, model) for name in names
    }


def machine_of(
    recording: Recording, model: str | None = None, may_run: MayRun | None = None
) -> Machine | None:
    """Return the machine that the recording should be of: that of `model`, else of its own log.

    None where nothing is known of it; `may_run` is that of `declared_models`. Raises DataError and
    ConfigError.
    """
    return load(model) if is_file(model) else _own(recording, may_run)


def is_file(model: str | None) -> TypeGuard[str]:
    """Return whether a model is named by its configuration, and not by its controller or at all."""
    return model not in (None, "C1", "C2")


def untried_effects(recording: Recording, machine: Machine | None) -> list[str]:
    """Return the effects that a recording's own configuration wants tried, and that are not.

    Their code is none that was allowed, or is not on this computer.
    """
    config = recording.metadata.get("config")
    named = config.get("further_effects") if isinstance(config, Mapping) else None
    tried = {} if machine is None else machine.further_effects
    return [f"{name} ({where})" for name, where in (named or {}).items() if name not in tried]


def controller_list(declared: EffectList | None, controller: str | None) -> EffectList:
    """Return C1's or C2's list, made from what an axis declares where that is known."""
    if declared is None:
        declared = EffectList([cls() for cls in basic_effects().values()])
        if controller is None:
            return declared
    if controller == "C1":
        return declared.without_electromagnetic()
    if controller == "C2":
        missing = [
            cls()
            for name, cls in built_in_effects().items()
            if cls.electromagnetic and name not in declared.names
        ]
        return EffectList([*declared.effects, *missing])
    return declared


def _own(recording: Recording, may_run: MayRun | None) -> Machine | None:
    config: Mapping[str, Any] | None = recording.metadata.get("config")
    if not config:
        return None
    try:
        return load_resolved(config, recording.source, may_run=may_run or allowed_by())
    except ConfigError as error:
        raise DataError(
            f"{recording.source}: its configuration cannot be read:\n{error}"
        ) from error


def _of_axis(machine: Machine, name: str) -> EffectList:
    if name in machine.axes:
        return machine.axes[name].declared
    if len(machine.axes) == 1:
        return next(iter(machine.axes.values())).declared
    known = ", ".join(machine.axes)
    raise UsageError(f"{machine.source}: no axis '{name}' to take the model from; it has: {known}")
