"""A beam that two motors drive: the loop of its skew, and the keys that an axis has for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from motorctl.config.dual_drive_keys import DualDrive
from motorctl.config.skew_motion import squaring_lag_m
from motorctl.errors import UsageError
from motorctl.init.first_gains import FirstGains, first_gains
from motorctl.init.known import AxisKnown
from motorctl.init.yaml_text import Path

INERTIA_SHARE, INERTIA_RANGE = 1.0 / 3.0, (0.5, 2.0)
"""What resists skew, over what resists motion. A uniform beam without carriages has 1/6, carriages
without a beam 1/2, and a third is half of each; a load at an end adds. The margins are kept over
the range, as parts of that."""
VOLTAGE_SHARE = 0.4
"""Of a motor's full command, for the skew loop: as on the shipped beam. Larger leaves the law too
little, smaller loses a beam of uneven motors. By hand."""
OUT_OF_SQUARE = 2.0
"""Over the skew limit: by how much more the ends' switches may differ. By hand."""
SQUARING_M_S = 1e-3
"""Speed of squaring at most [m/s]: nobody waits long for a millimetre."""
LAG_SHARE = 0.5
"""Of the skew limit, by which a beam may stay behind that is squared. By hand."""
HALVINGS = 8
"""Of the squaring speed at most. By hand."""


@dataclass(frozen=True)
class SkewNumbers:
    """The numbers of a beam's skew loop."""

    inertia_v_s2_m: float
    gains: FirstGains
    max_voltage_v: float
    squaring_velocity_m_s: float
    max_out_of_square_m: float


def skew_numbers(
    known: AxisKnown, inertia: float, friction: float, period_s: float, delay_s: float
) -> SkewNumbers | None:
    """Return the skew loop's numbers; None for an axis with one motor.

    Parameters
    ----------
    known
        What is known of the axis.
    inertia, friction
        Of the mean of its ends, over the force of both motors [V s^2/m, V].
    period_s, delay_s
        Of its driver, and how late a command acts [s].

    Raises
    ------
    UsageError
        Where the beam would trip its limit while it is squared.
    """
    second = known.second
    if second is None:
        return None
    own = _rounded(INERTIA_SHARE * inertia)
    low, high = INERTIA_RANGE
    gains = first_gains(
        own,
        (low * own, high * own),
        0.0,
        known.resolution_m,
        known.max_voltage_v,
        period_s,
        delay_s,
        known.name,
    )
    apart = _rounded(OUT_OF_SQUARE * second.skew_limit_m)
    numbers = SkewNumbers(
        own, gains, _rounded(VOLTAGE_SHARE * known.max_voltage_v), SQUARING_M_S, apart
    )
    for _ in range(HALVINGS):
        dual = DualDrive.model_validate(_dual_keys(known, numbers))
        lag_m = squaring_lag_m(dual, second.skew_limit_m, friction, period_s)
        if lag_m <= LAG_SHARE * second.skew_limit_m:
            return numbers
        slower = _rounded(0.5 * numbers.squaring_velocity_m_s)
        numbers = SkewNumbers(own, gains, numbers.max_voltage_v, slower, apart)
    raise UsageError(
        f"axis {known.name}: --skew-limit {second.skew_limit_m:g}m: friction of {friction:g} V "
        f"holds the beam back by {lag_m:.3g} m while it is squared, with a skew loop of k1 "
        f"{gains.k1_1_s:g} 1/s and ks {gains.ks_v_s_m:g} V*s/m; should be at least "
        f"{_rounded(lag_m / LAG_SHARE):g}m, or give a higher --rate"
    )


def dual_drive_keys(
    known: AxisKnown, numbers: SkewNumbers
) -> tuple[dict[str, Any], dict[Path, str]]:
    """Return the keys that an axis with two motors has besides, and comments by their paths."""
    second = known.second
    assert second is not None  # who has numbers of its skew has a second end
    gains = numbers.gains
    keys = {
        "dual_drive": _dual_keys(known, numbers),
        "guards": {"skew": {"limit_m": second.skew_limit_m, "reaction": "disable"}},
    }
    told: dict[Path, str] = {
        ("dual_drive",): "two motors on one beam: docs/dual_drive.md",
        ("dual_drive", "channel"): "second motor, encoder and switches; `channel` has the first "
        "end's",
        ("dual_drive", "encoder_direction"): "1 where the second's counts rise with the position",
        ("dual_drive", "motor_direction"): "-1 where it is mounted the other way round",
        (
            "dual_drive",
            "skew",
        ): f"{gains.margins_in_words}; k1 is no higher as {gains.bound_by}; inertia: a third "
        "of that of the motion, a guess: half of the mass in the carriages, half along the beam",
        ("dual_drive", "square_offset_m"): "the first end's switch or mark is so far ahead, with "
        "the beam square",
        ("dual_drive", "max_out_of_square_m"): "homing is a fault where they differ by more",
        ("guards",): "how far the ends may be apart",
    }
    return keys, told


def _dual_keys(known: AxisKnown, numbers: SkewNumbers) -> dict[str, Any]:
    second, gains = known.second, numbers.gains
    assert second is not None
    skew = {
        "k1_1_s": gains.k1_1_s,
        "ks_v_s_m": gains.ks_v_s_m,
        "gamma_d": gains.gamma_d,
        "max_voltage_v": numbers.max_voltage_v,
        "inertia_v_s2_m": numbers.inertia_v_s2_m,
        "squaring_velocity_m_s": numbers.squaring_velocity_m_s,
    }
    keys: dict[str, Any] = {
        "channel": second.channel,
        "encoder_direction": 1,
        "motor_direction": 1,
        "skew": skew,
    }
    if known.homing != "absolute":
        keys["square_offset_m"] = second.square_offset_m or 0.0
        keys["max_out_of_square_m"] = numbers.max_out_of_square_m
    return keys


def _rounded(value: float) -> float:
    """Return a number of three digits."""
    return float(f"{value:.3g}")
