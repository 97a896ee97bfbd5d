"""Ready-made plants: a list of axes each, in the order of channels."""

from __future__ import annotations

from typing import Any, Literal

PresetName = Literal["published_gantry", "published_gantry_clean", "small_stage"]

_GANTRY_FRAME: dict[str, Any] = {
    "travel_m": [-0.07, 0.47],
    "initial_position_m": 0.0,
    "limit_switches_m": [-0.06, 0.46],
    "home_switch": {"to_m": -0.02},
    "encoder": {"index_marks_m": [0.0]},
}

# What the declared model of the paper's six parameters describes exactly.
_GANTRY_X_CLEAN: dict[str, Any] = {
    **_GANTRY_FRAME,
    "inertia_v_s2_m": 0.197,
    "viscous_friction_v_s_m": 0.2265,
    "coulomb_friction_v": 0.139,
    "offset_v": 0.012,
    "em_quadratic_1_v": -0.0122,
    "em_cubic_1_v2": -0.00104,
    "end_stop": {"stiffness_v_m": 4e5, "damping_v_s_m": 150.0},
    "amplifier": {"resolution_bits": None},
}
_GANTRY_Y_CLEAN: dict[str, Any] = {
    **_GANTRY_FRAME,
    "inertia_v_s2_m": 0.670,
    "viscous_friction_v_s_m": 0.296,
    "coulomb_friction_v": 0.182,
    "offset_v": 0.004,
    "em_quadratic_1_v": -0.0168,
    "em_cubic_1_v2": -0.00058,
    "end_stop": {"stiffness_v_m": 1.4e6, "damping_v_s_m": 500.0},
    "amplifier": {"resolution_bits": None},
}


def _cogging(first: float, second: float, sixth: float) -> dict[str, Any]:
    return {
        "pitch_m": 0.05,
        "harmonics": [
            {"order": 1, "amplitude_v": first, "phase_rad": 0.3},
            {"order": 2, "amplitude_v": second, "phase_rad": 1.1},
            {"order": 6, "amplitude_v": sixth, "phase_rad": 0.0},
        ],
    }


_GANTRY_X: dict[str, Any] = {
    **_GANTRY_X_CLEAN,
    "force_noise_rms_v": 0.9e-3,
    "amplifier": {"resolution_bits": 16},
    "cogging": _cogging(0.034, 0.039, 0.142),
    "presliding": {"kind": "dahl", "displacement_m": 10e-6},
    "input_lag": {"time_s": 0.39e-3},
    "input_delay": {"time_s": 92e-6},
}
_GANTRY_Y: dict[str, Any] = {
    **_GANTRY_Y_CLEAN,
    "force_noise_rms_v": 0.4e-3,
    "amplifier": {"resolution_bits": 16},
    "cogging": _cogging(0.34, 0.10, 0.12),
    "presliding": {"kind": "dahl", "displacement_m": 15e-6},
    "input_lag": {"time_s": 0.39e-3},
    "input_delay": {"time_s": 100e-6},
}

# A 2 kg carriage on a 40 N/V motor and amplifier, 0.2 m of travel, with an incremental encoder
# that has to be homed.
_SMALL_STAGE: dict[str, Any] = {
    "inertia_v_s2_m": 0.05,
    "viscous_friction_v_s_m": 0.1,
    "coulomb_friction_v": 0.08,
    "offset_v": 0.01,
    "em_quadratic_1_v": -0.004,
    "em_cubic_1_v2": -0.0002,
    "force_noise_rms_v": 0.5e-3,
    "travel_m": [-0.105, 0.105],
    "initial_position_m": 0.03,
    "end_stop": {"stiffness_v_m": 1e5, "damping_v_s_m": 40.0},
    "limit_switches_m": [-0.1, 0.1],
    "home_switch": {"to_m": -0.08},
    "encoder": {"absolute": False, "index_marks_m": [-0.07]},
    "cogging": {
        "pitch_m": 0.024,
        "harmonics": [
            {"order": 1, "amplitude_v": 0.02, "phase_rad": 0.5},
            {"order": 2, "amplitude_v": 0.03, "phase_rad": 0.0},
        ],
    },
    "presliding": {"kind": "dahl", "displacement_m": 5e-6},
    "input_lag": {"time_s": 0.2e-3},
    "input_delay": {"time_s": 100e-6},
}

PRESETS: dict[str, tuple[dict[str, Any], ...]] = {
    "published_gantry": (_GANTRY_X, _GANTRY_Y),
    "published_gantry_clean": (_GANTRY_X_CLEAN, _GANTRY_Y_CLEAN),
    "small_stage": (_SMALL_STAGE,),
}
"""``published_gantry``: X and Y of a plant that comes close to the measured figures of Chen, Yao
and Wang, IEEE/ASME Trans. Mechatronics 18(3), 2013; ``published_gantry_clean``: the same without
cogging, presliding, lag, delay, noise and D/A steps; ``small_stage``: one axis that needs homing.
"""
