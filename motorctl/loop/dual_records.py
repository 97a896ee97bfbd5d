"""Records of a dual drive: its settings and its state, beside those of its axis."""

from __future__ import annotations

import numpy as np

from motorctl.config.machine import Axis

# Settings of one end have the names of an axis' own, so that the same kernels take them.
END_SETTINGS = np.dtype(
    [
        ("period_s", "f8"),
        ("metres_per_count", "f8"),  # signed by the direction
        ("counter_span", "i8"),
        ("offset_m", "f8"),
        ("max_velocity_m_s", "f8"),
        ("max_acceleration_m_s2", "f8"),
        ("absolute", "i8"),
    ],
    align=True,
)

DUAL_SETTINGS = np.dtype(
    [
        ("first", END_SETTINGS),
        ("second", END_SETTINGS),
        ("direction", "i8"),  # of the first encoder: the axis counts in metres' direction
        ("second_direction", "i8"),
        ("motor_direction", "i8"),  # of the second motor
        ("k1_1_s", "f8"),
        ("ks_v_s_m", "f8"),
        ("gamma_d", "f8"),
        ("max_voltage_v", "f8"),
        ("squaring_velocity_m_s", "f8"),
        ("square_offset_m", "f8"),
        ("max_out_of_square_m", "f8"),
    ],
    align=True,
)

END_STATE = np.dtype(
    [
        ("have_counts", "i8"),
        ("raw_counts", "i8"),  # as last read
        ("counts", "i8"),  # unwrapped
        ("blind_ticks", "i8"),  # since the count was last read
        ("paused_ticks", "i8"),  # of these: the loop was stalled, or a sample older than that
        ("step_ticks", "i8"),  # that the last step of the count took
        ("velocity_m_s", "f8"),
        ("position_m", "f8"),  # in its own coordinates
        ("pressed", "i8"),  # its home switch, now
        ("met", "i8"),  # the switch was pressed in this phase of homing
        ("done", "i8"),  # what this phase looks for was found
        ("latched_m", "f8"),  # where its edge or its mark is
    ],
    align=True,
)

DUAL_STATE = np.dtype(
    [
        ("first", END_STATE),
        ("second", END_STATE),
        ("raw_counts", "i8"),  # what the axis reads: both together
        ("raw_index_counts", "i8"),
        ("status", "i8"),  # and its status word
        ("second_status", "i8"),
        ("phase", "i8"),  # of homing, as the ends last knew it; -1: none
        ("apart_from_m", "f8"),  # where the first of them was done
        ("unchecked", "i8"),  # no sample has told yet whether it may be started
        ("squared", "i8"),  # both ends know their zero
        ("shift_m", "f8"),  # of the skew, found by homing
        ("skew_m", "f8"),
        ("reference_m", "f8"),
        ("error_m", "f8"),  # of the last sample
        ("gap_ticks", "i8"),  # since then
        ("d_v", "f8"),  # lasting difference of the two ends
        ("command_v", "f8"),
    ],
    align=True,
)


def fill_dual_drive(axis: Axis, axis_settings: np.void, settings: np.void, state: np.void) -> None:
    """Write a dual drive's settings, and let its axis count the mean of both ends.

    Parameters
    ----------
    axis
        An axis with two motors.
    axis_settings
        Of AXIS_SETTINGS, filled as for one motor.
    settings, state
        Of DUAL_SETTINGS and DUAL_STATE, zeroed.
    """
    dual, encoder = axis.dual_drive, axis.encoder
    assert dual is not None  # else there is nothing to fill
    skew = dual.skew
    second_offset_m = dual.encoder_offset_m
    if second_offset_m is None:
        second_offset_m = encoder.offset_m
    for end, direction, offset_m in (
        ("first", encoder.direction, encoder.offset_m),
        ("second", dual.encoder_direction, second_offset_m),
    ):
        for name in END_SETTINGS.names or ():
            settings[end][name] = axis_settings[name]
        settings[end]["metres_per_count"] = direction * encoder.resolution_m
        settings[end]["offset_m"] = offset_m
    settings["direction"], settings["second_direction"] = encoder.direction, dual.encoder_direction
    settings["motor_direction"] = dual.motor_direction
    for name in ("k1_1_s", "ks_v_s_m", "gamma_d", "max_voltage_v", "squaring_velocity_m_s"):
        settings[name] = getattr(skew, name)
    settings["square_offset_m"] = dual.square_offset_m
    settings["max_out_of_square_m"] = dual.max_out_of_square_m or 0.0
    # The sum of two counts that were unwrapped, half a resolution each.
    axis_settings["metres_per_count"] = 0.5 * encoder.resolution_m
    axis_settings["counter_span"] = 0
    axis_settings["offset_m"] = 0.5 * (encoder.offset_m + second_offset_m)
    state["phase"], state["unchecked"] = -1, 1
