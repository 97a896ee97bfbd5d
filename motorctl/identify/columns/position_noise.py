"""Noise of the measured position, and the band that it leaves to a fit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from motorctl.identify.columns.filters import low_pass, velocity_of, zero_phase
from motorctl.identify.columns.measured import Measured

Array = NDArray[np.float64]

WIDEST_BAND_HZ = 100.0
"""Widest band of a fit [Hz]. Above it lie flexible modes and the amplifier's lag, which no declared
term describes: larger takes them into the parameters, smaller uses less of the motion. Chosen by
hand."""
BAND_PER_RATE = 0.1
"""The band of a fit ends at the latest at this part of the sample rate. Larger brings the encoder's
noise and the filters' edges in, smaller wastes samples. Chosen by hand."""
NARROWEST_PART = 0.1
"""The band is never narrower than this part of the widest. Larger keeps noise that biases, smaller
may leave no motion in the band. Chosen by hand."""
NOISE_PER_ACCELERATION = 0.01
"""Noise of the acceleration over the acceleration itself, both rms, that the band may let in. More
than this biases the estimate through the feedback, less narrows the band. Chosen by hand."""
VELOCITY_BAND_PER_RATE = 0.2
"""The velocity's band ends at the latest at this part of the sample rate. Larger adds the encoder's
noise, smaller rounds off reversals. Chosen by hand."""
NOISE_PER_TURNOVER = 0.1
"""Velocity noise that is let in, in multiples of the speed at which Sf turns over. Larger blurs the
sign of friction near rest, smaller delays it through a narrower band. Chosen by hand."""
NO_MORE_THAN_NOISE = 1.5
"""Rms difference of the reference's velocity from the measured one, over the noise's, up to which
noise explains it. Larger overlooks a following error, smaller sees one in noise. Chosen by hand."""
SAMPLES_PER_BAND = 2.5
"""Sample rate after decimation, in multiples of the band. Below 2 the band aliases (Nyquist);
larger costs time without telling more. The 0.5 beyond 2 is room for the filter's edge: chosen by
hand."""
SHORTEST_STRETCH = 64
"""Fewest samples without a gap that are looked at. Smaller leaves the filters' ends more than what
lies between them, larger leaves nothing of recordings with many gaps. Chosen by hand."""
SPECTRUM_WINDOW = 1024
"""Samples of a window of the spectrum that tells the noise, at most. Longer leaves few windows to
average over, shorter lets motion leak into the upper part of the spectrum. Chosen by hand."""
NOISE_FROM, NOISE_TO = 0.3, 0.45
"""Part of the spectrum in which noise is told, in multiples of the sample rate. A first one that is
smaller takes motion for noise; nearer to each other they leave few lines to take the median of.
Chosen by hand, clear of the spectrum's end at 0.5."""
FILTER_ORDER = 4
"""Order of the Butterworth filter that limits a band, each way. Larger rings longer at the ends of
a stretch, smaller lets noise beyond the band in. Chosen by hand."""
EDGE_SAMPLES = 20
"""Samples at either end of a filtered stretch that are not counted, whatever the band. More leaves
little of short stretches, fewer counts what the filter makes of the ends. Chosen by hand."""
NARROWER = 0.8
"""Factor from one band that is tried to the next. Nearer to 1 takes time, smaller gives more of the
band away than noise asks for. Chosen by hand."""
TOP_PERCENT = 99.0
"""Percentile of the speeds that is the top speed. Nearer to 100 lets single samples set it, smaller
calls less than the machine's speed so. Chosen by hand: one sample in a hundred is faster."""


def position_noise_density(data: Measured) -> float:
    """Estimate the one-sided density of white position noise [unit^2/Hz].

    Taken from the upper part of the spectrum of second differences, where motion has no power.
    """
    densities = []
    for stretch in data.stretches(SHORTEST_STRETCH):
        curvature = np.diff(data.position[stretch], 2)
        window = min(SPECTRUM_WINDOW, len(curvature))
        f, power = signal.welch(curvature, data.sample_rate_hz, nperseg=window)
        upper = (f > NOISE_FROM * data.sample_rate_hz) & (f < NOISE_TO * data.sample_rate_hz)
        gain = (2.0 * np.sin(np.pi * f[upper] / data.sample_rate_hz)) ** 4
        densities.append((len(curvature), float(np.median(power[upper] / gain))))
    if not densities:
        return 0.0
    weights, values = np.array(densities).T
    return float(np.average(values, weights=weights))


