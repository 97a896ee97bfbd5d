"""The gantry on a CAN bus, asked by a raw host."""

from __future__ import annotations

import time
from itertools import pairwise

import can
import pytest
from gantry_device_bench import RawPort, device_data, running, until, write_device
from gantry_device_frames import (
    CHANNELS,
    DBC,
    DBC_SIGNALS,
    FRAMES,
    STATE_ID,
    SYNC_ID,
    CanPeer,
)

from motorctl.errors import ConfigError
from motorctl_devices import load_device

pytestmark = pytest.mark.wall_clock(lanes=3)

_NAMES = iter(range(10**6))


@pytest.fixture
def channel() -> str:
    return f"gantry-device-{next(_NAMES)}"


def _data(channel: str | None, interface: str = "virtual", **changes):
    serve = {"can": {"interface": interface, "sync": {"id": SYNC_ID}, "frames": FRAMES}}
    if channel is not None:
        serve["can"]["channel"] = channel
    serve["can"] |= changes.pop("can", {})
    return device_data(serve, channels=CHANNELS, **changes)


def _peer(channel: str, fd: bool = False) -> CanPeer:
    protocol = can.CanProtocol.CAN_FD if fd else can.CanProtocol.CAN_20
    return CanPeer(can.Bus(interface="virtual", channel=channel, protocol=protocol), fd)


def _move(peer: CanPeer, x: float, y: float, steps: int = 40):
    state = None
    for _ in range(steps):
        peer.command(x, y)
        time.sleep(0.002)
        state = peer.sample()
    return state


def test_volts_move_the_axis_and_sync_brings_its_counts(tmp_path, channel) -> None:
    with running(tmp_path, _data(channel)) as device, _peer(channel) as peer:
        before = peer.sample()
        after = _move(peer, 3.0, -3.0)
        assert after["counts"][0] > before["counts"][0] + 1000
        assert after["counts"][1] < before["counts"][1] - 300
        assert after["sequence"] == (before["sequence"] + 40) % 256
        assert after["chain"] == 1  # inverted: the emergency stop is not pressed
        assert after["boot"] == device.machine.boot_id % 16
        assert device.machine.volts == [pytest.approx(3.0), pytest.approx(-3.0)]


def test_nothing_is_sent_without_sync(tmp_path, channel) -> None:
    with running(tmp_path, _data(channel)), _peer(channel) as peer:
        peer.command(1.0, 0.0)
        assert peer.frame(0.1) is None


def test_without_sync_the_device_sends_by_its_own_clock(tmp_path, channel) -> None:
    data = _data(channel, rate_hz=500)
    del data["serve"]["can"]["sync"]
    with running(tmp_path, data), _peer(channel) as peer:
        peer.state()
        begun = time.monotonic()
        states = [peer.state() for _ in range(60)]
        assert 0.09 < time.monotonic() - begun < 0.4
        numbers = [state["sequence"] for state in states]
        assert all((b - a) % 256 == 1 for a, b in pairwise(numbers))


def test_the_watchdogs_time_comes_with_the_command(tmp_path, channel) -> None:
    with running(tmp_path, _data(channel, watchdog_s=10.0)) as device, _peer(channel) as peer:
        peer.command(2.0, 0.0, watchdog_ms=30)
        until(lambda: device.machine.enabled == [True, True])
        until(lambda: device.machine.watchdog_trips == 1, 0.5)
        assert device.machine.volts == [0.0, 0.0]
        assert peer.sample()["fault"] == 1
        peer.command(0.0, 0.0, enable=0)
        peer.command(2.0, 0.0, watchdog_ms=0)  # switched off
        assert peer.sample()["fault"] == 0
        time.sleep(0.1)
        assert device.machine.enabled == [True, True]


def test_frames_for_others_and_of_wrong_length_change_nothing(tmp_path, channel) -> None:
    with running(tmp_path, _data(channel)) as device, _peer(channel) as peer:
        peer.command(1.0, 0.0)
        good = b"\xff" * 8
        peer.send(0x201, good)
        peer.send(0x200, good, extended=True)
        peer.send(0x200, good[:7])
        peer.sample()
        assert device.machine.volts == [pytest.approx(1.0), 0.0]
        assert device.endpoint.refused == 1
        assert device.machine.commands == 1


