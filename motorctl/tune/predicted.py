"""What a log's error would have been with other gains.

The loop is linear in what disturbs it. With P the plant, L the open loop and C = ks + gamma_d/s,
the disturbance and the noise together make D, and where the law's desired velocity is M ahead of
the measured one (`gains.velocity: published`) the feedback adds C M:

    (1 + L) E = D + P C M,    so    E_new = (E_old (1 + L_old) + P (C_new - C_old) M)/(1 + L_new)

D need not be known. What is not linear is left out: dry friction that sticks, a command or a d0_hat
at its limit, and parameters that adapt otherwise.
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

WIDEST = 0.12
"""Band of the error that is predicted, as a part of the rate: 600 Hz at 5 kHz. Wider takes time and
adds what the encoder rounds away, narrower loses peaks: the band ends at some six crossovers."""
FINER = 2
"""Points in time for each that the band needs. Fewer fall beside the peaks, more takes time."""
NOISE_POINTS = 400
"""Frequencies over which the command's noise is summed. Fewer steps over the peak of S at small
margins, more takes time."""
BLEND = 0.1
"""Part of the rows that leads from the last one back to the first where they are no whole periods,
so that a spectrum sees no step. Shorter makes one of a drift, longer takes time."""


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
        blend = max(round(BLEND * n), 1)
        padded = n if loop.goes_round else next_fast_len(n + blend, real=True)
        columns = (_closed(each, padded) for each in (loop.error, loop.d0_hat, loop.ahead))
        bins = max(2, round(padded * WIDEST))
        self._rows = next_fast_len(2 * FINER * bins, real=True)
        self._scale = self._rows / padded
        self._error, self._d0_hat, self._ahead = (np.fft.rfft(c)[: bins + 1] for c in columns)
        bin_rad_s = 2.0 * np.pi / (padded * loop.period_s)
        self._w: Array = bin_rad_s * np.arange(1.0, bins + 1)
        self._plant = loop.plant_response(self._w)
        self._at = Frequencies.at(self._w, loop.period_s)
        end = round(n * self._scale)
        self._counted = slice(max(end - max(round(loop.counted * self._scale), 1), 0), end)

    @cached_property
    def _before_difference(self) -> ComplexArray:
        return self._return_difference(self._loop.gains)

    @cached_property
    def _before(self) -> tuple[ComplexArray, ComplexArray]:
        """What drives the loop with the gains of the log, and its d0_hat, both without mean."""
        gains = self._loop.gains
        driven = self._error[1:] * self._before_difference
        return driven - self._published(gains), self._followed(gains, self._error[1:])

    @cached_property
    def _noise(self) -> tuple[Frequencies, ComplexArray]:
        period_s = self._loop.period_s
        w = np.pi / period_s * (np.arange(NOISE_POINTS) + 0.5) / NOISE_POINTS
        return Frequencies.at(w, period_s), self._loop.plant_response(w)

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
        driven, followed = self._before
        new = np.empty_like(self._error)
        difference = self._return_difference(gains)
        new[1:] = (driven + self._published(gains)) / difference
        # What is left of a mean is that of a cut: it goes as the slowest wave does.
        new[0] = self._error[0] * (self._before_difference[0] / difference[0]).real
        error = self._in_time(new)[self._counted]
        d0_hat = self._d0_hat.copy()
        d0_hat[1:] += self._followed(gains, new[1:]) - followed
        if gains.gamma_d > 0.0:  # what the position error had to hold against is d0_hat's now
            before = self._loop.gains
            d0_hat[0] += before.ks_v_s_m * before.k1_1_s * self._error[0]
        return Prediction(
            eF_m=float(np.abs(error).max()),
            L2_m=float(np.sqrt(np.mean(error**2))),
            command_noise_v=self.command_noise_v(gains),
            d0_hat_v=float(np.abs(self._in_time(d0_hat)[self._counted]).max()),
            error=error,
        )

    def command_noise_v(self, gains: LoopGains) -> float:
        """Return what the noise of the measured position makes of the command at rest [V rms]."""
        at, plant = self._noise
        feedback = gains.feedback(at)
        gain = np.abs(feedback / (1.0 + feedback * plant))
        return self._loop.noise_rms_m * float(np.sqrt(np.mean(gain**2)))

    def _in_time(self, spectrum: ComplexArray) -> Array:
        result: Array = np.fft.irfft(spectrum, self._rows) * self._scale
        return result

    def _return_difference(self, gains: LoopGains) -> ComplexArray:
        result: ComplexArray = 1.0 + gains.feedback(self._at) * self._plant
        return result

    def _published(self, gains: LoopGains) -> ComplexArray:
        """Return what a desired velocity that is ahead does to the error, before feedback."""
        result: ComplexArray = gains.feedback_of_p(self._at) * self._plant * self._ahead[1:]
        return result

    def _followed(self, gains: LoopGains, error: ComplexArray) -> ComplexArray:
        """Return d0_hat of an error, without its mean: gamma_d/s of p."""
        p = (self._at.difference + gains.k1_1_s) * error - self._ahead[1:]
        result: ComplexArray = gains.gamma_d * self._at.integral * p
        return result


def _closed(values: Array, length: int) -> Array:
    """Return values that lead from their last one back to the first, so that they go round."""
    n = len(values)
    back = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, length - n + 1) / (length - n + 1))
    return np.concatenate([values, values[-1] + back * (values[0] - values[-1])])
