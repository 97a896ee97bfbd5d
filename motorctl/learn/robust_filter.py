"""How a learned voltage acts on the error, and which part of it may be learned for sure.

With P the plant and C the feedback, a voltage u beside the law's makes the error P S u, S = 1/(1 +
C P). From repetition to repetition u becomes Q (u - L e) with L = step/(P S) of the fitted plant:
what does not repeat aside, the error that is left shrinks by |Q (1 - L P S)| of the true one.
Where the motor saturates, a part g < 1 of u acts; then 1 - g L P S lies between 1 and 1 - L P S, so
that what shrinks does so more slowly.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from motorctl.config.analysis import DelayedPlant, Frequencies, LoopGains
from motorctl.errors import RunError
from motorctl.response.measurement import Measurement
from motorctl.tune.recorded_loop import RecordedLoop

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

STEP = 0.8
"""Part of what is left that one repetition takes. 1 learns more of the noise and bears less of an
error of the model, less takes more repetitions. By hand."""
SHRINKS_TO = 0.9
"""By which factor what is left shrinks at least, at every frequency and for every plant that may
be. Nearer to 1 learns higher and slower, lower gives band away. By hand."""
ROLL_OFF = 2
"""Order of the filter whose size, squared, is Q: so steep that |Q| falls faster than P grows less
certain. Steeper rings around edges, flatter lets through what is not known. By hand."""
HIGHEST_PER_CROSSOVER = 1.0
"""Highest corner without a measured response, over the loop's crossover: nobody has seen there
whether the axis rings. Higher trusts a rigid plant further, lower leaves edges. By hand: on the
shipped gantry three times as much leaves no less error."""
HIGHEST_PER_BAND = 0.5
"""Highest corner with a measured response, over the end of its coherent band: at the end Q has
fallen to a seventeenth. Higher learns where nobody has looked, lower gives band away."""
LINE_ERRORS = 2.0
"""Standard errors of a measured line that are borne. Convention: 95 %."""
HIGHEST_PER_RATE = 0.1
"""Highest corner at all, over the rate of the axis. Beyond, a period's hold is not small."""
LOWEST_HARMONIC = 5.0
"""Lowest corner that is of use, in harmonics of the cycle. Lower, next to nothing is learned;
higher refuses what would still help. By hand."""
CORNERS = 200
"""Corners that are tried, from high to low. Fewer give band away, more take time."""


@dataclass(frozen=True)
class LearningFilter:
    """The filters of one axis and program, at the harmonics of its cycle, (n,) each."""

    frequency_hz: Array
    corner_hz: float
    robust: Array
    """Q: real, so that nothing is shifted in time."""
    inverse: ComplexArray
    """L: from error to voltage [V/m]; 0 at frequency 0, which the fast adaptation takes."""
    shrinks: Array
    """|Q (1 - L P S)| with the fitted plant."""
    shrinks_at_worst: Array
    """Its largest over all plants that may be."""
    bound_by: str
    """What keeps the corner from being higher."""


def process_sensitivity(
    plant: ComplexArray, gains: LoopGains, frequency_hz: Array, period_s: float
) -> ComplexArray:
    """Return the error that a voltage beside the law's makes [m/V], (n,) above 0 Hz.

    plant is what a command does to the position [m/V], at these frequencies.
    """
    at = Frequencies.at(2.0 * np.pi * frequency_hz, period_s)
    result: ComplexArray = plant / (1.0 + gains.feedback(at) * plant)
    return result