def test_a_layout_from_a_dbc_file_is_the_files(tmp_path, channel) -> None:
    (tmp_path / "bench.dbc").write_text(DBC)
    data = _data(channel, can={"dbc": "bench.dbc", "signals": DBC_SIGNALS})
    del data["serve"]["can"]["frames"]
    with running(tmp_path, data) as device, _peer(channel) as peer:
        for _ in range(20):
            volts = [round(v / 0.0005).to_bytes(2, "big", signed=True) for v in (3.0, -2.0)]
            peer.send(0x200, b"".join(volts) + b"\x01\0")
            time.sleep(0.002)
        assert device.machine.volts == [pytest.approx(3.0), 0.0]  # y is not enabled
        peer.sync()
        message = peer.frame()
        assert message is not None
        assert message.arbitration_id == STATE_ID
        assert int.from_bytes(message.data[:3], "big", signed=True) > 300
        assert message.data[6] == 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"frames": {**FRAMES, "state": {**FRAMES["state"], "id": 0x200}}},
         "serve.can.frames.state.id: frame state has 0x200, as frame command has"),
        ({"sync": {"id": STATE_ID}}, "serve.can.sync.id: SYNC has 0x180, as frame state has"),
        ({"sync": {"id": 0x200}}, "serve.can.sync.id: SYNC has 0x200, as frame command has"),
    ],
)  # fmt: skip
def test_two_frames_of_one_identifier_are_refused(tmp_path, channel, change, said) -> None:
    with pytest.raises(ConfigError) as caught:
        load_device(write_device(tmp_path, _data(channel, can=change)))
    assert said in str(caught.value)


def test_two_frames_of_one_identifier_in_a_dbc_file_are_refused(tmp_path, channel) -> None:
    (tmp_path / "bench.dbc").write_text(DBC.replace("BO_ 384", "BO_ 512"))
    data = _data(channel, can={"dbc": "bench.dbc", "signals": DBC_SIGNALS})
    del data["serve"]["can"]["frames"]
    said = "serve.can.dbc: frame Command has 0x200, as frame Positions has"
    with pytest.raises(ConfigError, match=said):
        load_device(write_device(tmp_path, data))


def test_identifiers_of_11_and_29_bits_are_not_the_same(tmp_path, channel) -> None:
    sync = {"id": STATE_ID, "extended": True}
    load_device(write_device(tmp_path, _data(channel, can={"sync": sync})))


def test_fd_frames_carry_more(tmp_path, channel) -> None:
    wide = {**FRAMES["state"], "length": 12}
    data = _data(channel, can={"fd": True, "frames": {**FRAMES, "state": wide}})
    with running(tmp_path, data), _peer(channel, fd=True) as peer:
        peer.sync()
        message = peer.frame()
        assert message is not None
        assert message.is_fd
        assert len(message.data) == 12


def test_one_frame_an_axis_has_a_watchdog_an_axis(tmp_path, channel) -> None:
    signals = FRAMES["command"]["signals"]
    apart = {"state": FRAMES["state"]}
    for number, (axis, enable) in enumerate((("x", "ex"), ("y", "ey"))):
        own = {"v": {**signals[f"v{axis}"], "start": 0}, "e": {**signals[enable], "start": 16}}
        frame = {"id": 0x200 + number, "direction": "command", "length": 3, "signals": own}
        apart[axis] = frame
    data = _data(channel, can={"frames": apart}, watchdog_s=0.05)
    with running(tmp_path, data) as device, _peer(channel) as peer:
        peer.send(0x201, (1000).to_bytes(2, "little") + b"\x01")
        end = time.monotonic() + 0.12
        while time.monotonic() < end:
            peer.send(0x200, (2000).to_bytes(2, "little") + b"\x01")
            time.sleep(0.005)
        assert device.machine.enabled == [True, False]
        assert device.machine.tripped == [False, True]


def test_an_slcan_adapter_is_what_python_can_expects(tmp_path) -> None:
    link = tmp_path / "adapter"
    with running(tmp_path, _data(None, "slcan"), link) as device:
        bus = can.Bus(interface="slcan", channel=str(link), bitrate=1_000_000, sleep_after_open=0)
        with CanPeer(bus) as peer:
            assert bus.get_version(0.5) == (10, 13)  # type: ignore[attr-defined]
            before = peer.sample()
            after = _move(peer, 3.0, 0.0, 20)
            assert after["counts"][0] > before["counts"][0] + 300
            assert device.machine.commands == 20


def test_an_slcan_adapter_answers_nonsense_with_bell_and_goes_on(tmp_path) -> None:
    link = tmp_path / "adapter"
    with running(tmp_path, _data(None, "slcan"), link), RawPort(link) as port:
        port.write(b"S8\rO\r")
        assert port.read_until(b"\r\r") == b"\r\r"
        for line in (b"t08", b"t0801", b"txyz0", b"?", b"\xff\xfe", b"t0809" + b"00" * 9):
            port.write(line + b"\r")
            assert port.read_until(b"\a") == b"\a"
        port.write(b"t0800\r")
        assert port.read_until(b"\r").startswith(b"t1808")
        port.write(b"C\r")
        port.read_until(b"\r")
        port.write(b"t0800\r")
        assert port.read(0.05) == b""


def test_processes_meet_over_multicast(tmp_path) -> None:
    pytest.importorskip("msgpack")
    group = "239.74.163.57"
    data = _data(group, "udp_multicast", can={"port": 43157})
    with running(tmp_path, data):
        bus = can.Bus(interface="udp_multicast", channel=group, port=43157, fd=False)
        with CanPeer(bus) as peer:
            before = peer.sample()
            assert _move(peer, 3.0, 0.0)["counts"][0] > before["counts"][0] + 500
