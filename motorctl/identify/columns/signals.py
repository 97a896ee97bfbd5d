"""Signals of one axis as the diagnosis sees them: every column through one filter, rows in step.

Nonlinear terms are formed first, then one linear zero-phase filter goes over every column alike.
Its gain falls where the position's quantisation drowns the acceleration (see `whitening`), so the
rows' noise is nearly white. Columns are formed at the recording's full rate, or, where many forms
are tried, from smoothed signals at the rate of the rows, which is quicker and nearly the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from motorctl.errors import DataError
from motorctl.identify.columns.at_rest import COUNTS_PER_PERIOD, REST_RANGE, REST_S, at_rest
from motorctl.identify.columns.command_timing import AT_ONCE, CommandPath, held_parts
from motorctl.identify.columns.filters import second_difference
from motorctl.identify.columns.kept_spectra import KeptSpectra, Spectra, Spectrum
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.position_noise import (
    position_noise_density,
    position_noise_rms,
    velocity_noise_rms,
)
from motorctl.identify.columns.repetition import period_of
from motorctl.identify.columns.rows import Rows
from motorctl.identify.columns.stretches import (
    TRIM_PERIODS,
    Stretch,
    make_stretch,
    quiet_band_hz,
    quiet_velocity,
    smoothed,
)
from motorctl.model import Effect
from motorctl.model.columns import form_key, uses_acceleration

Array = NDArray[np.float64]
Response = Callable[[Array], Array]
"""Gain of a zero-phase filter at frequencies [Hz]."""

WIDEST_BAND_HZ = 200.0
"""Widest band of the rows [Hz]. Larger shows stiffer modes but also more of the encoder's noise,
and takes time. Chosen by hand."""
BAND_PER_RATE = 0.2
"""The band ends at the latest at this part of the sample rate. Larger leaves the filter no room
below the Nyquist frequency (0.5), smaller wastes samples. Chosen by hand."""
EDGE = 1.25
"""The filter's gain falls to zero between the band's end and this many times it. Nearer to 1 rings
longer, so more rows are dropped at the ends; larger asks for a higher row rate. Chosen by hand."""
ROWS_PER_BAND = 3.0
"""Row rate in multiples of the band. Below 2 EDGE = 2.5 the edge aliases (Nyquist); larger repeats
what neighbouring rows say and takes time. Arithmetic, with room chosen by hand."""
KEPT_FADES = 8
"""Fades that are kept: as many rates and bands are looked at in turn. More take memory, fewer are
formed anew with every column. Chosen by hand."""
FADES_FROM = 0.25
"""Part of the unused ends of a stretch that is left out wholly before it fades in. Larger fades in
more abruptly, smaller lets the ends' errors in. Chosen by hand."""
MOTION_PER_BAND = 6.0
"""Least rate at which columns of the motion are formed, in multiples of the band. Smaller lets
harmonics of friction's steps alias into the band, larger takes time. Chosen by hand."""
EVEN_FROM = 8
"""Decimation from which it is made even. Smaller adds rows, larger forms columns of the motion more
finely than is needed. Chosen by hand."""
STUCK_PERIODS = 0.5
"""Rows dropped on each side of where an axis sticks, in periods of the band's end. Larger loses the
reversal itself, smaller keeps what the filter smears out of it. Chosen by hand."""
SHORTEST_S = 0.3
"""Shortest stretch without a gap that is used [s]. Smaller leaves nothing after trimming, larger
loses recordings with many gaps. Chosen by hand."""
FEWEST_ROWS = 100
"""Fewest rows in motion with which diagnosis begins. Smaller names effects from next to nothing,
larger refuses short recordings. Chosen by hand."""
FAR_BEYOND_NOISE = 100.0
"""Way over what counts as rest behind the encoder's noise, from which an axis that hardly ever
moves did move at times. Larger calls short moves noise, smaller calls noise a move. Chosen by
hand: drift reaches ten times, the moves of axes that rest ten thousand."""
STANDS = 1e-3
"""Part of its way by which a position may change from row to row where it stands still. Larger
takes slow travel for rest, smaller what resampling leaves of rest for motion. Chosen by hand: a
hobby servo's count is twice as much."""
MOST_GAINS = 64
"""Filters kept ready, one for each length and path of the command. Larger takes memory, smaller
forms them again. Chosen by hand."""


