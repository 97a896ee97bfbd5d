"""What an effect remembers from tick to tick."""

from __future__ import annotations

import numpy as np
import pytest

from motorctl.model.conformance.driven import PERIOD_S, Driven, strokes
from motorctl.model.effect import Effect

TICKS = 500
"""Ticks of a stroke to and fro. More takes time, fewer makes the stroke so quick that slow memories
hardly change. Chosen by hand: 0.1 s."""


class MemoryChecks:
    """Memories begin at rest, follow the motion alone, and are written by `advance` alone."""

    def test_a_memory_at_rest_stays_as_it_is(self, effect: Effect) -> None:
        """Whether an axis stands for a tick or for a thousand makes no difference."""
        _only_remembering(effect)
        driven = Driven(effect)
        for k in range(3):
            _step(driven, (0.07, 0.0, 0.0, 0.0), 0.0 if k == 0 else PERIOD_S)
            if k == 0:
                first = driven.memory.copy()
        assert np.array_equal(driven.memory, first), f"{first.tolist()}, {driven.memory.tolist()}"

    def test_the_same_motion_leaves_the_same_memory(self, effect: Effect) -> None:
        """Loop, simulation and analysis run the same kernels and have to agree, bit for bit."""
        _only_remembering(effect)
        ends = []
        for _ in range(2):
            driven = Driven(effect)
            for k, place in enumerate(strokes(TICKS)):
                _step(driven, place, PERIOD_S if k else 0.0)
            ends.append(driven.memory)
        assert np.array_equal(ends[0], ends[1]), f"{ends[0].tolist()}, {ends[1].tolist()}"
        assert np.isfinite(ends[0]).all(), ends[0].tolist()

    def test_the_memory_matters(self, effect: Effect) -> None:
        """Else it need not be one."""
        _only_remembering(effect)
        fresh, driven = Driven(effect), Driven(effect)
        told = False
        for k, place in enumerate(strokes(TICKS)):
            _step(driven, place, PERIOD_S if k else 0.0)
            told |= _columns(driven, place) != _columns(fresh, place)
        assert told, "its columns are the same without the memory"

    def test_columns_leave_the_memory_alone(self, effect: Effect) -> None:
        """The law looks at many commands before one of them acts."""
        _only_remembering(effect)
        driven = Driven(effect)
        for k, place in enumerate(strokes(TICKS)):
            _step(driven, place, PERIOD_S if k else 0.0)
            before = driven.memory.copy()
            _columns(driven, place)
            assert np.array_equal(driven.memory, before), "column or slope writes to the memory"


def _only_remembering(effect: Effect) -> None:
    if not effect.memory_size:
        pytest.skip("it has no memory")


def _step(driven: Driven, place: tuple[float, float, float, float], dt: float) -> None:
    x, v, a, u = place
    if driven.effect.kind == "state":
        driven.advance(x, v, a, dt)
    else:
        driven.commit(u, dt)


def _columns(driven: Driven, place: tuple[float, float, float, float]) -> list[float]:
    x, v, a, u = place
    if driven.effect.kind == "state":
        return [driven.state(j, x, v, a, v, 1.0) for j in driven.indices]
    kernels = [(kernel, j) for kernel in ("column", "slope") for j in driven.indices]
    return [driven.input(kernel, j, u, x, 1.0) for kernel, j in kernels]
