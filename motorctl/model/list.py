"""The list of effects of one axis, and the compiled kernels that are composed from it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import UsageError
from motorctl.kernels import load_generated, source_digest
from motorctl.model.effect import Effect, Parameter

Array = NDArray[np.float64]


class EffectList:
    """Effects in the order in which their parameters stand in theta.

    `kernels` is a generated module with compiled functions; n is the number of parameters:

    - ``state_columns(x, v, a, vs, t, out)``: fills out[:n] with the state columns, 0 elsewhere
    - ``input_columns(u, out)``: fills out[:n] with -h(u) of the input effects, 0 elsewhere
    - ``feedforward(x, v, a, vs, t, theta)``: the sum of theta_i psi_i over the state columns
    - ``input_map(u, theta)``: v(u); ``input_slope(u, theta)``: dv/du
    """

    def __init__(self, effects: Sequence[Effect]) -> None:
        self.effects = tuple(effects)
        names = [effect.name for effect in self.effects]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise UsageError(f"effect '{twice[0]}' stands in the list twice")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(effect.name for effect in self.effects)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All linear parameters, in the order of theta."""
        return tuple(p for effect in self.effects for p in effect.parameters)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Full names of the parameters, in the order of theta."""
        return tuple(e.full_name(p) for e in self.effects for p in e.parameters)

    def __len__(self) -> int:
        return len(self.parameters)

    def __reduce__(self) -> tuple[type[EffectList], tuple[tuple[Effect, ...]]]:
        """Pickle the effects alone: compiled kernels belong to a process."""
        return EffectList, (self.effects,)

    def without_electromagnetic(self) -> EffectList:
        """Give the list that C1 runs on: all but the electromagnetic effects."""
        return EffectList([e for e in self.effects if not e.electromagnetic])

    @cached_property
    def module_name(self) -> str:
        """Name of the generated module: changes with any formula or constant in it."""
        return f"effects_{source_digest(self._source)}"

    @cached_property
    def kernels(self) -> ModuleType:
        """The generated module."""
        return load_generated(self.module_name, self._source)

    def regressor(self, x: Array, v: Array, a: Array, vs: Array, t: Array, u: Array) -> Array:
        """Give psi over a recording: arrays of shape (N,) in, shape (N, n) out.

        Raises ValueError where their shapes differ.
        """
        signals = [np.ascontiguousarray(signal, np.float64) for signal in (x, v, a, vs, t, u)]
        shapes = {signal.shape for signal in signals}
        if len(shapes) > 1 or signals[0].ndim != 1:
            raise ValueError(f"the signals of a recording differ in shape: {sorted(shapes)}")
        out = np.empty((len(x), len(self)))
        self.kernels.regressor_over(*signals, out)
        return out

    @cached_property
    def _source(self) -> str:
        lines = [
            f'"""Model of an axis: {", ".join(self.names)}. Generated; do not edit."""',
            "",
            "from numba import njit",
            "",
        ]
        lines += [
            f"from {type(effect).__module__} import column as {effect.name}_column"
            + (f", slope as {effect.name}_slope" if effect.kind == "input" else "")
            for effect in self.effects
        ]
        state = [*self._calls("state", "column", "x, v, a, vs, t")]
        inputs = [*self._calls("input", "column", "u")]
        slopes = [*self._calls("input", "slope", "u")]
        lines += ["", "", "@njit", "def state_columns(x, v, a, vs, t, out):"]
        lines += [f"    out[{i}] = {call}" for i, call in state]
        lines += [f"    out[{i}] = 0.0" for i, _ in inputs] or ["    pass"]
        lines += ["", "", "@njit", "def input_columns(u, out):"]
        lines += [f"    out[{i}] = -({call})" for i, call in inputs]
        lines += [f"    out[{i}] = 0.0" for i, _ in state] or ["    pass"]
        lines += ["", "", "@njit", "def feedforward(x, v, a, vs, t, theta):", "    total = 0.0"]
        lines += [f"    total += theta[{i}] * {call}" for i, call in state] + ["    return total"]
        lines += ["", "", "@njit", "def input_map(u, theta):", "    total = u"]
        lines += [f"    total += theta[{i}] * {call}" for i, call in inputs] + ["    return total"]
        lines += ["", "", "@njit", "def input_slope(u, theta):", "    total = 1.0"]
        lines += [f"    total += theta[{i}] * {call}" for i, call in slopes] + ["    return total"]
        lines += ["", "", "@njit(cache=True)", "def regressor_over(x, v, a, vs, t, u, out):"]
        lines += ["    for k in range(x.size):", "        row = out[k]"]
        lines += ["        xk, vk, ak, vsk, tk, uk = x[k], v[k], a[k], vs[k], t[k], u[k]"]
        over_state = self._calls("state", "column", "xk, vk, ak, vsk, tk")
        over_input = self._calls("input", "column", "uk")
        lines += [f"        row[{i}] = {call}" for i, call in over_state]
        lines += [f"        row[{i}] = -({call})" for i, call in over_input]
        return "\n".join(lines) + "\n"

    def _calls(self, kind: str, kernel: str, arguments: str) -> list[tuple[int, str]]:
        calls = []
        index = 0
        for effect in self.effects:
            for j in range(len(effect.parameters)):
                if effect.kind == kind:
                    constants = "".join(f"{_literal(c)}, " for c in effect.constants)
                    call = f"{effect.name}_{kernel}({j}, {arguments}, ({constants}))"
                    calls.append((index, call))
                index += 1
        return calls


def _literal(value: float) -> str:
    if np.isinf(value):
        return "1e308 * 10.0" if value > 0 else "-1e308 * 10.0"
    return repr(float(value))
