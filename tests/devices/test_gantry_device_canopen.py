"""The gantry as CiA 402 drives, asked by the `canopen` package's own master and by the driver."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import canopen
import numpy as np
import pytest
import real_time
from canopen.sdo import SdoAbortedError
from canopen_peer import STATUSWORD, object_dictionary
from gantry_device_bench import device_data, running, until, write_device

from motorctl.errors import ConfigError
from motorctl.hal import Channel, Inputs, Outputs, error_code
from motorctl_canopen import CanopenDriver, CanopenOptions
from motorctl_devices import load_device

pytestmark = pytest.mark.wall_clock(lanes=3)

_NAMES = iter(range(10**6))
NODES = [{"node": 1, "rated_torque_v": 10.0}, {"node": 2, "rated_torque_v": 10.0}]
HOST, COUNTS = 100, 1000


@pytest.fixture
def channel() -> str:
    return f"gantry-drives-{next(_NAMES)}"


def _data(channel: str, **changes: Any) -> dict[str, Any]:
    nodes = changes.pop("nodes", NODES)
    serve = {"canopen": {"interface": "virtual", "channel": channel, "nodes": nodes}}
    return device_data(serve, **changes)


@contextmanager
def _master(channel: str) -> Iterator[canopen.RemoteNode]:
    """Yield node 1, as the package's master sees it, on a network that sends SYNC."""
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.02
    real_time.begins()
    network.connect(interface="virtual", channel=channel)
    node = network.add_node(1, object_dictionary(1))
    node.sdo.RESPONSE_TIMEOUT = 2.0
    try:
        yield node
    finally:
        network.sync.stop()
        network.disconnect()


def _set_up(node: canopen.RemoteNode) -> None:
    """Map and start the drive by the package's own means."""
    node.nmt.state = "PRE-OPERATIONAL"
    for pdo, names in ((node.rpdo[1], ("Controlword", "Target torque")),
                       (node.tpdo[1], ("Statusword", "Position"))):  # fmt: skip
        pdo.read()
        pdo.clear()
        for name in names:
            pdo.add_variable(name)
        pdo.trans_type, pdo.enabled = 1, True
        pdo.save()
    node.sdo["Mode"].raw = 10
    node.nmt.state = "OPERATIONAL"
    node.network.sync.start(0.005)


def _enable(node: canopen.RemoteNode, torque: int) -> None:
    for word, state in (
        (0x00, None),
        (0x80, "SWITCH ON DISABLED"),
        (0x06, "READY TO SWITCH ON"),
        (0x07, "SWITCHED ON"),
        (0x0F, "OPERATION ENABLED"),
    ):
        node.rpdo[1]["Controlword"].raw = word
        node.rpdo[1]["Target torque"].raw = torque
        node.rpdo[1].transmit()
        if state is None:
            time.sleep(0.03)
        else:
            until(lambda state=state: _state(node) == state)


def _state(node: canopen.RemoteNode) -> str:
    word = node.tpdo[1]["Statusword"].raw & 0x6F
    return next(name for name, value in STATUSWORD.items() if value == word)


def _told(node: canopen.RemoteNode) -> int:
    """Return the code of the last emergency message that tells an error."""
    return node.emcy.active[-1].code if node.emcy.active else 0


def test_torque_moves_the_axis_in_operation_enabled(tmp_path: Path, channel: str):
    with running(tmp_path, _data(channel)) as device, _master(channel) as node:
        assert node.sdo["Device type"].raw & 0xFFFF == 402
        _set_up(node)
        until(lambda: _state(node) == "SWITCH ON DISABLED")
        first = node.tpdo[1]["Position"].raw
        _enable(node, 300)
        until(lambda: node.tpdo[1]["Position"].raw > first + COUNTS)
        assert device.machine.volts[0] == pytest.approx(3.0)
        assert device.machine.enabled == [True, False]


