"""The compiled law over many steps in one call: what one step costs without the call."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from motorctl.kernels import load_generated, source_digest, specialise
from motorctl_benchmarks.law_data import Array, LawData

SOURCE = '''"""The control law over an array of ticks. Generated; do not edit."""

import {module} as model
from numba import njit

from motorctl.control.law import law_step


@njit(cache=True)
def run(settings, state, t, y, xd, vd, ad, u):
    for k in range(t.size):
        u[k] = law_step(
            model.state_columns, model.input_columns, model.feedforward, model.input_map,
            model.input_slope, model.advance_context, model.advance_inputs, settings[0], state[0],
            t[k], y[k], xd[k], vd[k], ad[k],
        )
'''


class CompiledLaw:
    """`law_step`, as the loop runs it, over a stretch of recorded ticks."""

    def __init__(self, data: LawData) -> None:
        self._data = data
        self.state = data.start.copy()
        """The law's record, shape (1,)."""
        self.command_v: Array = np.zeros(data.steps)
        source = SOURCE.format(module=data.model.kernels.__name__)
        module = load_generated(f"law_{source_digest(source)}", source)
        self._arguments: tuple[Any, ...] = (
            data.settings,
            self.state,
            data.time_s,
            *data.motion,
            self.command_v,
        )
        self._run: Callable[..., None] = specialise(module.run, *self._arguments)

    def restart(self) -> None:
        """Put the law back to where the stretch began."""
        self.state[:] = self._data.start

    def run(self) -> None:
        """Go through the whole stretch, filling `command_v`."""
        self._run(*self._arguments)
