"""A measured response as a picture: Bode, Nyquist, sensitivities, coherence; the model beside."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import UsageError
from motorctl.picture_style import COLOURS, STYLE, save
from motorctl.response.estimate import COHERENT
from motorctl.response.measurement import Measurement

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

MODEL, MEASURED, FITTED, COMPLEMENTARY = COLOURS[:4]
SIZE_INCHES = (10.0, 8.4)
"""Width and height of the picture [inch]; only looks depend on it."""
ERRORS = 2.0
"""Standard errors that a band is wide to each side. Convention: 95 %."""
REACH = 2.5
"""Of the Nyquist picture from -1 [1]; only looks depend on it."""
POINTS = 1500
"""Of the fitted curve; only looks depend on it."""
FAINT = 0.25
"""Opacity of lines that are not coherent; only looks depend on it."""
LEGEND: dict[str, Any] = {"frameon": False, "fontsize": 8}


def draw_response(measurement: Measurement, path: Path) -> Path:
    """Draw a measured response into a PNG file and return it.

    Raises UsageError where it cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=SIZE_INCHES, layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplot_mosaic(
            [["size", "nyquist"], ["phase", "nyquist"], ["coherence", "sensitivity"]],
            height_ratios=[1.2, 1.0, 1.0],
        )
        _draw_plant(panels["size"], panels["phase"], measurement)
        _draw_coherence(panels["coherence"], measurement)
        _draw_nyquist(panels["nyquist"], measurement)
        _draw_sensitivities(panels["sensitivity"], measurement)
        response = measurement.response
        words = measurement.machine.axes[response.axis].units.words
        how = words(f"at {response.speed_m_s * 1e3:.3g} mm/s") if response.speed_m_s else "at rest"
        figure.suptitle(
            f"Response of axis {response.axis}, measured {how}, {response.windows} windows",
            x=0.01,
            ha="left",
        )
        try:
            save(figure, path)
        except OSError as error:
            raise UsageError(f"{path}: cannot be written: {error.strerror}") from error
    return path


def _db(values: ComplexArray) -> Array:
    result: Array = 20.0 * np.log10(np.abs(values))
    return result


def _draw_plant(size: Axes, phase: Axes, measurement: Measurement) -> None:
    response, good = measurement.response, measurement.response.coherent
    hz, plant = response.frequency_hz, response.plant
    dense_hz = np.geomspace(hz[0], hz[-1], POINTS)
    dense = measurement.fitted.response(dense_hz, response.period_s)
    band_db = 20.0 * np.log10(1.0 + np.minimum(ERRORS * response.plant_error, 10.0))
    size.fill_between(hz[good], (_db(plant) - band_db)[good], (_db(plant) + band_db)[good],
                      color=MEASURED, alpha=FAINT, lw=0.0)  # fmt: skip
    size.plot(hz[~good], _db(plant)[~good], ".", color=MEASURED, alpha=FAINT, ms=4)
    size.plot(hz[good], _db(plant)[good], ".", color=MEASURED, ms=4, label="measured")
    size.plot(hz, _db(measurement.model.plant), color=MODEL, lw=1.2, label="configured model")
    size.plot(dense_hz, _db(dense), color=FITTED, lw=1.0, ls="--", label="fitted to it")
    units = measurement.machine.axes[measurement.response.axis].units
    size.set_ylabel(units.words("|P|, command to\nposition [dB re 1 m/V]"))
    size.legend(loc="upper right", **LEGEND)
    for part in measurement.fitted.parts:
        size.axvline(part.resonance_hz, color="black", lw=0.7, ls=":")
    turn = np.unwrap(np.angle(dense))
    turn -= 2.0 * np.pi * np.round((turn[0] + np.pi) / (2.0 * np.pi))  # a mass lags by half a turn
    phase.plot(dense_hz, np.degrees(turn), "--", color=FITTED, lw=1.0)
    # On the same turn as the fit, line by line: an unwrapped phase of noise goes anywhere.
    near = np.interp(hz, dense_hz, turn)
    modelled, degrees = (
        np.degrees(near + np.angle(values / np.exp(1j * near)))
        for values in (measurement.model.plant, plant)
    )
    phase.plot(hz, modelled, color=MODEL, lw=1.2)
    phase.plot(hz[~good], degrees[~good], ".", color=MEASURED, alpha=FAINT, ms=4)
    phase.plot(hz[good], degrees[good], ".", color=MEASURED, ms=4)
    phase.set_ylabel("phase of P [degrees]")
    for panel in (size, phase):
        _over_frequency(panel, hz)


