"""What of a machine may change while it runs: models, gains, adaptation and controller."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping

from motorctl.config.machine import Machine

MODEL_KEYS = ("controller", "model", "gains", "adaptation")
"""Keys of an axis that another model may bring with it."""


def axes_with_other_models(before: Machine, after: Machine) -> list[str]:
    """Return the axes that differ in one of MODEL_KEYS, by name, in the machine's order.

    Parameters
    ----------
    before, after
        Two checked machines with the same axes.
    """
    return [
        name for name in after.axes if any(_differ(before, after, name, key) for key in MODEL_KEYS)
    ]


def learns_the_same(before: Machine, after: Machine, axis: str) -> bool:
    """Return whether an axis' estimate means the same in both, and is bounded and learned alike."""
    return not any(_differ(before, after, axis, key) for key in MODEL_KEYS if key != "gains")


def other_keys_that_differ(
    machine: Machine, other: Mapping[str, object]
) -> list[tuple[str, object, object]]:
    """Return every difference of two machines that is none of their axes' MODEL_KEYS.

    Where a program's points stand is none either.

    Parameters
    ----------
    machine
        A checked machine.
    other
        The other's configuration, every default filled in.

    Returns
    -------
    list of tuple
        Key with dots, value of the machine, value of the other; None where it is not there.
    """
    return list(_differences("", machine.resolved, other))


def models_that_differ(
    machine: Machine, other: Machine, axis: str
) -> list[tuple[str, object, object]]:
    """Return every difference in MODEL_KEYS of an axis, with key and both values.

    Parameters
    ----------
    machine, other
        Two checked machines that have the axis.
    axis
        Its name.
    """
    return list(_differences("", model_of(machine, axis), model_of(other, axis)))


def with_models_of(machine: Machine, other: Mapping[str, object]) -> dict[str, object]:
    """Return a machine's configuration with the MODEL_KEYS of another one's axes, as plain data.

    Effects that both have keep the machine's order: the entries of theta follow it, and that of an
    axis whose model is the same stay in use.

    Parameters
    ----------
    machine
        Whose everything else it is.
    other
        The other's configuration, every default filled in.
    """
    merged = copy.deepcopy(dict(machine.resolved))
    axes, others = merged["axes"], other.get("axes")
    assert isinstance(axes, dict)
    for name, axis in axes.items():
        own = others.get(name) if isinstance(others, Mapping) else None
        if isinstance(own, Mapping):
            before = axis["model"]
            axis.update({key: own[key] for key in MODEL_KEYS if key in own})
            effects = axis["model"]
            if isinstance(effects, Mapping):
                both = {name: effects[name] for name in before if name in effects}
                axis["model"] = {**both, **effects}
    return merged


def model_of(machine: Machine, axis: str) -> dict[str, dict[str, object]]:
    """Return MODEL_KEYS of an axis with their values, every default filled in, as plain data."""
    own = _axis(machine, axis)
    return {key: own[key] for key in MODEL_KEYS}  # type: ignore[misc]


def _differ(before: Machine, after: Machine, axis: str, key: str) -> bool:
    """Return whether a key of an axis differs; of a model, its effects' order counts, too."""
    old, new = _axis(before, axis).get(key), _axis(after, axis).get(key)
    if key == "model" and isinstance(old, Mapping) and isinstance(new, Mapping):
        return list(old) != list(new) or old != new
    return old != new


def _axis(machine: Machine, name: str) -> Mapping[str, object]:
    axes = machine.resolved["axes"]
    assert isinstance(axes, Mapping)
    axis = axes[name]
    assert isinstance(axis, Mapping)
    return axis


def _differences(path: str, before: object, after: object) -> Iterator[tuple[str, object, object]]:
    _, _, key = path.rpartition(".")
    if path.count(".") == 2 and (
        (path.startswith("axes.") and key in MODEL_KEYS)
        or (path.startswith("programs.") and key == "file")
    ):
        return
    if isinstance(before, Mapping) and isinstance(after, Mapping):
        for key in dict.fromkeys((*before, *after)):
            below = f"{path}.{key}" if path else str(key)
            yield from _differences(below, before.get(key), after.get(key))
    elif before != after:
        yield path, before, after
