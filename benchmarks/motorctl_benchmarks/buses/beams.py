"""The shipped beam with two motors behind each bus: what is shipped for a serial line, changed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import yaml

from motorctl.config.shipped import shipped_config
from motorctl_devices.load import SHIPPED

Options = dict[str, Any]
ENDS = ("x", "x.2")
WATCHDOG_S = 0.25
RATE_HZ = 250.0
HOLD_TICKS = 40
"""As the loop's rate, far below what the buses carry: a busy computer is not what is tried. By
hand."""
MULTICAST = "239.74.163.9"
SKEW_LIMIT_M = 2e-3


@dataclass(frozen=True)
class BeamBus:
    """A bus with the beam at its other end."""

    name: str
    serve: Callable[[int], Options]
    """Returns the device's key `serve` for a free UDP port."""
    driver: Callable[[str, int], Options]
    """Returns the driver's options for the device's endpoint and the UDP port."""


def state_frame(number: int, end: str) -> Options:
    """Return the frame of one end's drive on CAN: each end has a node of its own."""
    flags = ("encoder_lost", "amplifier_fault", "limit_negative", "limit_positive", "home_switch")
    signals: Options = {
        "counts": {"means": "counts", "axis": end, "start": 0, "bits": 32, "signed": True},
        "sequence": {"means": "sequence", "start": 32, "bits": 8},
        "boot": {"means": "boot", "axis": end, "start": 48, "bits": 8},
    }
    for i, flag in enumerate(flags):
        signals[flag] = {"means": flag, "axis": end, "start": 40 + i, "bits": 1}
    return {"id": 0x180 + number, "direction": "state", "length": 7, "signals": signals}


def can_frames() -> Options:
    """Return the frames: one command for both ends, so that both motors take it together."""
    signals: Options = {
        "watchdog": {"means": "watchdog", "start": 40, "bits": 8, "scale": 0.001},
        "sequence": {"means": "sequence", "start": 48, "bits": 8},
    }
    for i, end in enumerate(ENDS):
        volts = {"start": 16 * i, "bits": 16, "signed": True, "scale": 0.0005}
        signals[f"volts_{i}"] = {"means": "volts", "axis": end, **volts}
        signals[f"enable_{i}"] = {"means": "enable", "axis": end, "start": 32 + i, "bits": 1}
    command = {"id": 0x200, "direction": "command", "length": 7, "signals": signals}
    return {"command": command, **{f"end_{i}": state_frame(i, e) for i, e in enumerate(ENDS, 1)}}


def modbus_map() -> Options:
    """Return the registers of both ends."""
    flags = ("encoder_lost", "amplifier_fault", "limit_negative", "limit_positive", "home_switch")
    channels = {
        i: {
            "volts": {"address": i, "bits": 16, "signed": True, "volts_per_count": 10 / 32767},
            "enable": {"address": 2, "bit": i},
            "counts": {"address": 2 * i, "bits": 32, "signed": True},
            "status": {flag: {"address": 4, "bit": 8 * i + k} for k, flag in enumerate(flags)},
        }
        for i in range(2)
    }
    return {
        "channels": channels,
        "sequence": {"output": 3, "input": 5},
        "boot_id": {"address": 6},
    }


def _serial(mode: str) -> BeamBus:
    def driver(endpoint: str, _port: int) -> Options:
        return {"type": "serial", "port": endpoint, "baud": None, "mode": mode,
                "watchdog_s": WATCHDOG_S}  # fmt: skip

    return BeamBus(f"serial {mode}", lambda _: {"serial": {}}, driver)


def _can() -> BeamBus:
    def bus(port: int) -> Options:
        told = {"interface": "udp_multicast", "channel": MULTICAST, "port": port}
        return {**told, "frames": can_frames()}

    def driver(_endpoint: str, port: int) -> Options:
        sync = {"id": 0x80, "wait_s": 2.4e-3}
        return {"type": "can", **bus(port), "sync": sync, "watchdog_s": WATCHDOG_S}

    return BeamBus("can", lambda port: {"can": {**bus(port), "sync": {"id": 0x80}}}, driver)


def _canopen() -> BeamBus:
    drives = [{"node": number, "rated_torque_v": 10.0} for number in (1, 2)]
    inputs = {"limit_negative": 0, "limit_positive": 1, "home_switch": 2}

    def bus(port: int) -> Options:
        return {"interface": "udp_multicast", "channel": MULTICAST, "port": port}

    def driver(_endpoint: str, port: int) -> Options:
        nodes = {end: {**drive, "inputs": inputs} for end, drive in zip(ENDS, drives, strict=True)}
        sync = {"sync": {"wait_s": 2.4e-3}, "watchdog_s": WATCHDOG_S, "heartbeat_s": 0.1}
        return {"type": "canopen", **bus(port), "nodes": nodes, **sync, "command_at": "arrival"}

    return BeamBus("canopen", lambda port: {"canopen": {**bus(port), "nodes": drives}}, driver)


def _modbus() -> BeamBus:
    def driver(endpoint: str, _port: int) -> Options:
        host, _, port = endpoint.rpartition(":")
        return {"type": "modbus", "tcp": {"host": host, "port": int(port)}, **modbus_map()}

    return BeamBus("modbus tcp", lambda _: {"modbus": {"tcp": {"port": 0}, **modbus_map()}}, driver)


BEAM_BUSES = {bus.name: bus for bus in (_serial("poll"), _can(), _canopen(), _modbus())}


def beam_device(bus: BeamBus, port: int, faults: list[Options] | None = None) -> Options:
    """Return the device's file, 50 mm from the switches."""
    data: Options = yaml.safe_load((SHIPPED / "dual_serial_box.yaml").read_text())
    for plant, place in zip(data["gantry"]["plants"].values(), (-0.06, -0.0603), strict=True):
        plant["initial_position_m"] = place
    data |= {"rate_hz": 4 * RATE_HZ, "watchdog_s": WATCHDOG_S, "faults": faults or []}
    return data | {"serve": bus.serve(port)}


def beam_host(bus: BeamBus, endpoint: str, port: int, **driver: Any) -> Options:
    """Return the configuration at this end: slower than shipped, on its way without a rest."""
    data: Options = yaml.safe_load(shipped_config("dual_serial_gantry").read_text())
    data["rate_hz"] = RATE_HZ
    late = {"hold_ticks": HOLD_TICKS, "predict": True}
    data["drivers"] = {"gantry": bus.driver(endpoint, port) | driver | {"late": late}}
    axis = data["axes"]["x"]
    axis["gains"] |= {"k1_1_s": 20, "ks_v_s_m": 10, "gamma_d": 4}
    axis["adaptation"]["filter_rad_s"] = 30
    axis["dual_drive"]["skew"] |= {
        "k1_1_s": 15, "ks_v_s_m": 4, "gamma_d": 40, "stiffness_v_m": 500,
    }  # fmt: skip
    axis["limits"]["following_error"] = {
        "minimum_m": 0.02, "per_velocity_s": 0.1, "filter_time_s": 0.1,
    }  # fmt: skip
    axis["guards"]["skew"]["limit_m"] = SKEW_LIMIT_M
    data["loop"]["supervisor_timeout_s"] = 5.0  # a busy computer is not what is tried here
    axis["dual_drive"]["max_out_of_square_m"] = 3e-3
    data["programs"]["shuttle"] |= {
        "distance_m": 0.06, "max_velocity_m_s": 0.1, "max_acceleration_m_s2": 1.0,
        "jerk_time_s": 0.05, "period_s": 1.6, "cycles": 500,
    }  # fmt: skip
    return data