def _over_frequency(panel: Axes, hz: Array) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

    panel.set_xscale("log")
    panel.set_xlim(float(hz[0]), float(hz[-1]))
    panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    panel.xaxis.set_major_formatter(ScalarFormatter())
    panel.xaxis.set_minor_formatter(NullFormatter())


def _draw_coherence(panel: Axes, measurement: Measurement) -> None:
    response = measurement.response
    panel.plot(response.frequency_hz, response.coherence, ".", color=MEASURED, ms=4)
    panel.axhline(COHERENT, color="black", lw=0.8, ls="--")
    _over_frequency(panel, response.frequency_hz)
    panel.set_ylim(0.0, 1.02)
    panel.set_xlabel("frequency [Hz]")
    panel.set_ylabel(f"coherence\n(dashed: {COHERENT:g})")


def _draw_nyquist(panel: Axes, measurement: Measurement) -> None:
    response, good = measurement.response, measurement.response.coherent
    loop, model = response.loop[good], measurement.model.loop
    circle = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 400))
    panel.plot(circle.real, circle.imag, color="black", lw=0.6, ls=":")
    near = circle / measurement.margins.largest_sensitivity - 1.0
    panel.plot(near.real, near.imag, color=MEASURED, lw=0.8, ls="--",
               label=f"|S| = {measurement.margins.largest_sensitivity:.2f}")  # fmt: skip
    panel.plot(model.real, model.imag, color=MODEL, lw=1.2, label="configured model")
    fitted = measurement.fitted_loop[1]
    panel.plot(fitted.real, fitted.imag, color=FITTED, lw=1.0, ls="--", label="fitted to it")
    panel.plot(loop.real, loop.imag, ".", color=MEASURED, ms=4, label="measured")
    panel.plot([-1.0], [0.0], "+", color="black", ms=9)
    panel.set_aspect("equal")
    panel.set_xlim(-1.0 - REACH, -1.0 + REACH)
    panel.set_ylim(-REACH, REACH)
    panel.set_xlabel("real part of L")
    panel.set_ylabel("imaginary part of L")
    panel.legend(loc="upper left", **LEGEND)


def _draw_sensitivities(panel: Axes, measurement: Measurement) -> None:
    response, good = measurement.response, measurement.response.coherent
    hz = response.frequency_hz
    model = measurement.model.sensitivity
    for values, modelled, colour, name in (
        (response.sensitivity, model, MEASURED, "|S|"),
        (response.complementary, 1.0 - model, COMPLEMENTARY, "|T|"),
    ):
        sizes = np.abs(values)[good]
        band = ERRORS * response.sensitivity_error[good]
        low = np.maximum(sizes - band, 1e-9)
        panel.fill_between(hz[good], low, sizes + band, color=colour, alpha=FAINT, lw=0.0)
        panel.plot(hz[good], sizes, ".", color=colour, ms=4, label=f"{name} measured")
        panel.plot(hz, np.abs(modelled), color=colour, lw=1.0, label=f"{name} of the model")
    panel.axhline(1.0, color="black", lw=0.7)
    panel.set_yscale("log")
    _over_frequency(panel, hz)
    panel.set_xlabel("frequency [Hz]")
    panel.set_ylabel("sensitivities")
    panel.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, **LEGEND)
