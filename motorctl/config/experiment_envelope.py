"""Whether a motion stays within what experiments may do where nobody is asked."""

from __future__ import annotations

from collections.abc import Iterator

from motorctl.config.machine import Axis
from motorctl.motion import Peaks

MIDDLE = 0.25
"""The part of the travel at either end that is none of an experiment's where no other is written.
Convention: the middle half is left."""

ROUNDED = 1e-6
"""A motion that is made to reach a limit may exceed it by this part, as numbers are rounded."""


def allowed_travel_m(axis: Axis) -> tuple[float, float]:
    """Return within which an axis stays in experiments that nobody is asked about [m]."""
    low, high = axis.limits.travel_m
    own = axis.experiments.travel_m if axis.experiments else None
    return own or (low + MIDDLE * (high - low), high - MIDDLE * (high - low))


def beyond_envelope(axis: Axis, peaks: Peaks, minutes: float) -> Iterator[str]:
    """Yield what of a motion is beyond the envelope of its axis.

    Parameters
    ----------
    axis
        The axis.
    peaks
        Of the motion.
    minutes
        That all motions of the session last, this one included.

    Yields
    ------
    str
        A sentence with the key, the value and the limit.
    """
    if axis.experiments is None:
        yield f"axes.{axis.name}.experiments is not in the configuration"
        return
    own, limits, where = axis.experiments, axis.limits, f"axes.{axis.name}.experiments"
    low, high = allowed_travel_m(axis)
    spare_m = ROUNDED * (high - low)
    if peaks.range_m[0] < low - spare_m or peaks.range_m[1] > high + spare_m:
        yield (
            f"{where}.travel_m: it goes from {peaks.range_m[0]:.4g} to {peaks.range_m[1]:.4g} m, "
            f"allowed are {low:.4g} to {high:.4g} m"
        )
    for key, peak, most, unit in (
        (
            "max_velocity_share",
            peaks.max_velocity_m_s,
            own.max_velocity_share * limits.max_velocity_m_s,
            "m/s",
        ),
        (
            "max_acceleration_share",
            peaks.max_acceleration_m_s2,
            own.max_acceleration_share * limits.max_acceleration_m_s2,
            "m/s^2",
        ),
    ):
        if peak > (1.0 + ROUNDED) * most:
            yield f"{where}.{key}: it reaches {peak:.4g} {unit}, allowed are {most:.4g} {unit}"
    if minutes > own.max_minutes:
        yield f"{where}.max_minutes: {minutes:.3g} of motion, allowed are {own.max_minutes:g}"
