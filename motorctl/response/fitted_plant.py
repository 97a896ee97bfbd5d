"""The plant behind a measured response: mass, friction, lag, delay, and the parts that ring.

What rings is asked of the effects: each tells its column over the acceleration, the forms that are
worth trying, and which of its options may be refined.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from motorctl.config.analysis import DelayedPlant
from motorctl.model import Effect, known_effects
from motorctl.model.knowledge import Spans
from motorctl.response.estimate import Response
from motorctl.response.model import sprung_plant, stiff

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

LEAST_ERROR = 0.01
"""Relative error of a line that counts at least: what a mass with friction, lag and delay leaves of
a sound machine. Smaller names what is no resonance, larger misses faint ones. By hand."""
BETTER = 60.0
"""By how much the squares over their errors must fall for a part that rings. Smaller finds parts in
noise, larger misses faint ones. By hand."""
FAINT_DB = 1.0
"""A part that changes the response by less than this where it rings is not named [dB]. By hand."""
MOST_PARTS = 4
"""Parts that are looked for at most. More takes time."""
LARGEST_SHARE = 0.95
"""Of the mass, in all parts together: the carriage itself weighs something."""
STEPS = 6.0
"""By how many of its first steps an option may be refined. Fewer miss what lies between two trials,
more run into the neighbour."""


@dataclass(frozen=True)
class RingingPart:
    """A part of the mass that hangs on a spring."""

    effect: Effect
    """What it is, with its options as found."""
    share: float
    """Of the whole mass."""
    option_errors: dict[str, float]
    """Standard errors of the options that were refined, in their units."""

    @property
    def resonance_hz(self) -> float:
        """Where the axis as a whole rings: the part with the carriage free [Hz]."""
        return self.effect.on_rigid_acceleration((self.share,))[0].lines[0]

    @property
    def words(self) -> str:
        """What it is, with its options and their errors."""
        options = self.effect.options.model_dump()
        told = ", ".join(
            f"{key} {options[key]:.4g} ± {error:.2g}" for key, error in self.option_errors.items()
        )
        return (
            f"{self.effect.name}: {told}, {self.share:.1%} of the mass; "
            f"the axis rings at {self.resonance_hz:.4g} Hz"
        )


@dataclass(frozen=True)
class FittedPlant:
    """Parameters of a plant that answers as was measured."""

    theta1: float
    """Whole mass [V s^2/m]."""
    theta2: float
    """Viscous friction [V s/m]."""
    delay_s: float
    lag_s: float
    errors: tuple[float, float, float, float]
    """Standard errors of these four."""
    delay_at_lag: tuple[float, float]
    """By how much the delay changes with the lag, about -1, as a response tells both together
    better than which is which; and its standard error [s] where the lag is known."""
    parts: tuple[RingingPart, ...]
    error_db: float
    """What it leaves of the coherent lines, rms [dB]."""

    def mostly_delay(self, errors: float) -> tuple[float, float]:
        """Return delay and lag [s] where as much of them is delay as may be.

        A delay costs more margin than a lag as long.

        Parameters
        ----------
        errors
            So many standard errors less lag, and then more delay.
        """
        lag_s = max(self.lag_s - errors * self.errors[3], 0.0)
        slope, error_s = self.delay_at_lag
        return self.delay_s + slope * (lag_s - self.lag_s) + errors * error_s, lag_s

    def response(self, frequency_hz: Array, period_s: float) -> ComplexArray:
        """Return its response P [m/V] at some frequencies."""
        w = 2.0 * np.pi * frequency_hz
        forms = [part.effect for part in self.parts]
        columns = [_column(form, w) for form in forms]
        shares = [part.share for part in self.parts]
        rigid = (self.theta1, self.theta2, self.delay_s, self.lag_s)
        return _response(rigid, shares, columns, w, period_s)


def fit_plant(response: Response) -> FittedPlant:
    """Return the plant that a response's coherent lines tell."""
    return _Fit(response).found()


