"""Fill the law's records from plain numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.control.assumption2 import monotonicity_half_planes
from motorctl.control.command_filter import CommandFilter
from motorctl.control.law_records import HISTORY, LAW_GIVEN
from motorctl.errors import UsageError
from motorctl.model import EffectList

Array = NDArray[np.float64]


def max_input_delay_s(period_s: float) -> float:
    """Return the longest input delay that the estimator's history holds.

    Parameters
    ----------
    period_s
        Period of the loop [s].

    Returns
    -------
    float
        The delay [s].
    """
    return (HISTORY - 4) * period_s


def fill_by_name(record: np.void, names: Iterable[str], given: Mapping[str, Any]) -> None:
    """Write the values of these names into the record's fields; None is no limit, infinity.

    Parameters
    ----------
    record
        The record that is written to.
    names
        Its fields that are filled.
    given
        Values by name, in the fields' own units; other names in it are left.

    Raises
    ------
    KeyError
        Where one is not given.
    """
    for name in names:
        value = given[name]
        record[name] = math.inf if value is None else value


def fill_settings(
    record: np.void,
    model: EffectList,
    *,
    period_s: float,
    lower: Sequence[float],
    upper: Sequence[float],
    covariance: Sequence[float],
    given: Mapping[str, Any],
    travel_m: tuple[float, float] = (0.0, 0.0),
    command_filter: CommandFilter | None = None,
) -> None:
    """Write one axis' settings into its record.

    Parameters
    ----------
    record
        A `law_settings` record.
    model
        The list that the axis runs, of n parameters.
    period_s
        The axis' own period [s].
    lower, upper, covariance
        Bounds and initial covariance of theta, each (n,).
    given
        Everything else by the names of the configuration's keys: all of LAW_GIVEN, and
        velocity, forgetting_1_s, filter_rad_s, covariance_limit, input_delay_s and
        monotonicity_margin, from which fields are computed. More may be in it.
    travel_m
        Both ends of the travel [m]; matters to input maps that vary with place.
    command_filter
        Of the feedback's part of the command; None: there is none, as published.

    Raises
    ------
    UsageError
        Where the delays of adaptation and list together are longer than the history of commands,
        where a covariance is not positive, or where Assumption 2 cannot be kept.
    """
    n = len(model)
    input_delay_s: float = given["input_delay_s"]
    delay_s = input_delay_s + model.delay_s
    if not (input_delay_s >= 0.0 and delay_s <= max_input_delay_s(period_s)):
        raise UsageError(
            f"input delay {delay_s:g} s: must be from 0 to {max_input_delay_s(period_s):g} s"
        )
    if not all(0.0 < value < math.inf for value in covariance):
        raise UsageError(f"initial covariances {[*map(float, covariance)]}: each must be above 0")
    fill_by_name(record, (name for name, _ in LAW_GIVEN), given)
    record["n"], record["period_s"] = n, period_s
    record["motion_memory"] = model.motion_memory
    record["matched"] = given["velocity"] == "matched"
    record["forgetting"] = math.exp(-given["forgetting_1_s"] * period_s)
    record["filter_pole"] = math.exp(-given["filter_rad_s"] * period_s)
    ticks = delay_s / period_s
    record["delay_ticks"], record["delay_fraction"] = int(ticks), ticks - int(ticks)
    lag_s = model.lag_s
    record["previews"] = lag_s > 0.0 or model.delay_s > 0.0
    record["act_delay_s"], record["preview_s"] = model.delay_s, period_s + model.delay_s
    record["lag_s"] = lag_s
    record["lag_decay"] = math.exp(-period_s / lag_s) if lag_s else 0.0
    record["lag_mean"] = -lag_s / period_s * math.expm1(-period_s / lag_s) if lag_s else 0.0
    if command_filter is not None:
        f = command_filter
        record["filters"] = 1
        record["filter_b"][:], record["filter_a"][:] = (f.b0, f.b1, f.b2), (f.a1, f.a2)
    record["lower"][:n], record["upper"][:n] = lower, upper
    record["covariance"][:n] = covariance
    record["covariance_limit"][:n] = given["covariance_limit"] * np.asarray(covariance)
    u_max, margin = given["max_voltage_v"], given["monotonicity_margin"]
    normals, offsets = monotonicity_half_planes(
        model, np.asarray(lower), np.asarray(upper), u_max, margin, travel_m
    )
    record["planes"] = len(offsets)
    record["plane_normal"][: len(offsets), :n] = normals
    record["plane_offset"][: len(offsets)] = offsets


def fill_state(record: np.void, theta: Sequence[float], covariance: Sequence[float]) -> None:
    """Write the initial estimate into a record.

    Parameters
    ----------
    record
        Of `law_state`.
    theta, covariance
        The estimate and its covariance, each (n,).
    """
    n = len(theta)
    record["theta"][:n] = theta
    record["U"][:] = np.eye(len(record["D"]))
    record["D"][:n] = covariance
