"""The buses of the campaign: the shipped gantry behind each, and how the two are joined."""

from __future__ import annotations

import copy
import socket
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from typing import Any, Literal

import yaml

from motorctl.config import load
from motorctl_benchmarks.buses.beams import (
    BEAM_BUSES,
    RATE_HZ,
    SKEW_LIMIT_M,
    BeamBus,
    beam_device,
    beam_host,
)
from motorctl_benchmarks.buses.transports import AXES, merged
from motorctl_benchmarks.safety.bus_expectations import (
    CAN_BEAM,
    CANOPEN,
    CANOPEN_BEAM,
    MODBUS_BEAM,
    RTU,
    SERIAL_BEAM,
    TCP,
)
from motorctl_benchmarks.safety.bus_faults import HOLD_S, WATCHDOG_S, Options
from motorctl_devices.load import SHIPPED

Setup = Literal["plain", "ramps", "homes"]
"""What a session is configured for: axes that are on their way, hold or are off; ramps that last
long enough to be met by a fault; homing by a switch that nobody presses."""


@dataclass(frozen=True)
class Line:
    """A bus: the shipped configuration and device, and what is changed to join the two."""

    name: str
    config: str
    device: str
    rate_hz: float
    driver: Callable[[str, int], Options]
    """Returns changes of the driver's options, for the endpoint and a free port."""
    serve: Callable[[int], Options]
    """Returns changes of the device's key `serve`, for a free port."""
    beam: BeamBus | None = None
    """A beam that two motors drive; None: the shipped gantry."""

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes at the other end."""
        return AXES if self.beam is None else ("x",)

    @property
    def hold_ticks(self) -> int:
        """How many ticks may pass without a sample."""
        return round(HOLD_S * self.rate_hz)


def _serial(mode: str) -> Line:
    def driver(endpoint: str, _port: int) -> Options:
        return {"port": endpoint, "mode": mode, "watchdog_s": WATCHDOG_S}

    return Line(f"serial-{mode}", "serial_gantry", "serial_box", 500.0, driver, lambda _: {})


def _can() -> Line:
    def driver(_endpoint: str, port: int) -> Options:
        return {"port": port, "watchdog_s": WATCHDOG_S, "sync": {"id": 0x80, "wait_s": 1.4e-3}}

    return Line(
        "can-udp", "can_gantry", "can_node", 500.0, driver, lambda port: {"can": {"port": port}}
    )


def _slcan() -> Line:
    def driver(endpoint: str, _port: int) -> Options:
        adapter = {"interface": "slcan", "channel": endpoint.rsplit(maxsplit=1)[-1]}
        wait = {"tty_baudrate": 4_000_000, "sync": {"id": 0x80, "wait_s": 1.4e-3}}
        return {**adapter, **wait, "watchdog_s": WATCHDOG_S}

    serve: Options = {"can": {"interface": "slcan", "channel": None}}
    return Line("can-slcan", "can_gantry", "can_node", 500.0, driver, lambda _: serve)


def _canopen() -> Line:
    def driver(_endpoint: str, port: int) -> Options:
        return {"port": port, "watchdog_s": WATCHDOG_S}

    def serve(port: int) -> Options:
        return {"canopen": {"port": port}}

    # So slow that the drives' inputs, which homing asks for, fit in as well.
    return Line(CANOPEN, "canopen_gantry", "canopen_drives", 375.0, driver, serve)


def _tcp() -> Line:
    def driver(endpoint: str, _port: int) -> Options:
        host, _, port = endpoint.rpartition(":")
        return {"tcp": {"host": host, "port": int(port)}}

    serve: Options = {"modbus": {"tcp": {"host": "127.0.0.1", "port": 0}}}
    return Line(TCP, "modbus_gantry", "modbus_coupler", 500.0, driver, lambda _: serve)


def _rtu() -> Line:
    def driver(endpoint: str, _port: int) -> Options:
        line = {"port": endpoint, "baud": 1_000_000, "parity": "none"}
        return {"tcp": None, "device_turnaround_s": None, "rtu": line}

    serve: Options = {"modbus": {"tcp": None, "rtu": {}}}
    return Line(RTU, "modbus_gantry", "modbus_coupler", 125.0, driver, lambda _: serve)


LINES: Mapping[str, Line] = {
    line.name: line
    for line in (
        _serial("poll"),
        _serial("exchange"),
        _can(),
        _slcan(),
        _canopen(),
        _tcp(),
        _rtu(),
    )
}


def _beam(name: str, bus: BeamBus) -> Line:
    return Line(name, "dual_serial_gantry", "dual_serial_box", RATE_HZ, bus.driver, bus.serve, bus)


BEAM_LINES: Mapping[str, Line] = {
    SERIAL_BEAM: _beam(SERIAL_BEAM, BEAM_BUSES["serial poll"]),
    CAN_BEAM: _beam(CAN_BEAM, BEAM_BUSES["can"]),
    CANOPEN_BEAM: _beam(CANOPEN_BEAM, BEAM_BUSES["canopen"]),
    MODBUS_BEAM: _beam(MODBUS_BEAM, BEAM_BUSES["modbus tcp"]),
}
EVERY_LINE: Mapping[str, Line] = {**LINES, **BEAM_LINES}
WITHOUT_PORT = (TCP, "can-udp", CANOPEN, CAN_BEAM, CANOPEN_BEAM, MODBUS_BEAM)
"""Their devices make no serial port that a link could point to."""
SMALL = ("serial-poll", "can-udp", CANOPEN, TCP, CAN_BEAM)

RAMPS_TOP_M_S = 0.3
STOP = {"acceleration_m_s2": 0.15, "jerk_m_s3": 20.0}
"""From 0.1 m/s to rest in 0.7 s: a fault and the time without a sample fit into it."""
BUCKET_S = 0.06
FROZEN_S = 0.14
"""The pause that is made lies between the two."""
SHIPPED_MOST_S = 0.255
"""The longest watchdog's time for which the shipped frame has room."""
SEARCH_M_S = 0.02
"""Slow, as each search goes on from where the last one ended, and none finds the switch."""


