"""What the compiled physics works on: records with named fields, one a channel."""

from __future__ import annotations

from enum import IntFlag

import numpy as np

from motorctl_sim.options.plant import MAX_INDEX_MARKS
from motorctl_sim.options.settings import MAX_HARMONICS

PROFILE_CELLS = 256
DELAY_LINE = 2048  # substeps; a power of two


class Term(IntFlag):
    """Terms of the force balance that cost time, each computed only where it is on."""

    INPUT_DELAY = 1 << 0
    GAIN_DRIFT = 1 << 1
    PAYLOAD_CHANGE = 1 << 2
    THRUST_HYSTERESIS = 1 << 3
    DAHL = 1 << 4
    LUGRE = 1 << 5
    STRIBECK = 1 << 6
    POSITION_FRICTION = 1 << 7
    FRICTION_PATCH = 1 << 8
    FRICTION_BUMP = 1 << 9
    POSITION_FORCE = 1 << 10
    END_EFFECT = 1 << 11
    CABLE = 1 << 12
    PERIODIC = 1 << 13
    CROSS_AXIS = 1 << 14
    FLEXIBLE_MODE = 1 << 15
    BACKLASH = 1 << 16
    NOISE = 1 << 17
    WANDERING = 1 << 18


# Frozen into the kernels as plain numbers: numba takes global integers as constants.
FROZEN = {term.name: int(term) for term in Term}

HARMONICS = np.dtype(
    [
        ("count", "i8"),
        ("wave_number", "f8", (MAX_HARMONICS,)),  # rad/m
        ("amplitude", "f8", (MAX_HARMONICS,)),
        ("phase", "f8", (MAX_HARMONICS,)),
    ],
    align=True,
)

# A function of position on a uniform grid: value, and slope times the cell's length, at each node.
PROFILE = np.dtype(
    [
        ("start", "f8"),
        ("cells_per_m", "f8"),  # 0: no profile
        ("nodes", "f8", (PROFILE_CELLS + 1, 2)),
    ],
    align=True,
)

SPRUNG = np.dtype(
    [
        ("inertia", "f8"),  # V s^2/m
        ("stiffness", "f8"),  # 1/s^2, over the inertia
        ("damping", "f8"),  # 1/s, over the inertia
        ("half_gap", "f8"),  # m
        ("friction", "f8"),  # V, of the part alone
    ],
    align=True,
)