def _conditional(covariance: Array) -> tuple[float, float]:
    """Return by how much the first changes with the second, and its error where that is known."""
    (first, both), (_, second) = covariance
    slope = both / second if second > 0.0 else 0.0
    return float(slope), float(np.sqrt(max(first - slope * both, 0.0)))


def _column(form: Effect, w: Array) -> ComplexArray:
    column = form.over_acceleration(w)
    assert column is not None  # such forms alone are tried
    return column


def _response(
    rigid: tuple[float, float, float, float],
    shares: Sequence[float],
    columns: Sequence[ComplexArray],
    w: Array,
    period_s: float,
) -> ComplexArray:
    theta1, theta2, delay_s, lag_s = rigid
    plant = DelayedPlant((theta1, theta2, 0.0), period_s, delay_s, lag_s)
    alone = stiff(theta1, theta2, w)
    sprung = sum((theta1 * s * c for s, c in zip(shares, columns, strict=True)), 0.0 * alone)
    return sprung_plant(plant, w, alone, sprung)


class _Fit:
    def __init__(self, response: Response) -> None:
        good = response.coherent
        self._hz = response.frequency_hz[good]
        self._w = 2.0 * np.pi * self._hz
        self._period_s = response.period_s
        self._plant = response.plant[good]
        self._errors = np.hypot(response.plant_error[good], LEAST_ERROR)
        self._spans = Spans(
            position_m=(0.0, 0.0),
            speed_m_s=0.0,
            acceleration_m_s2=0.0,
            command_v=0.0,
            time_s=(0.0, 1.0 / float(np.min(np.diff(self._hz), initial=self._hz[0]))),
            period_s=response.period_s,
            band_hz=float(self._hz[-1]),
            resolution_m=0.0,
        )

    def found(self) -> FittedPlant:
        """Return the plant: parts are added as long as they explain much."""
        forms: list[Effect] = []
        theta1 = float(np.median(1.0 / (self._w**2 * np.abs(self._plant))))
        start = np.array([np.log(theta1), 0.0, self._period_s, self._period_s])
        best, squares, jacobian = self._solved(start, forms)
        while len(forms) < MOST_PARTS:
            added = self._most_telling(best, forms)
            if added is None:
                break
            form, share = added
            tried = [*forms, form]
            begin = np.concatenate([best, [share], np.zeros(len(form.steps(self._spans)))])
            values, less, slopes = self._solved(begin, tried)
            faint = self._depth_db(values, tried) < FAINT_DB
            if squares - less < BETTER or faint:
                break
            forms, best, squares, jacobian = tried, values, less, slopes
        return self._told(best, forms, jacobian)

    def _solved(self, start: Array, forms: list[Effect]) -> tuple[Array, float, Array]:
        low, high = [-np.inf, 0.0, 0.0, 0.02 * self._period_s], [np.inf] * 4
        for form in forms:
            options = form.options.model_dump()
            steps = form.steps(self._spans).items()
            reach = [float(np.log1p(STEPS * step / options[key])) for key, step in steps]
            low += [0.0, *(-each for each in reach)]
            high += [LARGEST_SHARE, *reach]
        scale = np.ones(len(start))
        scale[2:4] = self._period_s
        scale[1] = np.exp(start[0]) * self._w[0]
        inside = np.clip(start, np.array(low) + 1e-9 * scale, np.array(high) - 1e-9)
        fit = least_squares(
            self._residual, inside, bounds=(low, high), x_scale=scale, args=(forms,)
        )
        return fit.x, 2.0 * float(fit.cost), np.asarray(fit.jac)

    def _residual(self, values: Array, forms: list[Effect]) -> Array:
        miss = np.log(self._modelled(values, forms) / self._plant) / self._errors
        return np.concatenate([miss.real, miss.imag])

    def _modelled(self, values: Array, forms: list[Effect]) -> ComplexArray:
        rigid = (float(np.exp(values[0])), *map(float, values[1:4]))
        shares, refined = zip(*self._parts(values, forms), strict=True) if forms else ((), ())
        columns = [_column(form, self._w) for form in refined]
        return _response(rigid, shares, columns, self._w, self._period_s)  # type: ignore[arg-type]

    def _parts(self, values: Array, forms: list[Effect]) -> Iterator[tuple[float, Effect]]:
        """Yield share and refined form of each part: options are logarithms over their trials'."""
        at = 4
        for form in forms:
            keys = list(form.steps(self._spans))
            options = form.options.model_dump()
            by = dict(zip(keys, np.exp(values[at + 1 : at + 1 + len(keys)]), strict=True))
            changed = {key: min(options[key] * float(f), 0.99 if "ratio" in key else np.inf)
                       for key, f in by.items()}  # fmt: skip
            yield float(values[at]), form.with_options(**changed)
            at += 1 + len(keys)

    def _most_telling(self, values: Array, forms: list[Effect]) -> tuple[Effect, float] | None:
        """Return the form that explains most of what is left, and its share; None: nothing."""
        ratio = self._modelled(values, forms) / self._plant
        theta1, theta2 = float(np.exp(values[0])), float(values[1])
        whole = sum(
            (theta1 * share * _column(form, self._w) for share, form in self._parts(values, forms)),
            stiff(theta1, theta2, self._w),
        )
        left = (ratio - 1.0) * whole / theta1
        weight = (theta1 / (np.abs(whole) * self._errors)) ** 2
        best: tuple[float, Effect, float] | None = None
        for effect in known_effects().values():
            if "resonance" not in effect.groups:
                continue
            for form in effect.trials(self._spans):
                column = form.over_acceleration(self._w)
                inside = form.lines and self._hz[0] < form.lines[0] < self._hz[-1]
                if column is None or not inside:
                    continue
                size = float(np.sum(weight * np.abs(column) ** 2))
                share = float(np.sum(weight * (column.conj() * left).real)) / size
                gain = share**2 * size
                if 0.0 < share < LARGEST_SHARE and (best is None or gain > best[0]):
                    best = gain, form, share
        return None if best is None else best[1:]

    def _depth_db(self, values: Array, forms: list[Effect]) -> float:
        """Return by how much the last part changes the response at its largest [dB]."""
        *before, (share, last) = self._parts(values, forms)
        line = last.lines[0]
        around = 2.0 * np.pi * line * np.linspace(0.5, 2.0, 2000)
        sprung = sum((s * _column(form, around) for s, form in before), 0.0j * around)
        ratio = (1.0 + sprung + share * _column(last, around)) / (1.0 + sprung)
        return float(20.0 * np.max(np.abs(np.log10(np.abs(ratio)))))

    def _told(self, values: Array, forms: list[Effect], jacobian: Array) -> FittedPlant:
        covariance = np.asarray(np.linalg.pinv(jacobian.T @ jacobian), np.float64)
        errors = np.sqrt(np.clip(np.diag(covariance), 0.0, np.inf))
        miss = np.log(np.abs(self._modelled(values, forms) / self._plant))
        parts, at = [], 4
        for form, (share, refined) in zip(forms, self._parts(values, forms), strict=True):
            keys, found = list(form.steps(self._spans)), refined.options.model_dump()
            own = errors[at + 1 : at + 1 + len(keys)]
            told = {key: found[key] * float(e) for key, e in zip(keys, own, strict=True)}
            parts.append(RingingPart(refined, share, told))
            at += 1 + len(keys)
        return FittedPlant(
            theta1=float(np.exp(values[0])),
            theta2=float(values[1]),
            delay_s=float(values[2]),
            lag_s=float(values[3]),
            errors=(float(np.exp(values[0]) * errors[0]), *errors[1:4].tolist()),
            delay_at_lag=_conditional(covariance[2:4, 2:4]),
            parts=tuple(sorted(parts, key=lambda part: part.resonance_hz)),
            error_db=float(20.0 / np.log(10.0) * np.sqrt(np.mean(miss**2))),
        )