def device_file(
    line: Line,
    port: int,
    faults: list[Options],
    watchdog_s: float = WATCHDOG_S,
) -> str:
    """Return the device's file, with faults to order."""
    if line.beam is not None:
        return _beam_device_file(line.beam, port, faults)
    data = yaml.safe_load((SHIPPED / f"{line.device}.yaml").read_text())
    data |= {"rate_hz": 4 * line.rate_hz, "watchdog_s": watchdog_s, "faults": faults}
    (bus,) = data["serve"]
    data["serve"] = {bus: _changed(data["serve"][bus], line.serve(port).get(bus, {}))}
    if bus == "can":
        data["serve"][bus] = _with_room(data["serve"][bus])
        if watchdog_s > SHIPPED_MOST_S:
            data["serve"][bus] = _with_long_watchdog(data["serve"][bus])
    return yaml.safe_dump(data)


def host_file(
    line: Line,
    controller: str,
    endpoint: str,
    port: int,
    setup: Setup = "plain",
    watchdog_s: float = WATCHDOG_S,
) -> str:
    """Return the configuration at this end: slower than shipped, and on its way without a rest."""
    if line.beam is not None:
        return _beam_host_file(line, line.beam, controller, endpoint, port)
    data: Options = copy.deepcopy(dict(load(line.config).resolved))
    share = line.rate_hz / data["rate_hz"]
    data["rate_hz"] = line.rate_hz
    (name,) = data["drivers"]
    late = {"hold_ticks": line.hold_ticks, "predict": True}
    driver = _changed(data["drivers"][name], line.driver(endpoint, port))
    if driver.get("watchdog_s") is not None:
        driver["watchdog_s"] = watchdog_s
    if driver["type"] == "can":
        driver = _with_room(driver)
        if watchdog_s > SHIPPED_MOST_S:
            driver = _with_long_watchdog(driver)
    data["drivers"][name] = driver | {"late": late}
    data["programs"] = {}
    for axis, keys in data["axes"].items():
        gains = keys["gains"]
        for gain, power in (("k1_1_s", 1), ("ks_v_s_m", 1), ("gamma_d", 2)):
            gains[gain] = gains[gain] * share**power
        keys["controller"], keys["program"] = controller, f"shuttle_{axis}"
        keys["adaptation"]["filter_rad_s"] *= share
        keys["limits"]["following_error"] = {
            "minimum_m": 0.05,
            "per_velocity_s": 0.1,
            "filter_time_s": 0.1,
        }
        data["programs"][f"shuttle_{axis}"] = {
            "kind": "back_and_forth",
            "axis": axis,
            "start_m": 0.0,
            "distance_m": 0.06,
            "max_velocity_m_s": 0.1,
            "max_acceleration_m_s2": 1.0,
            "jerk_time_s": 0.05,
            "period_s": 1.52,
            "cycles": 500,
        }
    data["loop"] |= {"overrun_policy": "count", "without_realtime": "degrade"}
    return yaml.safe_dump(_plain(_set_up(data, line, setup)))


