"""A filter of second order on the feedback's part of the command: a notch, or a low-pass.

It is there for a resonance that would limit the gains. The model's part of the command is not
filtered, so that nothing of it comes late; at rest the filter changes nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import UsageError
from motorctl.kernels import inner_kernel

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class CommandFilter:
    """(b0 + b1/z + b2/z^2)/(1 + a1/z + a2/z^2), 1 at frequency 0; made by `command_filter`."""

    kind: str
    frequency_hz: float
    damping: float
    depth: float
    b0: float
    b1: float
    b2: float
    a1: float
    a2: float

    def response(self, z: ComplexArray) -> ComplexArray:
        """Return what it does to a wave, at each z = exp(j w Ts)."""
        over: ComplexArray = self.b0 + (self.b1 + self.b2 / z) / z
        result: ComplexArray = over / (1.0 + (self.a1 + self.a2 / z) / z)
        return result


def command_filter(
    kind: str, frequency_hz: float, damping: float, depth: float, period_s: float
) -> CommandFilter:
    """Return a filter as it runs at a period, the bilinear transform true at its frequency.

    Parameters
    ----------
    kind
        `notch`: (s^2 + 2 depth damping w s + w^2)/(s^2 + 2 damping w s + w^2); `low_pass`:
        w^2/(s^2 + 2 damping w s + w^2).
    frequency_hz
        w/2 pi, below half of the rate [Hz].
    damping
        Of the poles: how wide a notch is.
    depth
        What a notch leaves at its frequency.
    period_s
        Of the axis [s].

    Returns
    -------
    CommandFilter
        1 at frequency 0.

    Raises
    ------
    UsageError
        Where half of the rate is no higher than the frequency: no sampled filter is such a one.
    """
    if not 0.0 < frequency_hz * period_s < 0.5:
        raise UsageError(
            f"a filter of the command at {frequency_hz:g} Hz: must be above 0 and below half of "
            f"the rate, {0.5 / period_s:g} Hz"
        )
    t = math.tan(math.pi * frequency_hz * period_s)  # s = w/t (z - 1)/(z + 1)
    scale = 1.0 + 2.0 * damping * t + t * t
    a1, a2 = 2.0 * (t * t - 1.0) / scale, (1.0 - 2.0 * damping * t + t * t) / scale
    keys = kind, frequency_hz, damping, depth
    if kind == "low_pass":
        b = t * t / scale
        return CommandFilter(*keys, b, 2.0 * b, b, a1, a2)
    half = 2.0 * depth * damping * t
    return CommandFilter(
        *keys, (1.0 + half + t * t) / scale, a1, (1.0 - half + t * t) / scale, a1, a2
    )


@inner_kernel
def filtered(settings: Any, state: Any, feedback: float) -> float:
    """Return the feedback's part of the command behind the filter, and remember it [V]."""
    b, a = settings.filter_b, settings.filter_a
    out = b[0] * feedback + state.filter[0]
    state.filter[0] = b[1] * feedback - a[0] * out + state.filter[1]
    state.filter[1] = b[2] * feedback - a[1] * out
    state.feedback, state.filtered = feedback, out
    return out  # type: ignore[no-any-return]


@inner_kernel
def settle_filter(settings: Any, state: Any, feedback: float) -> None:
    """Let the filter have had this feedback for long: it gives as much [V]."""
    state.filter[0], state.filter[1] = 0.0, 0.0
    state.feedback, state.filtered = 0.0, 0.0
    shift_filter(settings, state, feedback)


@inner_kernel
def shift_filter(settings: Any, state: Any, by: float) -> None:
    """Let a feedback that is another by so much from now on be so at once, behind it, too [V]."""
    if settings.filters:
        state.filter[0] += (1.0 - settings.filter_b[0]) * by
        state.filter[1] += (settings.filter_b[2] - settings.filter_a[1]) * by
        state.feedback += by
        state.filtered += by
