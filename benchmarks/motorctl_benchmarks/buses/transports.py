"""The buses that are measured: how driver and device are described, and at what rate."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

from motorctl.errors import UsageError

Options = dict[str, Any]

AXES = ("x", "y")
WAIT = 0.75
"""Share of the period for which a driver on CAN may wait for the answers to SYNC."""


@dataclass(frozen=True)
class Transport:
    """A bus with the gantry at its other end, both sides described apart."""

    name: str
    rate_hz: float
    driver: Callable[[str], Options]
    """Returns the driver's options for the endpoint that the device reported."""
    serve: Options = field(default_factory=dict)
    """The key `serve` of the device's file."""


def transports() -> tuple[Transport, ...]:
    """Return every bus that this machine can emulate, each near its budget."""
    return (
        _serial("serial poll", 2000.0, "poll"),
        _serial("serial exchange", 2000.0, "exchange"),
        _can("can udp_multicast", 1000.0),
        _slcan("can slcan", 1400.0),
        _canopen("canopen udp_multicast", 500.0),
        _modbus_tcp("modbus tcp", 3150.0),
        _modbus_rtu("modbus rtu", 200.0),
    )


def chosen_transports(names: Collection[str]) -> tuple[Transport, ...]:
    """Return the transports of these names, all where none is given. Raises UsageError."""
    every = transports()
    known = [transport.name for transport in every]
    for name in names:
        if name not in known:
            raise UsageError(f"there is no bus '{name}' to measure; there are: {', '.join(known)}")
    return tuple(transport for transport in every if not names or transport.name in names)


def _serial(name: str, rate_hz: float, mode: str) -> Transport:
    def driver(port: str) -> Options:
        return {"type": "serial", "port": port, "baud": None, "mode": mode}

    return Transport(name, rate_hz, driver, {"serial": {}})


def frames() -> Options:
    """Return one command and one state frame of 8 bytes for two axes with 28 bit counters."""
    command: Options = {"sequence": {"means": "sequence", "start": 40, "bits": 8}}
    state: Options = {"sequence": {"means": "sequence", "start": 56, "bits": 8}}
    for k, axis in enumerate(AXES):
        volts = {"means": "volts", "axis": axis, "start": 16 * k, "bits": 16, "signed": True}
        command[f"volts_{axis}"] = volts | {"scale": 0.0005}
        command[f"enable_{axis}"] = {"means": "enable", "axis": axis, "start": 32 + k, "bits": 1}
        counts = {"means": "counts", "axis": axis, "start": 28 * k, "bits": 28, "signed": True}
        state[f"counts_{axis}"] = counts
    return {
        "command": {"id": 0x200, "direction": "command", "length": 6, "signals": command},
        "positions": {"id": 0x180, "direction": "state", "length": 8, "signals": state},
    }


def _can(name: str, rate_hz: float) -> Transport:
    bus = {"interface": "udp_multicast", "channel": "239.74.163.2", "frames": frames()}
    sync = {"sync": {"id": 0x80}}

    def driver(_endpoint: str) -> Options:
        wait = {"sync": {"id": 0x80, "wait_s": WAIT / rate_hz}}
        return {"type": "can", **bus, **wait}

    return Transport(name, rate_hz, driver, {"can": {**bus, **sync}})


def _slcan(name: str, rate_hz: float) -> Transport:
    bus = {"interface": "slcan", "frames": frames()}

    def driver(endpoint: str) -> Options:
        port = endpoint.rsplit(maxsplit=1)[-1]
        wait = {"sync": {"id": 0x80, "wait_s": WAIT / rate_hz}}
        return {"type": "can", **bus, "channel": port, "tty_baudrate": 4_000_000, **wait}

    return Transport(name, rate_hz, driver, {"can": {**bus, "sync": {"id": 0x80}}})


def _canopen(name: str, rate_hz: float) -> Transport:
    bus = {"interface": "udp_multicast", "channel": "239.74.163.5"}
    drives = [{"node": k, "rated_torque_v": 10.0} for k in range(1, len(AXES) + 1)]

    def driver(_endpoint: str) -> Options:
        nodes = dict(zip(AXES, drives, strict=True))
        sync = {"wait_s": WAIT / rate_hz}
        return {"type": "canopen", **bus, "nodes": nodes, "sync": sync, "watchdog_s": 0.2}

    return Transport(name, rate_hz, driver, {"canopen": {**bus, "nodes": drives}})


def _registers() -> Options:
    channels: Options = {}
    for k in range(len(AXES)):
        volts = {"address": k, "bits": 16, "signed": True, "volts_per_count": 10.0 / 32767.0}
        channels[str(k)] = {
            "volts": volts,
            "enable": {"address": 2, "bit": k},
            "counts": {"address": 2 * k, "bits": 32, "signed": True},
        }
    return {"channels": channels, "sequence": {"output": 3, "input": 4}}


def _modbus_tcp(name: str, rate_hz: float) -> Transport:
    def driver(endpoint: str) -> Options:
        host, _, port = endpoint.rpartition(":")
        line = {"tcp": {"host": host, "port": int(port)}, "device_turnaround_s": 0.1e-3}
        return {"type": "modbus", **line, **_registers()}

    serve = {"modbus": {"tcp": {"host": "127.0.0.1", "port": 0}, **_registers()}}
    return Transport(name, rate_hz, driver, serve)


def _modbus_rtu(name: str, rate_hz: float) -> Transport:
    def driver(port: str) -> Options:
        line = {"rtu": {"port": port, "baud": 1_000_000, "parity": "none"}}
        return {"type": "modbus", **line, **_registers()}

    return Transport(name, rate_hz, driver, {"modbus": {"rtu": {}, **_registers()}})


def counter_bits(transport: Transport) -> int:
    """Return the width of the device's counters [bits]."""
    return 28 if "can" in transport.serve else 32


def merged(base: Mapping[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    """Return a mapping with changes, nested ones key by key."""
    result = dict(base)
    for key, value in change.items():
        before = result.get(key)
        nested = isinstance(value, Mapping) and isinstance(before, Mapping)
        result[key] = merged(before or {}, value) if nested else value
    return result