PLANT = np.dtype(
    [
        ("terms", "i8"),  # Term
        # motion
        ("inertia", "f8"),  # V s^2/m, of the carriage itself
        ("added_inertia", "f8"),
        ("added_at", "i8"),  # period
        ("viscous", "f8"),  # V s/m
        ("drag", "f8"),  # V s^2/m^2
        ("offset", "f8"),  # V
        ("lower_end", "f8"),
        ("upper_end", "f8"),
        ("end_stiffness", "f8"),
        ("end_damping", "f8"),
        ("initial_position", "f8"),
        ("initial_velocity", "f8"),
        # command to thrust
        ("max_voltage", "f8"),
        ("converter_step", "f8"),  # V; 0: none
        ("dead_half_width", "f8"),
        ("delay_whole", "i8"),  # substeps
        ("delay_part", "f8"),  # the rest, 0 to 1
        ("lag_decay", "f8"),  # exp(-h/tau)
        ("lag_mean", "f8"),  # mean over a substep of exp(-t/tau)
        ("quadratic", "f8"),  # theta5
        ("cubic", "f8"),  # theta6
        ("force_ratio", "f8"),  # force constant over A1
        ("drift_fraction", "f8"),
        ("drift_rate", "f8"),  # 1/period
        ("hysteresis_force", "f8"),
        ("hysteresis_voltage", "f8"),
        ("ripple", HARMONICS),
        # friction
        ("coulomb", "f8"),
        ("slope", "f8"),
        ("displacement", "f8"),
        ("micro_damping", "f8"),
        ("stribeck_force", "f8"),
        ("stribeck_velocity", "f8"),
        ("stribeck_exponent", "f8"),
        ("asymmetric_coulomb", "f8"),
        ("asymmetric_viscous", "f8"),
        ("friction_center", "f8"),
        ("friction_linear", "f8"),
        ("friction_quadratic", "f8"),
        ("friction_profile", PROFILE),
        ("patch_force", "f8"),
        ("patch_position", "f8"),
        ("patch_width", "f8"),
        ("patch_velocity", "f8"),
        ("bump_force", "f8"),
        ("bump_velocity", "f8"),
        ("bump_width", "f8"),
        # forces of position and time
        ("cogging", HARMONICS),
        ("cogging_profile", PROFILE),
        ("force_center", "f8"),
        ("spring", "f8"),
        ("cubic_spring", "f8"),
        ("force_profile", PROFILE),
        ("end_effect_force", "f8"),
        ("end_effect_length", "f8"),
        ("cable_force", "f8"),
        ("cable_length", "f8"),
        ("periodic_amplitude", "f8"),
        ("periodic_rad_s", "f8"),
        ("periodic_phase", "f8"),
        ("noise_rms", "f8"),
        ("wandering_rms", "f8"),
        ("wandering_decay", "f8"),  # over a period
        # other masses
        ("coupled_to", "i8"),  # index of the other axis
        ("coupled_inertia", "f8"),
        ("coupled_viscous", "f8"),
        ("flexible", SPRUNG),
        ("loose", SPRUNG),
        # encoder and switches
        ("resolution", "f8"),
        ("sign", "i8"),
        ("absolute", "i8"),
        ("counter_bits", "i8"),
        ("encoder_noise_rms", "f8"),
        ("error_amplitude", "f8"),
        ("error_rad_m", "f8"),
        ("error_phase", "f8"),
        ("index_marks", "i8"),
        ("index_mark", "f8", (MAX_INDEX_MARKS,)),
        ("lower_switch", "f8"),
        ("upper_switch", "f8"),
        ("home_from", "f8"),
        ("home_to", "f8"),
    ],
    align=True,
)

STATE = np.dtype(
    [
        ("position", "f8"),
        ("velocity", "f8"),
        ("acceleration", "f8"),  # of the last substep
        ("middle", "f8"),  # position in the middle of the last substep
        ("next_acceleration", "f8"),
        ("flexible", "f8", (2,)),  # offset of the part from the carriage, and its rate
        ("loose", "f8", (2,)),
        ("current", "f8"),  # command behind the lag, V
        ("thrust", "f8"),  # V
        ("bristle", "f8"),  # presliding state over its displacement
        ("cable", "f8"),
        ("hysteresis", "f8"),
        # held over a period
        ("level", "f8"),  # at the amplifier's input, V
        ("gain", "f8"),
        ("inertia", "f8"),
        ("held_force", "f8"),
        ("wandering", "f8"),
        ("cursor", "i8"),
        ("line", "f8", (DELAY_LINE,)),
        ("random", "u8", (4,)),
        # what the loop writes
        ("command", "f8"),
        ("enable", "u1"),
        # what the loop reads
        ("count", "i8"),
        ("index_count", "i8"),
        ("status", "u4"),
        # encoder
        ("seen_position", "f8"),  # at the last observation
        ("zero_count", "i8"),
        # faults in force
        ("fault_status", "u4"),
        ("frozen", "u1"),
        ("output_off", "u1"),
        ("fault_force", "f8"),
    ],
    align=True,
)

FAULT = np.dtype(
    [
        ("axis", "i8"),  # index; -1: every axis
        ("start", "i8"),  # first period
        ("stop", "i8"),  # the period after its last
        ("status", "u4"),
        ("freezes", "u1"),
        ("turns_off", "u1"),
        ("jump", "f8"),  # m, once
        ("force", "f8"),
    ],
    align=True,
)

BEAM = np.dtype(
    [
        ("first", "i8"),  # index of the channel at this end
        ("second", "i8"),
        ("m11", "f8"),  # V s^2/m, beside the carriages' own
        ("m12", "f8"),
        ("m22", "f8"),
        ("stiffness", "f8"),
        ("damping", "f8"),
    ],
    align=True,
)

CLOCK = np.dtype(
    [("tick", "i8"), ("period", "f8"), ("substeps", "i8"), ("substep", "f8")], align=True
)
