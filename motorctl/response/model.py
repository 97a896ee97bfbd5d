"""The response that an axis' own model has: the sampled plant and loop as `check` takes them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.config.analysis import DelayedPlant, Frequencies
from motorctl.config.loop_rules import loop_gains, parameter_range
from motorctl.config.machine import Axis

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class ModelResponse:
    """What the model of an axis answers at some frequencies, (n,) each."""

    plant: ComplexArray
    """P, from the command to the position [m/V]."""
    loop: ComplexArray
    """L = C P."""

    @property
    def sensitivity(self) -> ComplexArray:
        """S = 1/(1 + L)."""
        result: ComplexArray = 1.0 / (1.0 + self.loop)
        return result


def stiff(theta1: float, theta2: float, w: Array) -> ComplexArray:
    """Return the force over the acceleration of a mass with viscous friction [V s^2/m]."""
    result: ComplexArray = np.asarray(theta1 + theta2 / (1j * w), np.complex128)
    return result


def sprung_plant(
    plant: DelayedPlant, w: Array, rigid: ComplexArray, sprung: ComplexArray
) -> ComplexArray:
    """Return the response of a plant with parts on springs besides.

    Parameters
    ----------
    plant
        Without them, sampled.
    w
        (n,) frequencies, above 0 [rad/s].
    rigid, sprung
        (n,) force over acceleration [V s^2/m], without them and of them.
    """
    result: ComplexArray = plant.response(w) * rigid / (rigid + sprung)
    return result


def model_response(axis: Axis, period_s: float, frequency_hz: Array) -> ModelResponse:
    """Return the response of an axis' model as it starts: mass, friction, delay, lag, springs.

    Dry friction and forces of the place are in no response; nor is the slope of the input map,
    which the law inverts.

    Parameters
    ----------
    axis
        The axis, with its model and gains.
    period_s
        Its period [s].
    frequency_hz
        (n,) frequencies, above 0 [Hz].
    """
    model, w = axis.model, 2.0 * np.pi * np.asarray(frequency_hz, np.float64)
    theta1 = parameter_range(model, axis.estimates, "acceleration")[0]
    theta2 = parameter_range(model, axis.estimates, "velocity")[0]
    delay_s = axis.adaptation.input_delay_s + model.delay_s
    plant = DelayedPlant((theta1, theta2, 0.0), period_s, delay_s, model.lag_s)
    sprung = np.zeros(len(w), np.complex128)
    estimates = iter(axis.estimates)
    for effect in model.effects:
        own = sum(next(estimates).initial for _ in effect.parameters)
        if (column := effect.over_acceleration(w)) is not None:
            sprung += own * column
    answer = sprung_plant(plant, w, stiff(theta1, theta2, w), sprung)
    feedback = loop_gains(axis.gains, period_s).feedback(Frequencies.at(w, period_s))
    return ModelResponse(answer, feedback * answer)