def _beam_device_file(bus: BeamBus, port: int, faults: list[Options]) -> str:
    """Return a beam whose encoders know where they are: no fault has to wait for homing."""
    data = beam_device(bus, port, faults)
    for plant in data["gantry"]["plants"].values():
        plant |= {"initial_position_m": 0.0, "encoder": {"absolute": True}}
    return yaml.safe_dump(data)


def _beam_host_file(line: Line, bus: BeamBus, controller: str, endpoint: str, port: int) -> str:
    data = beam_host(bus, endpoint, port)
    data["drivers"]["gantry"]["late"]["hold_ticks"] = line.hold_ticks
    axis = data["axes"]["x"]
    axis["controller"], axis["homing"] = controller, {"method": "absolute"}
    # What has slipped may be led back to what its counts call square, and goes on.
    del axis["dual_drive"]["square_offset_m"]
    axis["dual_drive"]["max_out_of_square_m"] = 2.0 * SKEW_LIMIT_M
    data["loop"] |= {"overrun_policy": "count", "without_realtime": "degrade"}
    return yaml.safe_dump(_plain(data))


def _set_up(data: Options, line: Line, setup: Setup) -> Options:
    if setup == "ramps":
        bucket = round(BUCKET_S * line.rate_hz)
        data["loop"] |= {"overrun_policy": "leaky_bucket", "bucket_size": bucket}
        for keys in data["axes"].values():
            keys["limits"] |= {"max_velocity_m_s": RAMPS_TOP_M_S, "stop": dict(STOP)}
            late_ticks = {"late_ticks": {"reaction": "quick_stop"}}
            frozen = {"host_frozen": {"time_s": FROZEN_S}}
            keys["guards"] = merged(keys.get("guards") or {}, late_ticks | frozen)
    if setup == "homes":
        (name,) = data["drivers"]
        data["drivers"][name] = _with_home_switch(data["drivers"][name])
        for keys in data["axes"].values():
            keys["homing"] = {
                "method": "switch",
                "search_velocity_m_s": SEARCH_M_S,
                "latch_velocity_m_s": SEARCH_M_S,
                "home_position_m": 0.0,
                "timeout_s": 60.0,
            }
    return data


def _with_room(frames: Mapping[str, Any]) -> Options:
    """Return frames whose last bit is left for a home switch; the number of a start has two."""
    return merged(frames, {"frames": {"state": {"signals": {"boot": {"bits": 2}}}}})


def _with_home_switch(driver: Mapping[str, Any]) -> Options:
    """Return a driver that is told of home switches, in bits that the device leaves at 0."""
    if driver["type"] == "can":
        home: Options = {"home": {"means": "home_switch", "start": 63, "bits": 1}}
        return merged(driver, {"frames": {"state": {"signals": home}}})
    if driver["type"] == "canopen":
        inputs: Options = {"inputs": {"home_switch": 31}}
        return merged(driver, {"nodes": dict.fromkeys(driver["nodes"], inputs)})
    if driver["type"] == "modbus":
        bits = {
            key: {"status": {"home_switch": {"address": 4, "bit": 7 + 8 * i}}}
            for i, key in enumerate(driver["channels"])
        }
        return merged(driver, {"channels": bits})
    return dict(driver)


def _with_long_watchdog(frames: Mapping[str, Any]) -> Options:
    """Return frames in whose eight bits for the watchdog's time seconds have room."""
    scale: Options = {"watchdog": {"scale": 0.02}}
    return merged(frames, {"frames": {"command": {"signals": scale}}})


def free_port() -> int:
    """Return a UDP port that nobody uses."""
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as free:
        free.bind(("", 0))
        return int(free.getsockname()[1])


def _changed(base: Mapping[str, Any], changes: Mapping[str, Any]) -> Options:
    """Return keys with changes; None takes one away."""
    gone = {key for key, value in changes.items() if value is None}
    kept = {key: value for key, value in base.items() if key not in gone}
    return merged(kept, {key: value for key, value in changes.items() if key not in gone})


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(part) for key, part in value.items()}
    return [_plain(part) for part in value] if isinstance(value, list | tuple) else value