def learning_filter(
    loop: RecordedLoop, cycle_s: float, points: int, measured: Measurement | None = None
) -> LearningFilter:
    """Return the filters of an axis that repeats a cycle.

    Parameters
    ----------
    loop
        What a log tells of it: gains, fitted plant, and what is not known of that.
    cycle_s, points
        Of the cycle [s], and in it.
    measured
        A measured response: in its band it takes the place of plant and bounds.

    Raises
    ------
    RunError
        Where nothing can be learned for sure.
    """
    frequency = np.arange(1, points // 2 + 1) / cycle_s
    around = _Around(loop, measured)
    nominal, left = around.nominal(frequency), around.left(frequency)
    corner, bound_by = _corner(frequency, left, *around.highest(frequency, nominal))
    robust = _robust(frequency, corner)
    inverse = np.zeros(points // 2 + 1, np.complex128)
    inverse[1:] = STEP / nominal
    return LearningFilter(
        frequency_hz=np.concatenate([[0.0], frequency]),
        corner_hz=corner,
        robust=np.concatenate([[0.0], robust]),
        inverse=inverse,
        shrinks=np.concatenate([[0.0], robust * (1.0 - STEP)]),
        shrinks_at_worst=np.concatenate([[0.0], robust * left]),
        bound_by=bound_by,
    )


@dataclass(frozen=True)
class _Around:
    """What is known of an axis' process sensitivity."""

    loop: RecordedLoop
    measured: Measurement | None

    def nominal(self, frequency: Array) -> ComplexArray:
        """Return the process sensitivity of the plant that is taken for true."""
        plant, period_s = self.loop.plant, self.loop.period_s
        if self.measured is not None:
            return self._closed(self.measured.fitted.response(frequency, period_s), frequency)
        delay_s = max(plant.delay_s - plant.delay_open_s, 0.0)
        rigid = plant.at(plant.theta1, plant.theta2, period_s, delay_s)
        return self._closed(rigid.response(2.0 * np.pi * frequency), frequency)

    def left(self, frequency: Array) -> Array:
        """Return what is left of an error at worst, of all plants that may be, without Q."""
        nominal, w = self.nominal(frequency), 2.0 * np.pi * frequency
        ratios = [self._closed(plant.response(w), frequency) / nominal for plant in self._plants()]
        left = np.max([np.abs(1.0 - STEP * ratio) for ratio in ratios], axis=0)
        if self.measured is None:
            return np.asarray(left)
        hz, of_lines = self._left_at_lines(self.measured)
        inside = (frequency >= hz[0]) & (frequency <= hz[-1])
        return np.where(inside, np.interp(frequency, hz, of_lines), left)

    def highest(self, frequency: Array, nominal: ComplexArray) -> tuple[float, str]:
        """Return the highest corner that is tried, and what bounds it."""
        by_rate = HIGHEST_PER_RATE / self.loop.period_s
        if self.measured is not None:
            response = self.measured.response
            top = HIGHEST_PER_BAND * float(response.frequency_hz[response.coherent][-1])
            return min((by_rate, "the axis' rate"), (top, "the band of the measured response"))
        feedback = self.loop.gains.feedback(
            Frequencies.at(2.0 * np.pi * frequency, self.loop.period_s)
        )
        # P S C = T: the crossover is where |T/(1 - T)| falls below 1.
        closed = nominal * feedback
        above = np.flatnonzero(np.abs(closed) >= np.abs(1.0 - closed))
        crossover = float(frequency[above[-1]] if len(above) else frequency[0])
        by_crossover = HIGHEST_PER_CROSSOVER * crossover
        return min((by_rate, "the axis' rate"), (by_crossover, "the loop's crossover"))

    def _closed(self, plant: ComplexArray, frequency: Array) -> ComplexArray:
        return process_sensitivity(plant, self.loop.gains, frequency, self.loop.period_s)

    def _plants(self) -> list[DelayedPlant]:
        plant = self.loop.plant
        delays = {max(plant.delay_s - 2.0 * plant.delay_open_s, 0.0), plant.delay_s}
        parameters = [*plant.at_bounds, (plant.theta1, plant.theta2)]
        return [
            plant.at(*pair, self.loop.period_s, delay)
            for pair, delay in product(parameters, delays)
        ]

    def _left_at_lines(self, measured: Measurement) -> tuple[Array, Array]:
        """Return the coherent lines [Hz], and what is left at them where the errors are largest."""
        response = measured.response
        good = response.coherent
        hz, plant = response.frequency_hz[good], response.plant[good]
        closed = self._closed(plant, hz)
        ratio = closed / self.nominal(hz)
        # The loop takes a part of the plant's error back: relative, it counts S times.
        error = LINE_ERRORS * response.plant_error[good] * np.abs(closed / plant)
        left: Array = np.abs(1.0 - STEP * ratio) + STEP * np.abs(ratio) * error
        return hz, left


def _corner(frequency: Array, left: Array, highest_hz: float, why: str) -> tuple[float, str]:
    """Return the highest corner with which all that is left shrinks, and what bounds it."""
    lowest_hz = min(LOWEST_HARMONIC * frequency[0], highest_hz)
    for corner in np.geomspace(highest_hz, lowest_hz, CORNERS):
        if np.max(_robust(frequency, corner) * left) <= SHRINKS_TO:
            bound_by = why if corner == highest_hz else "how well the plant is known"
            return float(corner), bound_by
    worst = int(np.argmax(_robust(frequency, lowest_hz) * left))
    raise RunError(
        f"nothing can be learned for sure: at {frequency[worst]:.3g} Hz as much as "
        f"{left[worst]:.3g} of an error would be left where the plant is at the end of its bounds; "
        f"limit {SHRINKS_TO:g}: `motorctl refine` narrows bounds, and --response does without"
    )


def _robust(frequency: Array, corner_hz: float) -> Array:
    result: Array = 1.0 / (1.0 + (frequency / corner_hz) ** (2 * ROLL_OFF))
    return result