def test_without_the_hosts_heartbeat_a_drive_goes_into_fault_and_tells_why(
    tmp_path: Path, channel: str
):
    with running(tmp_path, _data(channel)) as device, _master(channel) as node:
        node.sdo["Consumer heartbeat"][1].raw = HOST << 16 | 100
        _set_up(node)
        _enable(node, 0)
        node.network.send_message(0x700 + HOST, b"\5")
        until(lambda: _told(node) == 0x8130)
        until(lambda: _state(node) == "FAULT")
        until(lambda: not device.machine.enabled[0])
        _enable(node, 0)  # its second word resets the fault


def test_a_silent_drive_hears_and_tells_nothing_while_the_other_does(tmp_path: Path, channel: str):
    silent = {"kind": "drive_silent", "at_s": 0.1, "channel": 1}
    with running(tmp_path, _data(channel, faults=[silent])) as device, _master(channel) as node:
        other = node.network.add_node(2, object_dictionary(2))
        other.sdo.RESPONSE_TIMEOUT = 0.1
        assert other.sdo["Device type"].raw & 0xFFFF == 402
        _set_up(node)
        _enable(node, 0)  # the device's clock begins with the first power
        until(lambda: device.schedule.faults[0].fired == 1, 1.0)
        with pytest.raises(canopen.SdoCommunicationError):
            _ = other.sdo["Device type"].raw
        assert node.sdo["Device type"].raw & 0xFFFF == 402


def test_a_drive_without_commands_goes_into_fault_by_itself(tmp_path: Path, channel: str):
    with running(tmp_path, _data(channel, watchdog_s=0.1)), _master(channel) as node:
        _set_up(node)
        _enable(node, 0)
        until(lambda: _told(node) == 0x8250)


def test_what_cannot_be_mapped_or_written_is_refused_by_its_abort(tmp_path: Path, channel: str):
    with running(tmp_path, _data(channel)), _master(channel) as node:
        for index, sub, value, code in (
            (0x1600, 1, 0x60640020, 0x06040041),
            (0x6041, 0, 1, 0x06010002),
            (0x6060, 0, 8, 0x06090030),
        ):
            entry = node.sdo[index][sub] if sub else node.sdo[index]
            with pytest.raises(SdoAbortedError) as no:
                entry.raw = value
            assert no.value.code == code


def test_the_driver_moves_both_axes_and_reads_their_places(tmp_path: Path, channel: str):
    given = {
        "interface": "virtual",
        "channel": channel,
        "sync": {"wait_s": 0.05},
        "watchdog_s": 0.3,
        "heartbeat_s": 0.2,
        "nodes": dict(zip("xy", NODES, strict=True)),
    }
    channels = [Channel(axis, i, 0.5e-6, 32, 10.0) for i, axis in enumerate("xy")]
    made = CanopenDriver(CanopenOptions.model_validate(given), channels, 5e-3)
    inputs, outputs = Inputs(2), Outputs(2)
    with running(tmp_path, _data(channel)) as device:
        made.open()
        made.read(inputs)
        first = inputs.counts.copy()

        def moved() -> bool:
            made.read(inputs)
            made.write(outputs)
            return bool((np.abs(inputs.counts - first) > COUNTS).all())

        outputs.enable[:], outputs.volts[:] = 1, (3.0, -3.0)
        until(moved)
        assert (np.sign(inputs.counts - first) == (1, -1)).all()
        assert error_code(int(inputs.status[0])) == 0
        made.close()
        until(lambda: device.machine.enabled == [False, False])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"nodes": NODES[:1]}, "one for each of the 2 channels"),
        ({"nodes": [NODES[0], NODES[0]]}, "found the nodes"),
        (
            {"channels": [{"resolution_m": 1e-6, "counter_bits": 24, "max_voltage_v": 10.0}] * 2},
            "tells its position with 32 bits",
        ),
    ],
)
def test_drives_that_do_not_fit_the_channels_are_refused(tmp_path: Path, changes, message):
    with pytest.raises(ConfigError, match=message):
        load_device(write_device(tmp_path, _data("any", **changes)))
