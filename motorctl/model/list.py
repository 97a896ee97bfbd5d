"""The list of effects of one axis, and the compiled kernels that are composed from it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import UsageError
from motorctl.kernels import load_generated, source_digest
from motorctl.model.effect import Effect
from motorctl.model.knowledge import Signal
from motorctl.model.parameter import Parameter

Array = NDArray[np.float64]


class EffectList:
    """Effects in the order in which their parameters stand in theta.

    `kernels` is a generated module with compiled functions; n is the number of parameters:

    - ``state_columns(x, v, a, vs, t, context, out)``: fills out[:n] with the state columns, 0
      elsewhere
    - ``input_columns(u, x, vs, t, context, out)``: fills out[:n] with -h(u) of the input effects,
      0 elsewhere
    - ``feedforward(x, v, a, vs, t, context, theta)``: the sum of theta_i psi_i over the state
      columns
    - ``input_map(u, x, vs, t, context, theta)``: v(u); ``input_slope`` of the same: dv/du
    - ``advance_context(x, v, a, dt, others, context)``: brings the state effects' memories, in
      context of shape (context_size,), up to the motion that is reached dt [s] after the last;
      others of shape (axes, 3) is x, v, a of each of `other_axes`
    - ``advance_inputs(u, dt, context)``: commits the command u that acts, dt [s] after the last,
      to the input effects' memories
    - ``correct(y)``: the measured position without the declared errors of the measurement
    """

    def __init__(self, effects: Sequence[Effect]) -> None:
        self.effects = tuple(effects)
        names = [effect.name for effect in self.effects]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise UsageError(f"effect '{twice[0]}' stands in the list twice: remove one")

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

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Units of the parameters, of a linear axis, in the order of theta; empty: a number."""
        return tuple("" if p.unit == "1" else p.unit for p in self.parameters)

    def index_of(self, signal: Signal) -> int | None:
        """Return the place in theta of the basic effect whose column is this signal."""
        start = 0
        for effect in self.effects:
            if effect.proportional_to == signal:
                return start
            start += len(effect.parameters)
        return None

    def coefficient(self, theta: Array, signal: Signal) -> float:
        """Return what multiplies a signal; 0 where nothing does, or nothing was fitted."""
        place = self.index_of(signal)
        return 0.0 if place is None or place >= len(theta) else float(theta[place])

    def __len__(self) -> int:
        return len(self.parameters)

    def __reduce__(self) -> tuple[type[EffectList], tuple[tuple[Effect, ...]]]:
        """Pickle the effects alone: compiled kernels belong to a process."""
        return EffectList, (self.effects,)

    def without_electromagnetic(self) -> EffectList:
        """Return the list that C1 runs on: all but the electromagnetic effects."""
        return EffectList([e for e in self.effects if not e.electromagnetic])

    @property
    def context_size(self) -> int:
        """Numbers that the effects remember together."""
        return sum(effect.memory_size for effect in self.effects)

    @property
    def motion_memory(self) -> int:
        """How many of these belong to state effects; they stand first in the context."""
        return sum(effect.memory_size for effect in self.effects if effect.kind == "state")

    @property
    def other_axes(self) -> tuple[str, ...]:
        """Axes whose motion the effects depend on; an axis stands once for each that names it."""
        return tuple(axis for effect in self.effects for axis in effect.other_axes)

    @property
    def lag_s(self) -> float:
        """First-order lag between a command and what acts."""
        return sum(effect.lag_s for effect in self.effects)

    @property
    def delay_s(self) -> float:
        """Pure delay between a command and what acts."""
        return sum(effect.delay_s for effect in self.effects)

    @cached_property
    def module_name(self) -> str:
        """Name of the generated module: changes with any formula or constant in it."""
        return f"effects_{source_digest(self._source)}"

    @cached_property
    def kernels(self) -> ModuleType:
        """The generated module."""
        return load_generated(self.module_name, self._source)

    def regressor(
        self,
        x: Array,
        v: Array,
        a: Array,
        vs: Array,
        t: Array,
        u: Array,
        others: Array | None = None,
    ) -> Array:
        """Return psi over a recording: arrays of shape (N,) in, shape (N, n) out.

        others of shape (N, axes, 3) is x, v, a of each of `other_axes`. Raises ValueError where
        their shapes differ.
        """
        signals = [np.ascontiguousarray(signal, np.float64) for signal in (x, v, a, vs, t, u)]
        shapes = {signal.shape for signal in signals}
        if len(shapes) > 1 or signals[0].ndim != 1:
            raise ValueError(f"the signals of a recording differ in shape: {sorted(shapes)}")
        expected = (len(x), len(self.other_axes), 3)
        beside = np.zeros(expected) if others is None else np.ascontiguousarray(others, np.float64)
        if beside.shape != expected:
            raise ValueError(f"the other axes' motion has shape {beside.shape}, not {expected}")
        out = np.empty((len(x), len(self)))
        self.kernels.regressor_over(*signals, beside, np.zeros(self.context_size), out)
        return out

    def input_over(
        self,
        u: Array,
        theta: Array,
        context: Array | None = None,
        place: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> tuple[Array, Array]:
        """Return the input map and its slope over commands.

        Parameters
        ----------
        u
            Commands [V], (N,).
        theta
            Parameters, (n,).
        context
            What the effects remember, (context_size,); by default nothing.
        place
            Position [m], velocity [m/s] and time [s] at which it is looked at.

        Returns
        -------
        tuple of Array
            v(u) [V] and dv/du, (N,) each.
        """
        memory = np.zeros(self.context_size) if context is None else context
        v, slope = np.empty(len(u)), np.empty(len(u))
        self.kernels.input_over(np.asarray(u, np.float64), *place, memory, theta, v, slope)
        return v, slope

    @cached_property
    def _source(self) -> str:
        lines = [f'"""Model of an axis: {", ".join(self.names)}. Generated; do not edit."""', ""]
        lines += ["from numba import njit", "", "from motorctl.kernels import inner_kernel"]
        lines += map(_import, self.effects)
        lines += ["", "", "@inner_kernel", "def state_columns(x, v, a, vs, t, context, out):"]
        zeros = [f"    out[{i}] = 0.0" for i, e, _ in self._places() if e.kind != "state"]
        lines += [f"    out[{i}] = {call}" for i, call in self._state_calls("x, v, a, vs, t")]
        lines += zeros or ["    pass"]
        lines += ["", "", "@inner_kernel", "def input_columns(u, x, vs, t, context, out):"]
        zeros = [f"    out[{i}] = 0.0" for i, e, _ in self._places() if e.kind != "input"]
        lines += [f"    out[{i}] = -({call})" for i, call in self._input_calls("column")]
        lines += zeros or ["    pass"]
        lines += ["", "", "@inner_kernel", "def feedforward(x, v, a, vs, t, context, theta):"]
        lines += ["    total = 0.0"]
        state = self._state_calls("x, v, a, vs, t")
        lines += [f"    total += theta[{i}] * {call}" for i, call in state] + ["    return total"]
        for name, kernel, start in (("map", "column", "u"), ("slope", "slope", "1.0")):
            lines += ["", "", "@inner_kernel", f"def input_{name}(u, x, vs, t, context, theta):"]
            lines += [f"    total = {start}"]
            calls = self._input_calls(kernel)
            lines += [f"    total += theta[{i}] * {call}" for i, call in calls]
            lines += ["    return total"]
        lines += ["", "", "@inner_kernel", "def advance_context(x, v, a, dt, others, context):"]
        lines += self._motion_advances() or ["    pass"]
        lines += ["", "", "@inner_kernel", "def advance_inputs(u, dt, context):"]
        lines += self._input_advances() or ["    pass"]
        lines += ["", "", "@inner_kernel", "def correct(y):", "    corrected = y"]
        lines += [
            f"    corrected = {effect.name}_correct(corrected, {_tuple(effect.constants)})"
            for effect in self.effects
            if effect.kind == "measurement"
        ]
        lines += ["    return corrected"]
        lines += ["", "", "@njit(cache=True, error_model='numpy')"]
        lines += ["def regressor_over(x, v, a, vs, t, u, others, context, out):"]
        lines += ["    for k in range(x.size):", "        row = out[k]"]
        lines += ["        xk, vk, ak, vsk, tk, uk = x[k], v[k], a[k], vs[k], t[k], u[k]"]
        lines += ["        dt = tk - t[k - 1] if k else 0.0"]
        lines += ["        advance_context(xk, vk, ak, dt, others[k], context)"]
        lines += [f"        row[{i}] = {c}" for i, c in self._state_calls("xk, vk, ak, vsk, tk")]
        inputs = self._input_calls("column", "uk", ("xk", "vsk", "tk"))
        lines += [f"        row[{i}] = -({c})" for i, c in inputs]
        lines += ["        advance_inputs(uk, dt, context)"]
        lines += ["", "", "@njit(cache=True, error_model='numpy')"]
        lines += ["def input_over(u, x, vs, t, context, theta, v, slope):"]
        lines += ["    for k in range(u.size):"]
        lines += ["        v[k] = input_map(u[k], x, vs, t, context, theta)"]
        lines += ["        slope[k] = input_slope(u[k], x, vs, t, context, theta)"]
        return "\n".join(lines) + "\n"

    def _places(self) -> list[tuple[int, Effect, int]]:
        """Return index in theta, effect and index within the effect of every parameter."""
        pairs = [(e, j) for e in self.effects for j in range(len(e.parameters))]
        return [(i, effect, j) for i, (effect, j) in enumerate(pairs)]

    def _memories(self) -> dict[str, str]:
        """Return the argument that hands each effect its part of the context, by its name."""
        arguments, start = {}, 0
        # motion_memory: what state effects remember stands first
        for effect in sorted(self.effects, key=lambda effect: effect.kind != "state"):
            end = start + effect.memory_size
            arguments[effect.name] = f"context[{start}:{end}], " if effect.remembers() else ""
            start = end
        return arguments

    def _state_calls(self, arguments: str) -> list[tuple[int, str]]:
        memories = self._memories()
        return [
            (i, f"{e.name}_column({j}, {arguments}, {memories[e.name]}{_tuple(e.constants)})")
            for i, e, j in self._places()
            if e.kind == "state"
        ]

    def _input_calls(
        self, kernel: str, command: str = "u", place: tuple[str, str, str] = ("x", "vs", "t")
    ) -> list[tuple[int, str]]:
        memories, calls = self._memories(), []
        for i, e, j in self._places():
            if e.kind != "input":
                continue
            where = ", ".join((command, *e.place(*place)))
            constants = _tuple(e.constants)
            calls.append((i, f"{e.name}_{kernel}({j}, {where}, {memories[e.name]}{constants})"))
        return calls

    def _motion_advances(self) -> list[str]:
        memories, lines, other = self._memories(), [], 0
        for e in self.effects:
            others = f"others[{other}:{other + len(e.other_axes)}]"
            other += len(e.other_axes)
            if e.kind == "state" and e.remembers():
                arguments = f"{memories[e.name]}x, v, a, dt, {others}, {_tuple(e.constants)}"
                lines.append(f"    {e.name}_advance({arguments})")
        return lines

    def _input_advances(self) -> list[str]:
        memories = self._memories()
        return [
            f"    {e.name}_advance({memories[e.name]}u, dt, {_tuple(e.constants)})"
            for e in self.effects
            if e.kind == "input" and e.remembers()
        ]


def _import(effect: Effect) -> str:
    names = {"state": ["column"], "input": ["column", "slope"], "measurement": ["correct"]}
    kernels = list(names.get(effect.kind, []))
    if effect.remembers():
        kernels.append("advance")
    if not kernels:
        return ""
    parts = ", ".join(f"{kernel} as {effect.name}_{kernel}" for kernel in kernels)
    return f"from {type(effect).__module__} import {parts}"


def _tuple(constants: tuple[float, ...]) -> str:
    return f"({''.join(f'{_literal(c)}, ' for c in constants)})"


def _literal(value: float) -> str:
    if np.isinf(value):
        return "1e308 * 10.0" if value > 0 else "-1e308 * 10.0"
    return repr(float(value))