def position_noise_rms(density: float, sample_rate_hz: float) -> float:
    """Return the noise of one measured position, white up to half the sample rate [unit]."""
    return float(np.sqrt(0.5 * density * sample_rate_hz))


def acceleration_noise_rms(density: float, cutoff_hz: float) -> float:
    """Return the noise that white position noise leaves in the acceleration below `cutoff_hz`.

    The square root of the integral of (2 pi f)^4 times the density [unit/s^2].
    """
    return float(np.sqrt(density * (2.0 * np.pi) ** 4 * cutoff_hz**5 / 5.0))


def velocity_noise_rms(density: float, cutoff_hz: float) -> float:
    """Return the noise that it leaves in the velocity below `cutoff_hz` [unit/s]."""
    return float(np.sqrt(density * (2.0 * np.pi) ** 2 * cutoff_hz**3 / 3.0))


def velocity_band_hz(density: float, noise: float) -> float:
    """Return the band in which it leaves so much noise in the velocity [Hz]; not for density 0."""
    return float(np.cbrt(3.0 * noise**2 / (density * (2.0 * np.pi) ** 2)))


def choose_band_hz(data: Measured) -> float:
    """Return the widest band in which noise stays small beside the acceleration."""
    widest = min(WIDEST_BAND_HZ, BAND_PER_RATE * data.sample_rate_hz)
    density = position_noise_density(data)
    band = widest
    while band > NARROWEST_PART * widest:
        noise = acceleration_noise_rms(density, band)
        if noise <= NOISE_PER_ACCELERATION * _acceleration_rms(data, band):
            return band
        band *= NARROWER
    return NARROWEST_PART * widest


def choose_velocity_band_hz(data: Measured, band_hz: float, slope_s_m: float) -> float:
    """Return the widest band in which velocity noise stays small beside 1/slope.

    At least `band_hz`, which is also the answer for a sign without slope.
    """
    density = position_noise_density(data)
    widest = VELOCITY_BAND_PER_RATE * data.sample_rate_hz
    if slope_s_m == 0.0 or not np.isfinite(slope_s_m):
        return band_hz
    noise = NOISE_PER_TURNOVER / slope_s_m
    allowed = widest
    if density > 0.0:
        allowed = velocity_band_hz(density, noise)
    return max(band_hz, min(allowed, widest))


def reference_is_quieter(data: Measured, band_hz: float) -> bool:
    """Return whether the reference's velocity differs from the measured one by noise alone."""
    desired = data.desired_velocity
    if desired is None or not np.all(np.isfinite(desired[data.usable])):
        return False
    total, count = 0.0, 0
    for stretch, velocity in _velocities(data, band_hz):
        difference = (velocity - desired[stretch])[EDGE_SAMPLES:-EDGE_SAMPLES]
        total += float(difference @ difference)
        count += len(difference)
    noise = velocity_noise_rms(position_noise_density(data), band_hz)
    return bool(np.sqrt(total / max(count, 1)) < NO_MORE_THAN_NOISE * noise)


def top_speed(data: Measured, band_hz: float) -> float:
    """Return the speed that one sample in a hundred exceeds."""
    speeds = [np.abs(velocity) for _, velocity in _velocities(data, band_hz)]
    return float(np.percentile(np.concatenate(speeds), TOP_PERCENT)) if speeds else 0.0


def _velocities(data: Measured, band_hz: float) -> Iterator[tuple[slice, Array]]:
    sections = low_pass("butterworth", FILTER_ORDER, band_hz, data.sample_rate_hz)
    for stretch in data.stretches(SHORTEST_STRETCH):
        velocity = velocity_of(data.position[stretch], data.period_s)
        yield stretch, zero_phase(sections, FILTER_ORDER, velocity)


def choose_decimation(sample_rate_hz: float, band_hz: float) -> int:
    """Return the factor that keeps the band just below the new Nyquist frequency."""
    return max(1, int(sample_rate_hz / (SAMPLES_PER_BAND * band_hz)))


def _acceleration_rms(data: Measured, band_hz: float) -> float:
    sections = low_pass("butterworth", FILTER_ORDER, band_hz, data.sample_rate_hz)
    total, count = 0.0, 0
    for stretch in data.stretches(SHORTEST_STRETCH):
        filtered = zero_phase(sections, FILTER_ORDER, data.position[stretch])
        curvature = np.diff(filtered, 2)[EDGE_SAMPLES:-EDGE_SAMPLES] * data.sample_rate_hz**2
        total += float(curvature @ curvature)
        count += len(curvature)
    return float(np.sqrt(total / max(count, 1)))
