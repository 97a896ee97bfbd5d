"""Two axes under C2, slow enough for an emulated processor, and the gantry behind CAN."""

from __future__ import annotations

import sys
from typing import Any

INTERFACE = "vcan1"
DEVICE = [sys.executable, "-c", "import motorctl.cli as c; c.main()", "gantry-device"]
RATE_HZ = 100
DISTANCE_M = 0.05
COMMAND, STATE = 0x200, 0x180


def frames() -> dict[str, Any]:
    """Return one command and one state frame of 8 bytes."""
    command: dict[str, Any] = {"sequence": {"means": "sequence", "start": 40, "bits": 8}}
    state: dict[str, Any] = {"sequence": {"means": "sequence", "start": 56, "bits": 8}}
    for k, axis in enumerate("xy"):
        volts = {"means": "volts", "axis": axis, "start": 16 * k, "bits": 16, "signed": True}
        command[f"volts_{axis}"] = volts | {"scale": 0.0005}
        command[f"enable_{axis}"] = {"means": "enable", "axis": axis, "start": 32 + k, "bits": 1}
        counts = {"means": "counts", "axis": axis, "start": 28 * k, "bits": 28, "signed": True}
        state[f"counts_{axis}"] = counts
    return {
        "command": {"id": COMMAND, "direction": "command", "length": 6, "signals": command},
        "positions": {"id": STATE, "direction": "state", "length": 8, "signals": state},
    }


def device_file() -> dict[str, Any]:
    """Return the file for `motorctl gantry-device`."""
    channel = {"resolution_m": 0.5e-6, "counter_bits": 28, "max_voltage_v": 10.0}
    bus = {"interface": "socketcan", "channel": INTERFACE, "frames": frames()}
    return {
        "gantry": {"preset": "published_gantry", "seed": 1},
        "channels": [{"axis": axis, **channel} for axis in "xy"],
        "rate_hz": 2 * RATE_HZ,
        "watchdog_s": 1.0,
        "serve": {"can": bus},
    }


def can_driver() -> dict[str, Any]:
    """Return the driver's options: free-running, as no emulated device keeps time."""
    bus = {"interface": "socketcan", "channel": INTERFACE, "frames": frames(), "max_age_s": 1.0}
    late = {"hold_ticks": RATE_HZ, "predict": True}
    return {"type": "can", **bus, "open_timeout_s": 60.0, "late": late}


def config(driver: dict[str, Any]) -> dict[str, Any]:
    """Return the configuration of the machine on a driver."""
    return {
        "name": "socketcan",
        "rate_hz": RATE_HZ,
        "drivers": {"gantry": driver},
        "axes": {"x": _axis("x", 0, 0.19), "y": _axis("y", 1, 0.55)},
        "programs": {f"shuttle_{axis}": _program(axis) for axis in "xy"},
        "loop": {
            "without_realtime": "degrade",
            "overrun_policy": "count",
            "supervisor_timeout_s": 10.0,  # on an emulated processor an import takes seconds
        },
    }


def _program(axis: str) -> dict[str, Any]:
    return {
        "kind": "back_and_forth",
        "axis": axis,
        "start_m": 0.1,
        "distance_m": DISTANCE_M,
        "max_velocity_m_s": 0.05,
        "max_acceleration_m_s2": 0.2,
        "jerk_time_s": 0.1,
        "period_s": 4.0,
        "cycles": 100,
    }


def _axis(name: str, channel: int, inertia: float) -> dict[str, Any]:
    return {
        "driver": "gantry",
        "channel": channel,
        "controller": "C2",
        "encoder": {"resolution_m": 0.5e-6, "counter_bits": 28},
        "limits": {
            "travel_m": [-0.05, 0.45],
            "max_velocity_m_s": 1.0,
            "max_acceleration_m_s2": 10,
            "max_jerk_m_s3": 1000,
            "max_voltage_v": 10,
            "following_error": {
                "minimum_m": 0.2,  # the processor pauses for long
                "per_velocity_s": 0.1,
                "filter_time_s": 0.2,
            },
            "stop": {"acceleration_m_s2": 2, "jerk_m_s3": 40},
        },
        "gains": {"k1_1_s": 10, "ks_v_s_m": 20 * inertia, "gamma_d": 2, "d_hat_max_v": 1},
        "model": {
            "inertia": {"initial": inertia, "bounds": [0.05, 1.2]},
            "viscous_friction": {"initial": 0.25, "bounds": [0.05, 0.6]},
            "coulomb_friction": {"initial": 0.15, "bounds": [0.01, 0.4]},
            "offset": {"initial": 0, "bounds": [-0.5, 0.5]},
            "em_quadratic": {"initial": -0.005, "bounds": [-0.015, 0]},
            "em_cubic": {"initial": -0.0005, "bounds": [-0.001, 0]},
        },
        "adaptation": {"enabled": True, "filter_rad_s": 20, "keep_learned": False},
        "homing": {"method": "absolute"},
        "program": f"shuttle_{name}",
    }
