"""A device file becomes a device, or all its problems at once."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motorctl.config.shipped import locate
from motorctl.config.validation import validate, validate_options
from motorctl.errors import Problem, UsageError
from motorctl.hal import Channel, driver_class
from motorctl.located_yaml import Document, read_document
from motorctl_devices import modbus_layout
from motorctl_devices.canopen_shape import CanopenShape
from motorctl_devices.device import Device
from motorctl_devices.device_schema import DeviceShape, ServeShape
from motorctl_devices.endpoint import Endpoint
from motorctl_devices.machine import Machine
from motorctl_devices.modbus_image import Coupler, Image
from motorctl_devices.modbus_layout import ModbusShape
from motorctl_devices.modbus_server import ModbusEndpoint, ModbusRtu, ModbusTcp
from motorctl_devices.schedule import Schedule
from motorctl_devices.serial_box import SerialBox, SerialShape, Traits

if TYPE_CHECKING:  # its libraries are an extra, which a device on another bus does without
    from motorctl_devices.can_device import CanDevice

CAN, CANOPEN = ("serve", "can"), ("serve", "canopen")
SHIPPED = Path(__file__).parent / "shipped"
"""Device files that a user may call by their bare names."""


def load_device(path: Path, link: Path | None = None) -> Device:
    """Read a device file, or a shipped one by its bare name, and build the device, not opened yet.

    Parameters
    ----------
    path
        The file, or the name of a shipped one.
    link
        What becomes a symbolic link to the device's serial port; None: no link.

    Returns
    -------
    Device
        The gantry behind its bus, with the faults that the file orders.

    Raises
    ------
    ConfigError
        With every problem of the file.
    UsageError
        Where there is no port to link to.
    """
    path = locate(path, SHIPPED)
    document = read_document(path)
    shape, problems = validate(document, (), DeviceShape, document.data)
    can, refused = _read_can(document)
    problems += refused
    problems += _missing_library(document)
    sim = driver_class("sim")
    gantry = document.data.get("gantry", {})
    options = None
    if isinstance(gantry, dict):
        options, refused = validate_options(document, ("gantry",), sim.Options, gantry, ())
        problems += refused
    if shape is not None:
        problems += _check_channels(document, shape)
        if can is not None:
            problems += can.lay_out(document, _axes(shape), _bits(shape), path.parent)
        problems += _check_silence(document, shape, _heard_apart(shape, can))
    document.refuse(problems)
    assert shape is not None
    assert options is not None

    # The machine wraps the counters itself, so that it can put them near their ends.
    channels = [
        Channel(c.axis or f"axis{i}", i, c.resolution_m, 64, c.max_voltage_v)
        for i, c in enumerate(shape.channels)
    ]
    machine = Machine(
        sim(options, channels, 1.0 / shape.rate_hz),
        _bits(shape),
        shape.watchdog_s,
        _wraps(shape),
        _signed(shape, can),
    )
    schedule = Schedule(shape.faults, shape.seed)
    serve = shape.serve
    _check_link(serve, can, link)
    endpoint: Endpoint[Any]
    if can is not None:
        endpoint = can.node(machine, schedule, shape.rate_hz, link)
    elif serve.canopen is not None:
        endpoint = _canopen(serve.canopen, machine, schedule)
    elif serve.serial is not None:
        endpoint = SerialBox(machine, schedule.faults, _traits(shape, serve.serial), link)
    else:
        assert serve.modbus is not None
        endpoint = _modbus(serve.modbus, machine, schedule, link)
    return Device(machine, endpoint, schedule, shape.spin_s)


def _read_can(document: Document) -> tuple[CanDevice | None, list[Problem]]:
    """Return what the file says of CAN, None where that is nothing or wrong, and its problems."""
    given = document.at(CAN)
    if not isinstance(given, dict):
        return None, []
    try:
        from motorctl_devices.can_device import CanDevice
        from motorctl_devices.can_layout import CanShape
    except ModuleNotFoundError as error:
        message = f"module '{error.name}' is missing; pip install 'motorctl[can]'"
        return None, [document.problem(CAN, message)]
    shape, problems = validate(document, CAN, CanShape, given)
    return None if shape is None else CanDevice(shape), problems


def _missing_library(document: Document) -> list[Problem]:
    if document.at(CANOPEN) is not None and importlib.util.find_spec("can") is None:
        message = "module 'can' is missing; pip install 'motorctl[canopen]'"
        return [document.problem(CANOPEN, message)]
    return []


def _check_channels(document: Document, shape: DeviceShape) -> list[Problem]:
    """Find what does not fit between channels, faults and bus; CAN looks at its own frames."""
    problems: list[Problem] = []

    def add(message: str, *where: str | int) -> None:
        problems.append(document.problem(where, message))

    bits, names = _bits(shape), _axes(shape)
    if len(set(names)) < len(names):
        add(f"two channels have the same axis: {', '.join(names)}", "channels")
    for number, order in enumerate(shape.faults):
        if order.channel is not None and order.channel >= len(bits):
            message = f"found {order.channel}, the device has {len(bits)} channels, from 0"
            add(message, "faults", number, "channel")
    if shape.serve.modbus is not None:
        for where, message in modbus_layout.problems(shape.serve.modbus, bits):
            add(message, "serve", "modbus", *where)
    elif shape.serve.canopen is not None:
        nodes = [drive.node for drive in shape.serve.canopen.nodes]
        if len(nodes) != len(bits) or len(set(nodes)) < len(nodes):
            message = (
                f"found the nodes {nodes}: one for each of the {len(bits)} channels, all other"
            )
            add(message, "serve", "canopen", "nodes")
        if set(bits) != {32}:
            add("a drive of CiA 402 tells its position with 32 bits", "channels")
    elif shape.serve.serial is not None and (len(set(bits)) > 1 or max(bits) > 32):
        message = "the serial box tells one width for all counters, of at most 32 bits"
        add(message, "channels")
    return problems


def _heard_apart(shape: DeviceShape, can: CanDevice | None) -> set[int]:
    """Return the channels whose drive has messages of its own."""
    if shape.serve.canopen is not None:
        return set(range(len(shape.channels)))
    return can.heard_apart() if can else set()


def _check_silence(document: Document, shape: DeviceShape, apart: set[int]) -> list[Problem]:
    """Find drives that shall be silent and have no message of their own."""
    return [
        document.problem(
            ("faults", number, "channel"),
            f"found {order.channel}: a drive can be silent alone on CANopen, or with a state frame "
            "of its own on CAN; where one message tells of all channels, order silence",
        )
        for number, order in enumerate(shape.faults)
        if order.kind == "drive_silent" and order.channel not in apart
    ]


def _check_link(serve: ServeShape, can: CanDevice | None, link: Path | None) -> None:
    has_port = (
        serve.serial is not None
        or (serve.modbus is not None and serve.modbus.rtu is not None)
        or (can is not None and can.has_port)
    )
    if link is not None and not has_port:
        raise UsageError("--link: this device has no serial port to link to")


def _axes(shape: DeviceShape) -> list[str]:
    return [channel.axis or f"axis{i}" for i, channel in enumerate(shape.channels)]


def _bits(shape: DeviceShape) -> list[int]:
    return [channel.counter_bits for channel in shape.channels]


def _wraps(shape: DeviceShape) -> list[int | None]:
    wraps: list[int | None] = [None] * len(shape.channels)
    for order in shape.faults:
        if order.kind == "counter_wrap":
            hit = range(len(wraps)) if order.channel is None else (order.channel,)
            for channel in hit:
                wraps[channel] = order.counts
    return wraps


def _signed(shape: DeviceShape, can: CanDevice | None) -> list[bool]:
    """Tell which counters the wire shows as signed numbers, so where they wrap."""
    signed = [True] * len(shape.channels)
    if shape.serve.modbus is not None:
        for number, channel in shape.serve.modbus.channels.items():
            signed[number] = channel.counts.signed
    if can is not None:
        for number, is_signed in can.signed_counters().items():
            signed[number] = is_signed
    return signed


def _traits(shape: DeviceShape, serial: SerialShape) -> Traits:
    return Traits(
        serial,
        shape.channels[0].counter_bits,
        max(channel.max_voltage_v for channel in shape.channels),
        serial.max_rate_hz or min(65535, int(shape.rate_hz)),
        int(serial.longest_watchdog_s * 1000),
    )


def _canopen(shape: CanopenShape, machine: Machine, schedule: Schedule) -> Endpoint[Any]:
    from motorctl_devices.can_bus import LibraryBus
    from motorctl_devices.canopen_node import CanopenDrives

    multicast = shape.interface == "udp_multicast"
    settings: dict[str, Any] = {"port": shape.port, "hop_limit": 0} if multicast else {}
    bus = LibraryBus(shape.interface, shape.channel, **settings)
    return CanopenDrives(machine, schedule.faults, bus, shape.nodes)


def _modbus(
    modbus: ModbusShape, machine: Machine, schedule: Schedule, link: Path | None
) -> ModbusEndpoint:
    endpoint: ModbusEndpoint
    echoes = modbus.sequence is not None
    if modbus.tcp is not None:
        host, port = modbus.tcp.host, modbus.tcp.port
        endpoint = ModbusTcp(machine, schedule.faults, modbus.unit, echoes, host, port)
    else:
        endpoint = ModbusRtu(machine, schedule.faults, modbus.unit, echoes, link)
    make = Image if modbus.coupler is None else Coupler
    endpoint.image = make(modbus, machine, endpoint.time_ns, endpoint.echo)
    return endpoint
