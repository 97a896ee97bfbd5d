"""Columns of one effect over a recording, with its constants given at run time.

An axis' own list is compiled with its constants as literals, for the tick. Where many forms of an
effect are tried, as diagnosis does, that would compile anew for each; here one compiled function
serves every form. The kernels are the same.
"""

from __future__ import annotations

from functools import cache
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from motorctl.kernels import load_generated, source_digest
from motorctl.model.effect import Effect

Array = NDArray[np.float64]

STATE = """
@njit(cache=True)
def columns(x, v, a, vs, t, others, w, c, out):
    for k in range(x.size):
{advance}        for j in range(out.shape[0]):
            out[j, k] = column(j, x[k], v[k], a[k], vs[k], t[k], {memory}c)
"""
ADVANCE = "        advance(w, x[k], v[k], a[k], t[k] - t[k - 1] if k else 0.0, others[k], c)\n"
INPUT = """
@njit(cache=True)
def columns(u, x, vs, t, w, c, out):
    for k in range(u.size):
        for j in range(out.shape[0]):
            out[j, k] = -column(j, u[k], {where}{memory}c)
{advance}"""
COMMIT = "        advance(w, u[k], t[k] - t[k - 1] if k else 0.0, c)\n"
ERROR = """
@njit(cache=True)
def columns(x, c, out):
    for k in range(x.size):
        for j in range(out.shape[0]):
            out[j, k] = column(j, x[k], c)
"""


def state_columns(
    effect: Effect, x: Array, v: Array, a: Array, vs: Array, t: Array, others: Array | None = None
) -> Array:
    """Return the columns of a state effect, shape (parameters, N), over signals of shape (N,).

    others of shape (N, axes, 3) is the motion x, v, a of the effect's other axes; it is at rest
    where it is not given. Raises ValueError where shapes differ.
    """
    signals = _signals(x, v, a, vs, t)
    expected = (len(x), len(effect.other_axes), 3)
    beside = np.zeros(expected) if others is None else np.ascontiguousarray(others, np.float64)
    if beside.shape != expected:
        raise ValueError(f"the other axes' motion has shape {beside.shape}, not {expected}")
    out = np.empty((len(effect.parameters), len(x)))
    memory = np.zeros(effect.memory_size)
    _compiled(effect).columns(*signals, beside, memory, _constants(effect), out)
    return out


def input_columns(effect: Effect, u: Array, x: Array, vs: Array, t: Array) -> Array:
    """Return the columns -h(u) of an input effect, shape (parameters, N), over signals (N,).

    A memory follows the command from the first sample on, at rest before it. Raises ValueError
    where shapes differ.
    """
    out = np.empty((len(effect.parameters), len(u)))
    memory = np.zeros(effect.memory_size)
    _compiled(effect).columns(*_signals(u, x, vs, t), memory, _constants(effect), out)
    return out


def error_columns(effect: Effect, x: Array) -> Array:
    """Return the error of the measured position for an amplitude of one each.

    Parameters
    ----------
    effect
        A measurement effect with `amplitudes`.
    x
        Position [m], shape (N,).

    Returns
    -------
    Array
        Shape (amplitudes, N).
    """
    out = np.empty((len(effect.amplitudes), len(x)))
    _compiled(effect).columns(*_signals(x), _constants(effect), out)
    return out


def form_key(effect: Effect) -> tuple[str, str]:
    """Name a form of an effect: equal for equal options, and so for equal columns."""
    return effect.name, effect.options.model_dump_json()


def uses_acceleration(effect: Effect) -> bool:
    """Return whether a state effect's columns depend on the acceleration."""
    cls = type(effect)
    if cls not in _USES:
        x = np.linspace(0.0, 1.0, 64)
        others = np.zeros((64, len(effect.other_axes), 3))
        # A clock may count from 1970, and a change come at any time of it.
        t = np.geomspace(1e-6, LATEST_S, 64)
        still = state_columns(effect, x, x, np.zeros(64), x, t, others)
        moved = state_columns(effect, x, x, np.sin(37.0 * x), x, t, others)
        _USES[cls] = bool(np.any(still != moved))
    return _USES[cls]


LATEST_S = 1e15
"""Time at which every change has come [s]: a clock of milliseconds since 1970 shows 2e12. Larger
than any does. Convention."""
_USES: dict[type[Effect], bool] = {}


def _signals(*signals: Array) -> list[Array]:
    shapes = {np.shape(signal) for signal in signals}
    if len(shapes) > 1 or np.ndim(signals[0]) != 1:
        raise ValueError(f"the signals of a recording differ in shape: {sorted(shapes)}")
    return [np.ascontiguousarray(signal, np.float64) for signal in signals]


def _constants(effect: Effect) -> Array:
    return np.array(effect.constants, dtype=np.float64)


def _compiled(effect: Effect) -> ModuleType:
    return _module(type(effect))


@cache
def _module(cls: type[Effect]) -> ModuleType:
    remembers = cls.remembers()
    kernels = ["column", *(["advance"] if remembers else [])]
    source = f'"""Columns of {cls.name}. Generated; do not edit."""\n\nfrom numba import njit\n'
    source += f"from {cls.__module__} import {', '.join(kernels)}\n\n"
    memory = "w, " if remembers else ""
    if cls.kind == "state":
        source += STATE.format(advance=ADVANCE if remembers else "", memory=memory)
    elif cls.kind == "measurement":
        source += ERROR
    else:
        where = "".join(f"{name}[k], " for name in cls.place("x", "vs", "t"))
        source += INPUT.format(where=where, memory=memory, advance=COMMIT if remembers else "")
    return load_generated(f"columns_{cls.name}_{source_digest(source)}", source)