@dataclass(frozen=True)
class Signals(Rows[Spectrum]):
    """The stretches of one axis, and the filter that makes m rows of them."""

    decimation: int
    band_hz: float
    response: Response
    kept: tuple[NDArray[np.bool_], ...]
    """For each stretch, which of its rows are used."""
    position_noise: float
    """One-sided density of the measured position's noise [unit^2/Hz]."""
    trim: int = 0
    """Rows at each end of a stretch that are never used."""
    repeats_s: float = 0.0
    """After what time the recording's one move begins again; 0 where it does not."""
    quiet_hz: float = math.inf
    """Band of the velocity that friction depends on [Hz]."""
    _gains: dict[tuple[int, CommandPath], NDArray[Any]] = field(default_factory=dict, repr=False)
    _quiet: dict[float, list[Array]] = field(default_factory=dict, repr=False)
    """The velocity that friction depends on, of each stretch, by its band [Hz]."""
    _spectra: KeptSpectra = field(default_factory=KeptSpectra, repr=False)

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return sum(map(len, self._used))

    @cached_property
    def _used(self) -> tuple[NDArray[np.intp], ...]:
        """For each stretch, the places of its rows: taking them is quicker than by `kept`."""
        return tuple(map(np.flatnonzero, self.kept))

    @property
    def position_noise_rms(self) -> float:
        """Noise of one measured position, rms, where it is white up to half the sample rate."""
        return position_noise_rms(self.position_noise, 1.0 / self.period_s)

    @property
    def row_period_s(self) -> float:
        """Time between rows."""
        return self.period_s * self.decimation

    @property
    def largest_command(self) -> float:
        """Largest command of all stretches, in either direction."""
        return max(float(np.abs(s.command).max()) for s in self.stretches)

    def with_response(self, response: Response) -> Signals:
        """Return the same signals behind another filter."""
        return replace(self, response=response, _gains={})

    def with_stretches(self, stretches: tuple[Stretch, ...]) -> Signals:
        """Return other stretches behind the same filter."""
        return replace(self, stretches=stretches, _gains={}, _quiet={}, _spectra=KeptSpectra())

    def turning_over(self, slope_s_m: float | None) -> Signals:
        """Return the same signals with the velocity on which a friction of this slope depends."""
        quiet_hz = quiet_band_hz(self.position_noise, self.band_hz, slope_s_m)
        if quiet_hz not in self._quiet:
            self._quiet[quiet_hz] = [
                quiet_velocity(s.position, quiet_hz, self.period_s) for s in self.stretches
            ]
        stretches = tuple(
            replace(s, quiet=quiet)
            for s, quiet in zip(self.stretches, self._quiet[quiet_hz], strict=True)
        )
        return replace(self, stretches=stretches, quiet_hz=quiet_hz)

    def picked(self, signal: Callable[[Stretch], Array]) -> Array:
        """Return an unfiltered signal at the rows, (m,)."""
        parts = [
            signal(stretch)[:: self.decimation][kept]
            for stretch, kept in zip(self.stretches, self.kept, strict=True)
        ]
        picked: Array = np.concatenate(parts)
        return picked

    @property
    def time_s(self) -> Array:
        """Time of the rows."""
        return self.picked(lambda s: s.time_s)

    def filtered(self, columns: Sequence[Array], formed_at: int = 1) -> Array:
        """Filter columns, one array of shape (p, N) for each stretch, into (p, m).

        formed_at is the decimation at which they were formed.
        """
        return self.rows_of(self.spectra(columns, formed_at))

    def spectra(self, columns: Sequence[Array], formed_at: int = 1) -> Spectra:
        """Return the spectra of columns up to the rate of the rows, unfiltered."""
        return tuple(self.formed(part, formed_at) for part in columns)

    def rows_of(self, formed: Iterable[Spectrum], undo: CommandPath = AT_ONCE) -> Array:
        """Filter columns given by their spectra into (p, m).

        undo is the path of the command that is taken back: what the command has to give so much
        earlier.
        """
        parts = (
            self._rows(each, used, undo) for each, used in zip(formed, self._used, strict=True)
        )
        return np.concatenate(list(parts), axis=1)

    def filtered_apart(
        self, columns: Iterable[Array], formed_at: int = 1, undo: CommandPath = AT_ONCE
    ) -> Iterator[Array]:
        """Yield filtered columns of one stretch after the other, (p, m_k), as by `rows_of`."""
        for part, used in zip(columns, self._used, strict=True):
            yield self._rows(self.formed(part, formed_at), used, undo)

    def _rows(self, formed: Spectrum, used: NDArray[np.intp], undo: CommandPath) -> Array:
        spectrum, rows = formed
        filtered = fft.irfft(spectrum * self._gain(rows, undo), rows, axis=1)
        return np.asarray(filtered.take(used, axis=1))

    @property
    def motion_step(self) -> int:
        """Decimation at which columns of the smoothed motion lose nothing in the band."""
        rate = 1.0 / (self.period_s * MOTION_PER_BAND * self.band_hz)
        return max(
            k
            for k in range(1, self.decimation + 1)
            if self.decimation % k == 0 and k <= max(rate, 1)
        )

    def acceleration(self) -> Array:
        """Return the filtered second difference of the measured position, (m,)."""
        return np.asarray(self.rows_of(self.acceleration_spectra())[0])

    def acceleration_spectra(self) -> Spectra:
        """Return the spectra of the second difference of the measured position."""
        return self.spectra(
            [second_difference(s.position, self.period_s)[None] for s in self.stretches]
        )

    def smoothed_acceleration(self, bands: float) -> list[Array]:
        """Return the measured acceleration of each stretch up to `bands` times the band, (N,)."""
        return [
            smoothed(
                second_difference(s.position, self.period_s), bands * self.band_hz, self.period_s
            )
            for s in self.stretches
        ]

    def state_spectra(
        self,
        effect: Effect,
        acceleration: Sequence[Array] | None = None,
        step: int | None = None,
        *,
        keep: bool = False,
    ) -> Spectra:
        """Return the spectra of the columns of a state effect, formed at `motion_step` by default.

        keep has them kept, for a form that will be asked for again.
        """
        d = self.motion_step if step is None else step

        def form() -> Spectra:
            return tuple(self.over(effect, acceleration, d))

        if not keep:
            return form()
        seen = acceleration if uses_acceleration(effect) else None
        return self._kept((form_key(effect), d), form, seen)

    def input(self, effect: Effect | None, path: CommandPath, *, keep: bool = False) -> Array:
        """Return the columns of an input effect at the rows, (p, m), or the command's, (1, m)."""

        def form() -> Spectra:
            columns = []
            for s in self.stretches:
                parts = held_parts(s.command, path, self.period_s)
                acting = [
                    (w, u[None] if effect is None else s.columns(effect, None, u)) for w, u in parts
                ]
                columns.append(np.asarray(sum(weight * column for weight, column in acting)))
            return self.spectra(columns)

        if not keep:
            return self.rows_of(form())
        return self.kept_rows((None if effect is None else form_key(effect), path), form)

    def measurement_spectra(self, effect: Effect, *, keep: bool = False) -> Spectra:
        """Return what an error of the measured position adds to its acceleration: the spectra.

        A column for each of the effect's amplitudes. They are formed on the smoothed position:
        functions of the quantised one correlate with its own noise.
        """

        def form() -> Spectra:
            columns = []
            for s in self.stretches:
                errors = s.columns(effect)
                columns.append(np.stack([second_difference(e, self.period_s) for e in errors]))
            return self.spectra(columns)

        return self._kept(form_key(effect), form) if keep else form()

    def kept_rows(self, key: Hashable, form: Callable[[], Spectra]) -> Array:
        """Return filtered columns, (p, m), whose spectra are kept under a key of their own."""
        return self.rows_of(self._kept(key, form))

    def _kept(
        self,
        key: Hashable,
        form: Callable[[], Spectra],
        acceleration: Sequence[Array] | None = None,
    ) -> Spectra:
        """Return spectra that are kept: behind any filter of this band, for this slope at rest."""
        return self._spectra.of((key, self.band_hz, self.quiet_hz), form, acceleration)

    def row_variance(self, force_noise: float) -> float:
        """Return the variance of the rows' noise where the filter whitens noise of this density."""
        frequency = np.linspace(0.0, EDGE * self.band_hz, 400)
        passed = low_pass_response(self.band_hz)(frequency) ** 2
        return float(force_noise * np.trapezoid(passed, frequency))

    def noise_variance(self, force_noise: float) -> float:
        """Return the variance of rows behind the plain low pass of this band."""
        frequency = np.linspace(0.0, EDGE * self.band_hz, 400)
        passed = low_pass_response(self.band_hz)(frequency) ** 2
        density = force_noise + (2.0 * np.pi * frequency) ** 4 * self.position_noise
        return float(np.trapezoid(density * passed, frequency))

    def plain(self, band_hz: float) -> Signals:
        """Return the same rows behind a plain low pass, for errors that people compare."""
        band = min(band_hz, self.band_hz)
        return replace(self, response=low_pass_response(band), band_hz=band, _gains={})

    def formed(self, columns: Array, step: int = 1) -> Spectrum:
        """Return the spectrum of columns of one stretch up to the rate of the rows, unfiltered."""
        n, every = columns.shape[1], self.decimation // step
        margin = 2 * math.ceil(TRIM_PERIODS / self.band_hz / self.row_period_s)
        rows = fft.next_fast_len(-(-n // every) + margin, real=True)
        padded = np.zeros((columns.shape[0], rows * every))
        padded[:, :n] = columns
        fades = _fading_in(self.trim * every)[:n]
        padded[:, : len(fades)] *= fades
        padded[:, n - len(fades) : n] *= fades[::-1]
        return fft.rfft(padded, axis=1)[:, : rows // 2 + 1] * (1.0 / every), rows

    def _gain(self, rows: int, undo: CommandPath) -> NDArray[Any]:
        key = rows, undo
        if key not in self._gains:
            frequency = np.arange(rows // 2 + 1) / (rows * self.row_period_s)
            if len(self._gains) > MOST_GAINS:
                self._gains.clear()
            gain = self.response(frequency)
            self._gains[key] = gain if undo == AT_ONCE else gain * undo.undone(frequency)
        return self._gains[key]


@lru_cache(maxsize=KEPT_FADES)
def _fading_in(samples: int) -> Array:
    """Return what fades a stretch in, and out, over the ends that no row uses, (samples,).

    Smoothed signals are wrong at the ends, and a whitening filter would carry that far inside.
    Every column fades alike, so the equation between them holds all the same.
    """
    inside = np.arange(samples) / max(samples, 1)
    place = np.clip((inside - FADES_FROM) / (1.0 - FADES_FROM), 0.0, 1.0)
    return np.asarray(0.5 * (1.0 - np.cos(np.pi * place)))


def low_pass_response(band_hz: float) -> Response:
    """Return a gain of one up to the band's end that falls to zero like a raised cosine."""

    def response(frequency: Array) -> Array:
        place = np.clip((frequency / band_hz - 1.0) / (EDGE - 1.0), 0.0, 1.0)
        return np.asarray(0.5 * (1.0 + np.cos(np.pi * place)))

    return response


def _stands_still(data: Measured) -> bool:
    """Return whether a position stands still in most rows, so that what moves it is no noise.

    Where rows come slowly, a move of a few rows counts as noise.
    """
    used = data.position[data.usable]
    return bool(np.median(np.abs(np.diff(used))) < STANDS * np.ptp(used))


def make_signals(
    data: Measured,
    band_hz: float | None = None,
    slope_s_m: float | None = None,
) -> Signals:
    """Cut a recording into stretches and smooth its position.

    Parameters
    ----------
    data
        What was measured of the axis.
    band_hz
        Band of the rows [Hz]; by default the widest that the sample rate carries.
    slope_s_m
        Slope of the declared friction at rest [s/m]: the velocity that friction depends on is
        smoothed until its noise is small beside 1/slope.

    Returns
    -------
    Signals
        The stretches, and which of their rows are used.

    Raises
    ------
    DataError
        No stretch is long enough, or there is nothing but noise.
    """
    rate = data.sample_rate_hz
    band = band_hz or min(WIDEST_BAND_HZ, BAND_PER_RATE * rate)
    decimation = max(1, int(rate / (ROWS_PER_BAND * band)))
    if decimation >= EVEN_FROM:  # columns of the motion are formed at each half row
        decimation -= decimation % 2
    trim = math.ceil(TRIM_PERIODS / band * rate / decimation)
    shortest = max(int(SHORTEST_S * rate), (2 * trim + 20) * decimation)
    density = position_noise_density(data)
    noise = velocity_noise_rms(density, band)
    rms = position_noise_rms(density, rate)
    slowest = COUNTS_PER_PERIOD * band * (data.resolution or 0.0)
    quiet_hz = quiet_band_hz(density, band, slope_s_m)
    stretches, kept, enough, everywhere = [], [], 0, 0
    row_s = decimation * data.period_s
    for rows in data.stretches(shortest):
        stretch = make_stretch(data, rows, min(2.0 * band, 0.45 * rate), quiet_hz)
        stretches.append(stretch)
        used = np.zeros(-(-len(stretch.x) // decimation), dtype=np.bool_)
        used[trim : len(used) - trim] = True
        enough += int(used.sum())
        moves = ~at_rest(stretch, row_s, decimation, noise, rms, STUCK_PERIODS / band, slowest)
        everywhere += int(moves.sum())
        kept.append(used & moves)
    moving = sum(int(k.sum()) for k in kept)
    if enough >= FEWEST_ROWS and moving < FEWEST_ROWS:
        moved = float(np.ptp(data.position[data.usable]))
        if moved > FAR_BEYOND_NOISE * REST_RANGE * rms or _stands_still(data):
            if everywhere >= max(FEWEST_ROWS, 2 * moving):
                end_s = trim * decimation / rate
                raise DataError(
                    f"{data.place}: too little motion: of {everywhere} rows in motion below "
                    f"{band:.3g} Hz all but {moving} lie within {end_s:.2g} s of where a stretch "
                    "without a gap begins or ends, which smoothing needs, and at least "
                    f"{FEWEST_ROWS} are needed: record from before a move until after it"
                )
            part = 100.0 * (1.0 - everywhere / sum(len(used) for used in kept))
            raise DataError(
                f"{data.place}: too little motion: it moves over {moved:.3g} {data.position_unit}, "
                f"but rests {part:.0f} % of the time: in motion are {moving} of {enough} rows "
                f"below {band:.3g} Hz, and at least {FEWEST_ROWS} are needed: record a longer "
                "motion, or shorter rests"
            )
        raise DataError(
            f"{data.place}: only noise: the position hardly ever moves by more than "
            f"{REST_RANGE * rms:.3g} {data.position_unit} in {REST_S:g} s, as its own noise does: "
            "record a larger or faster motion"
        )
    if enough < FEWEST_ROWS:
        longest = max((rows.stop - rows.start for rows in data.stretches(1)), default=0)
        whole_s = sum(rows.stop - rows.start for rows in data.stretches(shortest)) / rate
        raise DataError(
            f"{data.place}: no stretch of moving samples reaches {shortest / rate:.3g} s without "
            f"a gap, the longest lasts {longest / rate:.3g} s: record a longer motion"
            if longest < shortest
            else f"{data.place}: stretches without a gap that are long enough, {whole_s:.3g} s, "
            f"leave {enough} rows below {band:.3g} Hz, as smoothing takes "
            f"{2.0 * trim * row_s:.2g} s of each, and at least "
            f"{FEWEST_ROWS} are needed: record a longer motion, or fewer gaps"
        )
    return Signals(
        data=data,
        decimation=decimation,
        band_hz=band,
        response=low_pass_response(band),
        stretches=tuple(stretches),
        kept=tuple(kept),
        position_noise=density,
        trim=trim,
        repeats_s=period_of(max((s.v for s in stretches), key=len), data.period_s),
        quiet_hz=quiet_hz,
    )
