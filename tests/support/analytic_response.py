"""The response of a plant on paper: masses, springs, friction, lag, delay and hold, none of ours.

Written from the equation of motion alone; the sampled response is the sum over all aliases of the
continuous one behind a zero-order hold.
"""

import numpy as np

ALIASES = 40


def plant_response(
    frequency_hz, period_s, *, mass, viscous, delay_s=0.0, lag_s=0.0, gain=1.0, parts=()
):
    """Return position over command [m/V] at frequencies below half of the rate.

    parts: (inertia [V s^2/m], frequency [Hz], damping ratio) of what hangs on the carriage; `mass`
    is the whole. gain: the slope of the thrust where it works.
    """
    frequency_hz = np.asarray(frequency_hz, dtype=float)
    total = np.zeros(len(frequency_hz), complex)
    for k in range(-ALIASES, ALIASES + 1):
        s = 2j * np.pi * (frequency_hz + k / period_s)
        hold = (1.0 - np.exp(-s * period_s)) / s
        force_per_position = mass * s**2 + viscous * s
        for inertia, own_hz, zeta in parts:
            omega = 2.0 * np.pi * own_hz
            # The part follows its mount by (2 zeta omega s + omega^2)/(...), not by 1.
            follows = (2 * zeta * omega * s + omega**2) / (s**2 + 2 * zeta * omega * s + omega**2)
            force_per_position = force_per_position - inertia * s**2 * (1.0 - follows)
        delayed = np.exp(-s * delay_s) / (1.0 + lag_s * s)
        total += hold / period_s * gain * delayed / force_per_position
    return total


def apart(measured, true):
    """Return by how much a response is off: in dB, and in degrees."""
    ratio = measured / true
    return 20.0 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))
