"""Run an effect's kernels over an ordinary motion, before a loop relies on them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from motorctl.kernels import load_generated, source_digest
from motorctl.model.contract import Refusal, kernels_of
from motorctl.model.effect import Effect

Array = NDArray[np.float64]

TICKS = 24
"""Ticks of the stroke to and fro. More takes time whenever an effect is loaded, fewer passes by
speeds and places at which a kernel may fail. Chosen by hand."""
PERIOD_S = 1e-2
"""Time from tick to tick [s]. Together with the ticks it makes the stroke last 0.24 s: longer ones
are slow and gentle, shorter ones harder than machines are. Chosen by hand."""
STROKE_M = 0.1
"""Way of the stroke [m], whose top speed is 1.3 m/s. Larger is faster than most machines, smaller
tries few places. Chosen by hand."""
COMMAND_V = 5.0
"""Amplitude of the command [V]. Larger asks for more than amplifiers take, smaller leaves the ends
of an input map untried. Chosen by hand: within the usual 10 V."""


def run_kernels(effect: Effect, who: str) -> None:
    """Compile an effect's kernels, and run them over a stroke to and fro that begins at rest.

    Parameters
    ----------
    effect
        The form whose constants the kernels get.
    who
        How messages name it.

    Raises
    ------
    UsageError
        Where a kernel does not compile, raises, or gives something that is no finite number.
    """
    call = _Calls(effect, Refusal(who))
    {"state": _run_state, "input": _run_input, "measurement": _run_measurement}.get(
        effect.kind, _run_nothing
    )(effect, call)


class _Calls:
    """Calls kernels; raises UsageError where one fails."""

    def __init__(self, effect: Effect, refuse: Refusal) -> None:
        self.effect = effect
        self.refuse = refuse
        self.constants = np.array(effect.constants, np.float64)
        self.memory = np.zeros(effect.memory_size)

    def value(self, kernel: str, *arguments: object) -> None:
        """Call a kernel that gives a number."""
        found = self._call(kernel, *arguments)
        if not (isinstance(found, float | int) and math.isfinite(found)):
            shown = ", ".join(map(str, arguments))
            raise self.refuse(
                kernel, f"gives {found!r} at ({shown}); expected a finite number for any motion"
            )

    def advance(self, *arguments: object) -> None:
        """Call `advance` on the memory."""
        self._call("advance", self.memory, *arguments)
        if not np.isfinite(self.memory).all():
            raise self.refuse(
                "advance", f"leaves the memory {self.memory.tolist()}; expected finite numbers"
            )

    @property
    def held(self) -> tuple[Array, ...]:
        """The memory, as an argument, where the kernels take one."""
        return (self.memory,) if self.effect.remembers() else ()

    def _call(self, kernel: str, *arguments: object) -> object:
        try:
            return getattr(kernel_calls(type(self.effect)), kernel)(*arguments, self.constants)
        except ZeroDivisionError as error:
            raise self.refuse(
                kernel, 'divides by zero and raises; expected @njit(error_model="numpy") and a '
                "finite result"
            ) from error  # fmt: skip
        except Exception as error:  # numba's refusals, and whatever a kernel raises
            first = str(error).strip().splitlines()
            told = next((line for line in first[1:] if line.strip()), first[0] if first else "")
            raise self.refuse(
                kernel, f"cannot run in the compiled tick: {type(error).__name__}: {told.strip()}"
            ) from error


@cache
def kernel_calls(cls: type[Effect]) -> ModuleType:
    """Return functions that call an effect's kernels as the tick does, compiled once for good."""
    kernels = kernels_of(cls)
    source = f'"""Calls of the kernels of {cls.name}. Generated; do not edit."""\n\n'
    source += "from numba import njit\n"
    for kernel in kernels:
        source += f"from {cls.__module__} import {kernel} as effect_{kernel}\n"
    for kernel, arguments in kernels.items():
        source += f"\n\n@njit(cache=True)\ndef {kernel}({arguments}):\n"
        source += f"    return effect_{kernel}({arguments})\n"
    return load_generated(f"calls_{cls.name}_{source_digest(source)}", source)


def _run_state(effect: Effect, call: _Calls) -> None:
    others = np.zeros((len(effect.other_axes), 3))
    for t, x, v, a, _ in _motion():
        others[:] = x, v, a
        if effect.remembers():
            call.advance(x, v, a, PERIOD_S if t else 0.0, others)
        for j in range(len(effect.parameters)):
            call.value("column", j, x, v, a, v, t, *call.held)


def _run_input(effect: Effect, call: _Calls) -> None:
    for t, x, v, _, u in _motion():
        place = effect.place(x, v, t)
        for j in range(len(effect.parameters)):
            for kernel in ("column", "slope"):
                call.value(kernel, j, u, *place, *call.held)
        if effect.remembers():
            call.advance(u, PERIOD_S if t else 0.0)


def _run_measurement(effect: Effect, call: _Calls) -> None:
    for _, x, _, _, _ in _motion():
        call.value("correct", x)
        for j in range(len(effect.amplitudes)):
            call.value("column", j, x)


def _run_nothing(effect: Effect, call: _Calls) -> None:
    """Leave a command effect alone: it has no kernels."""


def _motion() -> Iterator[tuple[float, float, float, float, float]]:
    """Yield t [s], x [m], v [m/s], a [m/s^2] and u [V] of a stroke from rest to rest and back."""
    w = 2.0 * math.pi / (TICKS * PERIOD_S)
    for k in range(TICKS + 1):
        t = k * PERIOD_S
        x, v = 0.5 * STROKE_M * (1.0 - math.cos(w * t)), 0.5 * STROKE_M * w * math.sin(w * t)
        yield t, x, v, 0.5 * STROKE_M * w * w * math.cos(w * t), COMMAND_V * math.sin(2.0 * w * t)
