"""From windows of an excited axis to its frequency response, with coherence and errors.

The excitation r is what nothing else in the loop depends on, so that it is the instrument: with the
command u = S r + ..., the error e = P S r + ..., averaged over the windows,

    S = <u r*>/<r r*>,    P = <e r*>/<u r*>,    T = 1 - S,    L = C P = (1 - S)/S

No disturbance and no noise is in step with r, however the feedback passes them on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import get_window

from motorctl.errors import DataError
from motorctl.response.windows import Windows

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

COHERENT = 0.9
"""Coherence from which a line counts. Higher throws away what is known well enough over many
periods, lower shows noise. Convention."""
KNOWN = 0.026
"""Standard error of the plant, relative, up to which a line counts. Larger lets lines of few noisy
windows count that are off by more than is promised, smaller leaves out good ones. Arithmetic: half
of 3 degrees, which are less than 0.5 dB, so that 95 % of the lines keep both."""
LEAST_LINES = 8
"""Fewer coherent lines are no response."""
NOT_EXCITED = 1e-6
"""Of the largest line, below which one is not excited. Any between rounding and a line would do."""
OVERLAP = 1.0 + 2.0 / 6.0
"""By how much windows that overlap by half tell less than as many apart: von Hann's are correlated
by a sixth with each neighbour. Arithmetic."""


@dataclass(frozen=True)
class Response:
    """An axis' response at the lines of its excitation, (n,) each."""

    axis: str
    source: str
    period_s: float
    """Of the axis [s]."""
    frequency_hz: Array
    plant: ComplexArray
    """P, from the command to the position [m/V]."""
    sensitivity: ComplexArray
    """S, from what disturbs the command to the command."""
    plant_error: Array
    """Standard error of P, relative: of its size, and of its phase in radians. From the scatter of
    the windows, and from what came back at lines that were left out."""
    sensitivity_error: Array
    """Standard error of S, absolute, of each of its parts."""
    coherence: Array
    """The smaller one of the excitation with the position and with the command, from 0 to 1."""
    not_linear_v: Array
    """(m,) what came back at lines that were left out, as a command at the plant's input [V]."""
    not_linear_hz: Array
    """(m,) these lines [Hz]."""
    line_v: float
    """Size of an excited line [V]."""
    windows: int
    """Over which it is averaged."""
    speed_m_s: float
    """At which the axis moved meanwhile; 0: it stood."""

    @property
    def loop(self) -> ComplexArray:
        """L, the open loop."""
        result: ComplexArray = 1.0 / self.sensitivity - 1.0
        return result

    @property
    def complementary(self) -> ComplexArray:
        """T = 1 - S."""
        result: ComplexArray = 1.0 - self.sensitivity
        return result

    @property
    def coherent(self) -> NDArray[np.bool_]:
        """Which lines count."""
        known = self.plant_error <= KNOWN
        result: NDArray[np.bool_] = (self.coherence >= COHERENT) & known
        return result


