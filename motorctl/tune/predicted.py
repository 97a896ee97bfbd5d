"""What a log's error would have been with other gains.

The loop is linear in what disturbs it: with L the open loop, the same disturbance and the same
noise leave S = 1/(1 + L) of themselves, so an error that was recorded with gains of L_old becomes
E_new = E_old (1 + L_old)/(1 + L_new), whatever made it. The disturbance itself need not be known.
What is not linear is left out: dry friction that sticks, and a command or a d0_hat at its limit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from motorctl.config.analysis import Frequencies, LoopGains
from motorctl.tune.recorded_loop import RecordedLoop

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

WIDEST_HZ = 600.0
"""Band of the error that is predicted [Hz]. Wider takes time and adds what the encoder rounds away,
narrower loses peaks: six crossovers of a fast gantry lie below."""
NOISE_POINTS = 400
"""Frequencies over which the command's noise is summed. Fewer steps over the peak of S at small
margins, more takes time."""
BLEND = 0.1
"""Part of the rows that leads from the last one back to the first, so that a spectrum sees no step.
Shorter makes one of a drift, longer takes time."""


@dataclass(frozen=True)
class Prediction:
    """What an axis would do with other gains."""

    eF_m: float  # noqa: N815 (the paper's symbol)
    """Largest error over the rows that count [m]."""
    L2_m: float
    """Its root mean square over them [m]."""
    command_noise_v: float
    """Of the command at rest, from the noise of the measured position [V rms]."""
    d0_hat_v: float
    """Largest |d0_hat| over the rows that count [V]."""
    error: Array
    """Error over the rows that count [m], at the rate of the band that is predicted."""


class Predictor:
    """Predicts the error of one recorded loop, gains after gains.

    Parameters
    ----------
    loop
        The recorded loop.
    """

    def __init__(self, loop: RecordedLoop) -> None:
        self._loop = loop
        n = len(loop.error)
        padded = next_fast_len(n + max(round(BLEND * n), 1), real=True)
        error, d0_hat = (_closed(values, padded) for values in (loop.error, loop.d0_hat))
        nyquist_hz = 0.5 / loop.period_s
        bins = min(padded // 2, max(2, round(padded // 2 * WIDEST_HZ / nyquist_hz)))
        self._rows = next_fast_len(2 * bins, real=True)
        self._scale = self._rows / padded
        self._error: ComplexArray = np.fft.rfft(error)[: bins + 1]
        self._d0_hat: ComplexArray = np.fft.rfft(d0_hat)[: bins + 1]
        bin_rad_s = 2.0 * np.pi / (padded * loop.period_s)
        self._w: Array = bin_rad_s * np.arange(1.0, bins + 1)
        self._plant = loop.plant.nominal(loop.period_s).response(self._w)
        self._at = Frequencies.at(self._w, loop.period_s)
        end = round(n * self._scale)
        self._counted = slice(max(end - max(round(loop.counted * self._scale), 1), 0), end)

    @cached_property
    def _before(self) -> tuple[ComplexArray, ComplexArray]:
        """1 + L as recorded, and what gave d0_hat of the error."""
        gains = self._loop.gains
        return self._return_difference(gains), self._to_d0_hat(gains)

    @cached_property
    def _noise(self) -> tuple[Frequencies, ComplexArray]:
        period_s = self._loop.period_s
        w = np.pi / period_s * (np.arange(NOISE_POINTS) + 0.5) / NOISE_POINTS
        return Frequencies.at(w, period_s), self._loop.plant.nominal(period_s).response(w)

    def predict(self, gains: LoopGains) -> Prediction:
        """Return what the axis would do with these gains.

        Parameters
        ----------
        gains
            The gains.

        Returns
        -------
        Prediction
            Error, noise of the command, and how much the fast adaptation would have to take.
        """
        ratio = self._before[0] / self._return_difference(gains)
        new = self._error.copy()
        new[1:] *= ratio
        new[0] *= ratio[0].real
        error = self._in_time(new)[self._counted]
        return Prediction(
            eF_m=float(np.abs(error).max()),
            L2_m=float(np.sqrt(np.mean(error**2))),
            command_noise_v=self.command_noise_v(gains),
            d0_hat_v=float(np.abs(self._d0_hat_of(gains, ratio)).max()),
            error=error,
        )

    def command_noise_v(self, gains: LoopGains) -> float:
        """Return what the noise of the measured position makes of the command at rest [V rms]."""
        at, plant = self._noise
        feedback = gains.feedback(at)
        gain = np.abs(feedback / (1.0 + feedback * plant))
        return self._loop.noise_rms_m * float(np.sqrt(np.mean(gain**2)))

    def _d0_hat_of(self, gains: LoopGains, ratio: ComplexArray) -> Array:
        recorded, before = self._d0_hat, self._before[1]
        if self._loop.gains.gamma_d > 0.0:
            new = recorded.copy()
            new[1:] *= self._to_d0_hat(gains) / before * ratio
        else:  # it stood still, so only the error tells what it would have followed
            new = np.zeros_like(recorded)
            new[0] = recorded[0]
            new[1:] = self._to_d0_hat(gains) * self._error[1:] * ratio
        return self._in_time(new)[self._counted]

    def _in_time(self, spectrum: ComplexArray) -> Array:
        result: Array = np.fft.irfft(spectrum, self._rows) * self._scale
        return result

    def _return_difference(self, gains: LoopGains) -> ComplexArray:
        result: ComplexArray = 1.0 + gains.feedback(self._at) * self._plant
        return result

    def _to_d0_hat(self, gains: LoopGains) -> ComplexArray:
        only = LoopGains(gains.k1_1_s, 0.0, gains.gamma_d)
        return only.feedback(self._at)


def _closed(values: Array, length: int) -> Array:
    """Return values that lead from their last one back to the first, so that they go round."""
    n = len(values)
    back = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, length - n + 1) / (length - n + 1))
    return np.concatenate([values, values[-1] + back * (values[0] - values[-1])])
