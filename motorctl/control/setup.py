"""Fill the law's records from plain numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motorctl.control.assumption2 import monotonicity_half_planes
from motorctl.control.records import HISTORY
from motorctl.errors import UsageError
from motorctl.model import EffectList

Array = NDArray[np.float64]


def max_input_delay_s(period_s: float) -> float:
    """Return the longest input delay that the estimator's history holds."""
    return (HISTORY - 4) * period_s


def fill_settings(
    record: np.void,
    model: EffectList,
    *,
    period_s: float,
    k1_1_s: float,
    ks_v_s_m: float,
    gamma_d: float,
    d_hat_max_v: float,
    max_voltage_v: float,
    lower: Sequence[float],
    upper: Sequence[float],
    covariance: Sequence[float],
    adapt: bool = True,
    forgetting_1_s: float = 0.0,
    normalisation: float = 0.0,
    filter_rad_s: float = 200.0,
    covariance_limit: float = 10.0,
    rate_limit_1_s: float = math.inf,
    gate_velocity_m_s: float = 0.02,
    gate_acceleration_m_s2: float = 1.0,
    input_delay_s: float = 0.0,
    monotonicity_margin: float = 0.05,
    travel_m: tuple[float, float] = (0.0, 0.0),
) -> None:
    """Write one axis' settings into a record.

    Parameters
    ----------
    record
        Of `law_settings`.
    model
        The axis' list of effects, of n parameters.
    period_s
        Period of the axis [s].
    lower, upper, covariance
        Bounds and initial covariance of theta, each (n,).
    travel_m
        Both ends of the travel [m]; matters to input maps that vary with place.

    The other parameters are the keys of the configuration, with their units in their names.

    Raises
    ------
    UsageError
        Where the delays of adaptation and list together are longer than the history of commands,
        a covariance is not positive, or Assumption 2 cannot be kept.
    """
    n = len(model)
    delay_s = input_delay_s + model.delay_s
    if not (input_delay_s >= 0.0 and delay_s <= max_input_delay_s(period_s)):
        raise UsageError(
            f"input delay {delay_s:g} s: must be from 0 to {max_input_delay_s(period_s):g} s"
        )
    if not all(0.0 < value < math.inf for value in covariance):
        raise UsageError(f"initial covariances {[*map(float, covariance)]}: each must be above 0")
    record["n"], record["period_s"] = n, period_s
    record["k1"], record["ks"] = k1_1_s, ks_v_s_m
    record["gamma_d"], record["d_max"], record["u_max"] = gamma_d, d_hat_max_v, max_voltage_v
    record["adapt"] = adapt
    record["forgetting"] = math.exp(-forgetting_1_s * period_s)
    record["nu"] = normalisation
    record["filter_pole"] = math.exp(-filter_rad_s * period_s)
    record["gate_velocity"] = gate_velocity_m_s
    record["gate_acceleration"] = gate_acceleration_m_s2
    record["rate_limit"] = rate_limit_1_s
    ticks = delay_s / period_s
    record["delay_ticks"], record["delay_fraction"] = int(ticks), ticks - int(ticks)
    lag_s = model.lag_s
    record["previews"] = lag_s > 0.0 or model.delay_s > 0.0
    record["act_delay_s"], record["preview_s"] = model.delay_s, period_s + model.delay_s
    record["lag_s"] = lag_s
    record["lag_decay"] = math.exp(-period_s / lag_s) if lag_s else 0.0
    record["lag_mean"] = -lag_s / period_s * math.expm1(-period_s / lag_s) if lag_s else 0.0
    record["lower"][:n], record["upper"][:n] = lower, upper
    record["covariance"][:n] = covariance
    record["covariance_limit"][:n] = covariance_limit * np.asarray(covariance)
    normals, offsets = monotonicity_half_planes(
        model, np.asarray(lower), np.asarray(upper), max_voltage_v, monotonicity_margin, travel_m
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
