"""The buses of the campaign: the shipped gantry behind each, and what its faults must lead to."""

from __future__ import annotations

import copy
import socket
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import yaml

from motorctl.config import load
from motorctl_benchmarks.buses.transports import merged
from motorctl_devices.load import SHIPPED

Options = dict[str, Any]

HOLD_S = 0.15
"""How long an axis may go without a sample: well above the pauses of a busy computer."""
WATCHDOG_S = 0.25
"""The device's own, well above HOLD_S: so it is clear who took the volts away."""
LATE_S = 0.06
RESET_S = 0.05
JUMP_COUNTS = 60_000
"""30 mm: further than four times the top speed in a period of 2 ms, where it is no motion."""
CANOPEN = "canopen-udp"


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

    @property
    def hold_ticks(self) -> int:
        """How many ticks may pass without a sample."""
        return round(HOLD_S * self.rate_hz)


@dataclass(frozen=True)
class Promise:
    """What a fault on the wire must lead to."""

    guard: str
    off_s: float
    """From its begin until the device's amplifiers are off."""
    held: bool = True
    """The axis goes on for the allowed ticks first."""
    asked: bool = False
    """A reset is asked for while it lasts, and has to be refused."""


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

    return Line(CANOPEN, "canopen_gantry", "canopen_drives", 500.0, driver, serve)


def _tcp() -> Line:
    def driver(endpoint: str, _port: int) -> Options:
        host, _, port = endpoint.rpartition(":")
        return {"tcp": {"host": host, "port": int(port)}}

    serve: Options = {"modbus": {"tcp": {"host": "127.0.0.1", "port": 0}}}
    return Line("modbus-tcp", "modbus_gantry", "modbus_coupler", 500.0, driver, lambda _: serve)


def _rtu() -> Line:
    def driver(endpoint: str, _port: int) -> Options:
        line = {"port": endpoint, "baud": 1_000_000, "parity": "none"}
        return {"tcp": None, "device_turnaround_s": None, "rtu": line}

    serve: Options = {"modbus": {"tcp": None, "rtu": {}}}
    return Line("modbus-rtu", "modbus_gantry", "modbus_coupler", 125.0, driver, lambda _: serve)


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
WITHOUT_PORT = ("modbus-tcp", "can-udp", CANOPEN)
"""Their devices make no serial port that a link could point to."""
SMALL = ("serial-poll", "can-udp", CANOPEN, "modbus-tcp")

_TCP = "modbus-tcp"
WIRE: Mapping[str, tuple[str, Options]] = {
    "silence": ("nothing passes", {"kind": "silence"}),
    "loss": ("every answer vanishes", {"kind": "loss"}),
    "late_answers": ("every answer is 60 ms late", {"kind": "delay", "amount_s": LATE_S}),
    "wrong_length": ("every answer has a wrong length", {"kind": "wrong_length"}),
    "bit_errors": ("every answer has a wrong bit", {"kind": "bit_errors"}),
    "stuck_sequence": (
        "every answer has the same number",
        {"kind": "wrong_sequence", "sequence": "stuck"},
    ),
    "short_reset": (
        "the device starts anew within 50 ms",
        {"kind": "reset", "duration_s": RESET_S},
    ),
    "long_reset": ("the device starts anew within 0.5 s", {"kind": "reset", "duration_s": 0.5}),
    "unplug": ("the line is unplugged", {"kind": "unplug", "duration_s": 1.0}),
    "broken_amplifier": ("an amplifier breaks, and its drive says so", {"kind": "amplifier_fault"}),
    "shifted_count": (
        "the device's count jumps",
        {"kind": "counter_jump", "counts": JUMP_COUNTS},
    ),
}
"""Faults to order of the device at the other end: title and order."""

