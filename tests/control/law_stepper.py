"""The law tick by tick from Python, on whatever plant and reference a test makes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from law_bench import fill_law

from motorctl.control import fill_state, law_settings, law_state
from motorctl.kernels import load_generated, source_digest
from motorctl.model import Effect, EffectList, effect_class, make_effect

SOURCE = """from numba import njit

import {effects} as model
from motorctl.control import law_step, shift_law, start_law


@njit(cache=True)
def start(settings, state, t, y):
    start_law(model.feedforward, model.advance_context, settings[0], state[0], t, y)


@njit(cache=True)
def shift(settings, state, t, y, by):
    shift_law(model.feedforward, model.advance_context, settings[0], state[0], t, y, by)


@njit(cache=True)
def step(settings, state, t, y, xd, vd, ad):
    return law_step(
        model.state_columns, model.input_columns, model.feedforward, model.input_map,
        model.input_slope, model.advance_context, model.advance_inputs, settings[0], state[0], t, y,
        xd, vd, ad,
    )
"""

Motion = Sequence[float]


def known(name: str, **options: Any) -> Effect:
    """Return one of the known effects."""
    return make_effect(effect_class(name), options)


class Stepper:
    """The law over a list of effects, its records filled."""

    def __init__(
        self, model: EffectList, theta: Motion, lower: Motion, upper: Motion, **settings: Any
    ) -> None:
        n, period_s = len(model), 0.2e-3
        self.settings = np.zeros(1, law_settings(n))
        others = len(model.other_axes)
        self.state = np.zeros(1, law_state(n, model.context_size, others))
        given = {
            "period_s": period_s,
            "k1_1_s": 250.0,
            "ks_v_s_m": 95.0,
            "gamma_d": 500.0,
            "d_hat_max_v": 1.0,
            "max_voltage_v": 10.0,
            "velocity": "matched",
            "lower": lower,
            "upper": upper,
            "covariance": np.full(n, 1e3),
            "filter_rad_s": 300.0,
            **settings,
        }
        fill_law(self.settings[0], model, given)
        fill_state(self.state[0], theta, given["covariance"])
        source = SOURCE.format(effects=model.kernels.__name__)
        self._kernels = load_generated(f"law_stepper_{source_digest(source)}", source)

    @property
    def record(self) -> np.void:
        """The law's state."""
        record: np.void = self.state[0]
        return record

    def start(self, t: float, y: float) -> None:
        """Begin at rest."""
        self._kernels.start(self.settings, self.state, t, y)

    def shift(self, t: float, y: float, by: float) -> None:
        """Move to new coordinates."""
        self._kernels.shift(self.settings, self.state, t, y, by)

    def step(
        self,
        t: float,
        y: float,
        motion: Motion,
        near: Motion | None = None,
        far: Motion | None = None,
    ) -> float:
        """Return the command; near and far are needed where the list declares a lag or a delay."""
        for field, told in (("near", near), ("far", far)):
            if told is not None:
                self.state[field][0] = told
        u: float = self._kernels.step(self.settings, self.state, t, y, *map(float, motion))
        return u
