"""Slopes of the input map: of its parts that stand still, and the worst of those that vary."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import UsageError
from motorctl.model import Effect, EffectList

Array = NDArray[np.float64]

PLACES = 256
"""Places of the travel at which a map that varies is looked at, besides its ends."""
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
TIMES_S = (0.0, 1.0, 30.0, 1e3, 1e9)
"""Times at which a map that varies is looked at: the start, and what is reached in the end."""
SPEEDS_M_S = (0.0, 1e9, -1e9, 1.0, -1.0, 1e-2, -1e-2)
"""Velocities at which it is looked at: at rest, beyond any machine's, and what machines have. As
many as share no divisor with the times, so that every velocity meets every time."""


def input_indices(model: EffectList, *, varying: bool | None = None) -> list[int]:
    """Return the places in theta of the input map's parameters.

    Parameters
    ----------
    model
        The axis' effects, with n parameters.
    varying
        True: only those of effects that vary with place, time or the past; False: only those of
        effects that do not; None: all.

    Returns
    -------
    list
        Indices, rising, each from 0 to n - 1.
    """
    effects = [effect for effect in model.effects for _ in effect.parameters]
    return [
        i
        for i, effect in enumerate(effects)
        if effect.kind == "input" and varying in (None, not effect.stands_still)
    ]


def fixed_slopes(model: EffectList, u: Sequence[float]) -> Array:
    """Return h_i'(u): zero where an effect varies or is not of the input map.

    Parameters
    ----------
    model
        The axis' effects, with n parameters.
    u
        Commands [V].

    Returns
    -------
    ndarray
        Slopes, (len(u), n), in units of the virtual command per volt and parameter.
    """
    slopes = np.zeros((len(u), len(model)))
    indices = input_indices(model, varying=False)
    slopes[:, indices] = _slopes(model, indices, u, (0.0, 0.0, 0.0), np.zeros(model.context_size))
    return slopes


def worst_varying(
    model: EffectList, u: Sequence[float], lower: Array, upper: Array, travel_m: tuple[float, float]
) -> Array:
    """Return the lowest that the varying effects can add to dv/du.

    Over all of the travel, of time and of the memories that the effects name, for any theta between
    the bounds.

    Parameters
    ----------
    model
        The axis' effects, with n parameters.
    u
        Commands [V].
    lower, upper
        Bounds of theta, (n,), in units of the parameters.
    travel_m
        Both ends of the travel [m], over which a map that varies with place is looked at.

    Returns
    -------
    ndarray
        What they add [V/V], (len(u),); zeros where none varies.
    """
    indices = input_indices(model, varying=True)
    if not indices:
        return np.zeros(len(u))
    slopes = _varying_slopes(model, tuple(u), travel_m)
    lowest: Array = np.minimum(slopes * lower[indices], slopes * upper[indices]).sum(axis=2)
    worst: Array = lowest.min(axis=0)
    return worst


@lru_cache(maxsize=4)
def _varying_slopes(
    model: EffectList, u: tuple[float, ...], travel_m: tuple[float, float]
) -> Array:
    """Return h_i'(u; x, vs, t, w) of the varying effects, shape (places, len(u), their parameters).

    The places follow the golden ratio, so that no pitch falls in step with them; every time and
    velocity comes with places from all over the travel, and every memory with all of these.
    """
    indices = input_indices(model, varying=True)
    low, high = travel_m
    share = np.array([0.0])
    if any(effect.varies for effect in model.effects):
        share = np.concatenate([[0.0, 1.0], np.arange(1, PLACES + 1) * GOLDEN % 1.0])
    return np.array(
        [
            _slopes(
                model,
                indices,
                u,
                (
                    low + float(at) * (high - low),
                    SPEEDS_M_S[k % len(SPEEDS_M_S)],
                    TIMES_S[k % len(TIMES_S)],
                ),
                context,
            )
            for context in _contexts(model)
            for k, at in enumerate(share)
        ]
    )


def _contexts(model: EffectList) -> Iterator[Array]:
    """Yield contexts (context_size,): every combination of memories that the effects name."""
    remembering = [e for e in model.effects if e.kind == "input" and e.remembers()]
    for memories in itertools.product(*(_memories(effect) for effect in remembering)):
        yield np.concatenate([np.zeros(model.motion_memory), *memories])


def _memories(effect: Effect) -> list[Array]:
    named = [np.asarray(memory, np.float64) for memory in effect.memories()]
    if not named or any(memory.shape != (effect.memory_size,) for memory in named):
        raise UsageError(
            f"effect '{effect.name}': memories() should give at least one memory of "
            f"{effect.memory_size} numbers each, gave {list(effect.memories())}"
        )
    return named


def _slopes(
    model: EffectList,
    indices: list[int],
    u: Sequence[float],
    place: tuple[float, float, float],
    context: Array,
) -> Array:
    """Return h_i'(u; x, vs, t) from the memories in context, shape (len(u), len(indices)).

    place is x, vs and t.
    """
    commands, unit = np.asarray(u, np.float64), np.eye(len(model))
    found = np.zeros((len(u), len(indices)))
    for column, i in enumerate(indices):
        _, slope = model.input_over(commands, unit[i], context, place)
        found[:, column] = slope - 1.0
    return found