_CHECKSUM = (
    "the line's own checksum lets no wrong bit pass, so the order would be a device that sends "
    "wrong content, of which nobody can promise anything"
)
NOT_TRIED: Mapping[tuple[str, str], str] = {
    ("can-udp", "bit_errors"): _CHECKSUM,
    ("can-slcan", "bit_errors"): _CHECKSUM,
    (CANOPEN, "bit_errors"): _CHECKSUM,
    (_TCP, "bit_errors"): _CHECKSUM,
    (_TCP, "wrong_length"): "it may cost the stream its step, or not: there are two promises",
    (CANOPEN, "stuck_sequence"): "a PDO has no number that could stand still",
    ("modbus-rtu", "shifted_count"): (
        "in a period of 8 ms a jump of 30 mm may be motion, for all that a guard knows"
    ),
}
"""Why a fault of WIRE is not tried on a line. Every other pair is."""
NOT_ORDERED: Mapping[str, str] = {
    "jitter": "a delay that changes; late_answers has it at its longest, all the time",
    "duplicates": "the axis goes on: nothing has to trip",
    "reordering": "the axis goes on: nothing has to trip",
    "babbling": "the axis goes on while samples come: nothing has to trip",
    "counter_wrap": "the count is unwrapped: nothing has to trip",
}
"""Why an order that a device takes is none of WIRE; what becomes of each stands in its page."""


def promise(line: str, fault: str) -> Promise | None:
    """Return what a fault must lead to on a line; None where it is not tried (NOT_TRIED).

    On CAN an answer that is late, or whose number stands still, passes for a new one about once in
    a hundred ticks; a reset may be obeyed then, and is not asked for. Nor is it where it would open
    the driver anew: on CANopen after three heartbeats that are missing.
    """
    if (line, fault) in NOT_TRIED:
        return None
    if fault == "broken_amplifier":
        # The drives of CANopen are reset, and fail again: a fault that ends meanwhile is gone.
        return Promise("amplifier", 0.0, held=False, asked=line != CANOPEN)
    if fault == "shifted_count":
        return Promise("encoder_jump", 0.0, held=False)
    if fault in ("silence", "unplug"):
        # The device hears nothing either: its watchdog takes the volts.
        gone = fault == "unplug" and line not in ("can-udp", CANOPEN)
        guard = "communication" if gone else "no_new_sample"
        asked = fault == "silence" and line != CANOPEN
        return Promise(guard, WATCHDOG_S, not gone, asked=asked)
    if fault.endswith("reset"):
        if line == _TCP:  # the connection is reset with it
            return Promise("communication", RESET_S if fault == "short_reset" else 0.0, held=False)
        if fault == "short_reset":
            return Promise("encoder_lost", RESET_S, held=False)
        return Promise("no_new_sample", 0.0)
    passes = line.startswith("can") and fault in ("late_answers", "stuck_sequence")
    late_s = LATE_S if fault == "late_answers" else 0.0
    return Promise("no_new_sample", HOLD_S + late_s, asked=not passes and line != CANOPEN)


def device_file(line: Line, port: int, faults: list[Options]) -> str:
    """Return the device's file, with faults to order."""
    data = yaml.safe_load((SHIPPED / f"{line.device}.yaml").read_text())
    data |= {"rate_hz": 4 * line.rate_hz, "watchdog_s": WATCHDOG_S, "faults": faults}
    (bus,) = data["serve"]
    data["serve"] = {bus: _changed(data["serve"][bus], line.serve(port).get(bus, {}))}
    return yaml.safe_dump(data)


def host_file(line: Line, controller: str, endpoint: str, port: int) -> str:
    """Return the configuration at this end: slower than shipped, and on its way without a rest."""
    data: Options = copy.deepcopy(dict(load(line.config).resolved))
    share = line.rate_hz / data["rate_hz"]
    data["rate_hz"] = line.rate_hz
    (name,) = data["drivers"]
    late = {"hold_ticks": line.hold_ticks, "predict": True}
    data["drivers"][name] = _changed(data["drivers"][name], line.driver(endpoint, port))
    data["drivers"][name]["late"] = late
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
    return yaml.safe_dump(_plain(data))


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