def estimate_response(windows: Windows, axis: str, source: str) -> Response:
    """Return the response that windows of an excited axis tell.

    Parameters
    ----------
    windows
        Of `excited_windows`.
    axis, source
        What it is called, and where it is from, for messages.

    Raises
    ------
    DataError
        Where the excitation has no lines.
    """
    n = windows.ticks
    taper = get_window("hann", n)
    scale = 2.0 / taper.sum()

    def spectra(values: Array) -> ComplexArray:
        level = values - values.mean(axis=1, keepdims=True)
        result: ComplexArray = np.fft.rfft(level * taper, axis=1) * scale
        return result

    r, u, e = (spectra(x) for x in (windows.excitation, windows.command, windows.error))
    size = np.abs(np.fft.rfft(windows.excitation[0])) * 2.0 / n
    lines = np.flatnonzero(size > NOT_EXCITED * size.max(initial=1e-300))
    lines = lines[(lines > 1) & (lines < len(size) - 1)]
    if len(lines) < 2:
        raise DataError(f"{source}: axis {axis}: its excitation has no lines")
    unit = r[:, lines] / np.abs(r[:, lines])
    # In step with the excitation, over its size: the same in each window but for noise.
    pulled = {key: x[:, lines] / unit / np.abs(r[:, lines]) for key, x in (("u", u), ("e", e))}
    by_u, by_e = pulled["u"].mean(axis=0), pulled["e"].mean(axis=0)
    plant = by_e / by_u
    independent = max(len(r) / OVERLAP - 1.0, 1.0)

    def spread(values: ComplexArray) -> Array:
        result: Array = np.mean(np.abs(values - values.mean(axis=0)) ** 2, axis=0)
        return result

    off = pulled["e"] - plant * pulled["u"]
    coherence = np.minimum(
        *(
            np.abs(mean) ** 2 / (np.abs(mean) ** 2 + spread(pulled[key]))
            for key, mean in (("u", by_u), ("e", by_e))
        )
    )
    base_hz = 1.0 / (n * windows.period_s)
    frequency_hz: Array = base_hz * lines.astype(np.float64)
    out, line_v = _left_out(lines), float(np.median(size[lines]))
    turned = np.exp(-2j * np.pi * _shifts(windows.excitation)[:, None] * out / n)
    back_u, back_e = (np.abs((x[:, out] * turned).mean(axis=0)) / line_v for x in (u, e))
    in_plant = back_e / np.interp(out, lines, np.abs(by_e))
    plant_noise = np.sqrt(np.mean(np.abs(off) ** 2, axis=0) / independent / 2.0) / np.abs(by_e)
    command_noise = np.sqrt(spread(pulled["u"]) / independent / 2.0)
    return Response(
        axis=axis,
        source=source,
        period_s=windows.period_s,
        frequency_hz=frequency_hz,
        plant=plant,
        sensitivity=by_u,
        plant_error=np.hypot(plant_noise, _beside(lines, out, in_plant)),
        sensitivity_error=np.hypot(command_noise, _beside(lines, out, back_u)),
        coherence=coherence,
        not_linear_v=in_plant * line_v,
        not_linear_hz=base_hz * out.astype(np.float64),
        line_v=line_v,
        windows=len(r),
        speed_m_s=windows.speed_m_s,
    )


def require_coherence(response: Response, limit_v: float, peak_v: float) -> None:
    """Insist that enough lines are coherent; say what would make them so.

    Parameters
    ----------
    response
        The response.
    limit_v
        Most that an excitation of the axis may have [V].
    peak_v
        What this one had [V].

    Raises
    ------
    DataError
        Where fewer than `LEAST_LINES` lines are.
    """
    good = response.coherent
    if np.count_nonzero(good) >= LEAST_LINES:
        return
    noise = 1.0 / np.clip(response.coherence, 1e-6, 1.0) - 1.0
    wanted_v = peak_v * float(np.sqrt(np.median(noise) * COHERENT / (1.0 - COHERENT)))
    low, high = response.frequency_hz[0], response.frequency_hz[-1]
    more = (
        f"--amplitude {wanted_v:.2g} would do for half of them (limit {limit_v:.3g} V)"
        if peak_v < wanted_v <= limit_v
        else f"the amplitude was {peak_v:.3g} V of {limit_v:.3g} V that "
        "limits.max_excitation_share allows: raise it as far as the machine bears, or ask for a "
        "band in which it moves more"
    )
    raise DataError(
        f"{response.source}: axis {response.axis}: only {np.count_nonzero(good)} of {len(good)} "
        f"lines from {low:.3g} to {high:.3g} Hz have a coherence of {COHERENT:g} (median "
        f"{np.median(response.coherence):.2g}), needs {LEAST_LINES}: {more}"
    )


def _shifts(excitation: Array) -> Array:
    """Return by how many rows each window's excitation is ahead of the first one's."""
    spectrum = np.fft.rfft(excitation, axis=1)
    n = excitation.shape[1]
    alike = np.fft.irfft(spectrum[0].conj() * spectrum, n, axis=1)
    ahead = (-np.argmax(alike, axis=1)) % n
    result: Array = ahead.astype(np.float64)
    return result


def _beside(lines: NDArray[np.intp], out: NDArray[np.intp], back: Array) -> Array:
    """Return what comes back at lines that were left out, at the lines beside: rms of each part."""
    if not len(out):
        return np.zeros(len(lines))
    smooth = np.convolve(np.pad(back**2, 1, mode="edge"), np.full(3, 1.0 / 3.0), mode="valid")
    result: Array = np.sqrt(np.interp(lines, out, smooth) / 2.0)
    return result


def _left_out(lines: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the odd harmonics between the lines that are none of them."""
    odd = np.arange(lines[0] | 1, lines[-1], 2)
    return np.setdiff1d(odd, lines)
