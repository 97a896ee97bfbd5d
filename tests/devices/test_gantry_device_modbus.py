"""The gantry behind Modbus, asked by a raw client."""

from __future__ import annotations

import struct
import time

import pytest
from gantry_device_bench import (
    MODBUS,
    RawPort,
    TcpPeer,
    device_data,
    exchange_pdu,
    modbus_crc,
    running,
    state_of,
    until,
)

pytestmark = pytest.mark.wall_clock(lanes=3)

TCP = {"modbus": {"tcp": {"port": 0}, **MODBUS}}
RTU = {"modbus": {"rtu": {}, **MODBUS}}
COUPLER = {
    "modbus": {
        "tcp": {"port": 0},
        "coupler": "beckhoff_bk9000",
        **{key: value for key, value in MODBUS.items() if key != "output_base"},
    }
}


def _drive(peer: TcpPeer, volts: tuple[float, float], seconds: float) -> dict:
    end = time.monotonic() + seconds
    state = peer.exchange(volts)
    while time.monotonic() < end:
        time.sleep(0.002)
        state = peer.exchange(volts)
    return state


def test_volts_move_the_axis_that_they_are_for(tmp_path) -> None:
    with running(tmp_path, device_data(TCP)) as device, TcpPeer(device.endpoint.address) as peer:
        before = peer.exchange((0.0, 0.0))
        after = _drive(peer, (3.0, 0.0), 0.1)
        assert after["counts"][0] - before["counts"][0] > 2000
        assert abs(after["counts"][1] - before["counts"][1]) < 20
        back = _drive(peer, (-6.0, 0.0), 0.15)
        assert back["counts"][0] < after["counts"][0]
        moved = device.machine.travelled_counts()[0]
        assert moved[1] >= after["counts"][0] - before["counts"][0]


def test_a_disabled_axis_gets_no_volts(tmp_path) -> None:
    with running(tmp_path, device_data(TCP)) as device, TcpPeer(device.endpoint.address) as peer:
        before = peer.exchange((5.0, 5.0), enable=0)
        time.sleep(0.05)
        after = peer.exchange((5.0, 5.0), enable=0)
        assert max(abs(a - b) for a, b in zip(after["counts"], before["counts"], strict=True)) < 20
        assert device.machine.volts == [0.0, 0.0]


def test_a_command_acts_only_on_what_is_sampled_after_it(tmp_path) -> None:
    still = {"preset": "published_gantry_clean", "plants": {0: {"offset_v": 0.0}}}
    data = device_data(TCP, gantry=still)
    with running(tmp_path, data) as device, TcpPeer(device.endpoint.address) as peer:
        first = peer.exchange((0.0, 0.0))
        time.sleep(0.05)
        second = peer.exchange((10.0, 10.0))
        assert abs(second["counts"][0] - first["counts"][0]) < 3
        time.sleep(0.02)
        assert peer.exchange((0.0, 0.0))["counts"][0] > second["counts"][0] + 100


def test_the_reply_shows_the_sequence_of_its_own_request_and_the_start(tmp_path) -> None:
    with running(tmp_path, device_data(TCP)) as device, TcpPeer(device.endpoint.address) as peer:
        states = [peer.exchange((0.0, 0.0), sequence=number) for number in (1, 2, 65535, 1)]
        assert [state["sequence"] for state in states] == [1, 2, 65535, 1]
        assert {state["boot"] for state in states} == {device.machine.boot_id & 0xFFFF}


@pytest.mark.parametrize(
    ("pdu", "code"),
    [
        (struct.pack(">BHH", 2, 0, 1), 1),  # no such function
        (struct.pack(">BHH", 3, 100, 1), 2),  # no such register
        (struct.pack(">BHH", 3, 0, 0), 3),  # no registers
        (struct.pack(">BHH", 3, 0, 126), 3),
        (struct.pack(">BHHB", 16, 0x0800, 2, 4) + b"\0\0", 3),  # half of the values
        (struct.pack(">BHHB", 16, 0x0000, 1, 2) + b"\0\0", 2),  # what is shown cannot be written
        (b"\x03\0", 3),
    ],
)
def test_what_cannot_be_served_is_answered_with_its_exception(tmp_path, pdu, code) -> None:
    with running(tmp_path, device_data(TCP)) as device, TcpPeer(device.endpoint.address) as peer:
        assert peer.ask(pdu) == bytes((pdu[0] | 0x80, code))
        assert peer.exchange((0.0, 0.0))["status"] == 0


def test_reading_and_writing_apart_do_what_one_exchange_does(tmp_path) -> None:
    with running(tmp_path, device_data(TCP)) as device, TcpPeer(device.endpoint.address) as peer:
        write = struct.pack(">BHHBhhHH", 16, 0x0800, 4, 8, 9830, 0, 1, 7)
        assert peer.ask(write) == write[:5]
        assert device.machine.volts[0] == pytest.approx(3.0, abs=1e-3)
        for function in (3, 4):
            answer = peer.ask(struct.pack(">BHH", function, 9, 1))
            assert answer == struct.pack(">BBH", function, 2, 7)
        assert peer.ask(struct.pack(">BHH", 3, 0x0800, 1)) == struct.pack(">BBH", 3, 2, 9830)
        peer.ask(struct.pack(">BHH", 6, 0x0802, 0))
        assert device.machine.enabled == [False, False]


def test_the_watchdog_takes_the_volts_away_and_says_so(tmp_path) -> None:
    data = device_data(TCP, watchdog_s=0.03)
    with running(tmp_path, data) as device, TcpPeer(device.endpoint.address) as peer:
        peer.exchange((1.0, 0.0))
        assert device.machine.enabled == [True, True]
        until(lambda: device.machine.watchdog_trips == 1, 0.5)
        assert device.machine.enabled == [False, False]
        assert device.machine.volts == [0.0, 0.0]
        state = peer.exchange((1.0, 0.0))
        assert state["status"] == 1 << 1 | 1 << 7  # amplifier_fault of both
        assert device.machine.enabled == [False, False]
        peer.exchange((0.0, 0.0), enable=0)
        assert peer.exchange((1.0, 0.0))["status"] == 0
        assert device.machine.enabled == [True, True]


def test_commands_in_time_keep_the_watchdog_quiet(tmp_path) -> None:
    data = device_data(TCP, watchdog_s=0.1)
    with running(tmp_path, data) as device, TcpPeer(device.endpoint.address) as peer:
        _drive(peer, (0.5, 0.0), 0.3)
        assert device.machine.watchdog_trips == 0


def test_several_requests_in_one_piece_and_one_in_pieces_are_all_served(tmp_path) -> None:
    with running(tmp_path, device_data(TCP)) as device, TcpPeer(device.endpoint.address) as peer:
        pdu = struct.pack(">BHH", 3, 10, 1)
        adu = struct.pack(">HHHB", 7, 0, len(pdu) + 1, 1) + pdu
        peer.socket.sendall(adu * 3)
        assert [peer.receive()[0] for _ in range(3)] == [7, 7, 7]
        for byte in adu:
            peer.socket.sendall(bytes((byte,)))
        assert peer.receive()[0] == 7
        peer.send(pdu, unit=9)
        with pytest.raises(TimeoutError):
            peer.receive()


def test_low_word_first_swaps_the_words_of_counts(tmp_path) -> None:
    swapped = {"modbus": {**TCP["modbus"], "word_order": "low_first"}}
    data = device_data(swapped, gantry={"plants": {0: {"initial_position_m": 0.1}}})
    with running(tmp_path, data) as device, TcpPeer(device.endpoint.address) as peer:
        low, high = struct.unpack(">HH", peer.ask(struct.pack(">BHH", 3, 0, 2))[2:])
        assert abs((high << 16 | low) - 200000) < 2000


def test_the_couplers_watchdog_answers_exchanges_with_exception_4_until_it_is_reset(
    tmp_path,
) -> None:
    with running(tmp_path, device_data(COUPLER)) as device, TcpPeer(device.endpoint.address) as p:
        assert p.ask(struct.pack(">BHH", 3, 0x1120, 1)) == struct.pack(">BBH", 3, 2, 1000)
        p.ask(struct.pack(">BHH", 6, 0x1120, 40))
        assert p.ask(struct.pack(">BHH", 3, 0x100C, 1)) == struct.pack(">BBH", 3, 2, 0)
        p.exchange((1.0, 0.0))
        assert p.ask(struct.pack(">BHH", 6, 0x1120, 50)) == bytes((0x86, 3))  # it is active
        until(lambda: device.machine.watchdog_trips == 1, 0.5)
        assert p.ask(exchange_pdu((1.0, 0.0))) == bytes((0x97, 4))
        assert p.ask(struct.pack(">BHH", 3, 0x100C, 1)) == struct.pack(">BBH", 3, 2, 0x8000)
        for word in (0xBECF, 0xAFFE):
            p.ask(struct.pack(">BHH", 6, 0x1121, word))
        assert p.ask(struct.pack(">BHH", 3, 0x100C, 1)) == struct.pack(">BBH", 3, 2, 0)
        assert p.exchange((1.0, 0.0))["sequence"] == 1
        assert device.machine.enabled == [True, True]


def _rtu(pdu: bytes, unit: int = 1) -> bytes:
    body = bytes((unit,)) + pdu
    return body + struct.pack("<H", modbus_crc(body))


def test_rtu_moves_axes_too_and_its_frames_have_right_checksums(tmp_path) -> None:
    link = tmp_path / "port"
    with running(tmp_path, device_data(RTU), link) as device, RawPort(link) as port:
        counts = []
        for number in range(1, 30):
            port.write(_rtu(exchange_pdu((3.0, -3.0), 3, number)))
            answer = port.read_bytes(27)
            assert modbus_crc(answer) == 0
            state = state_of(answer[1:-2])
            assert state["sequence"] == number
            counts.append(state["counts"])
            time.sleep(0.003)
        assert counts[-1][0] > counts[0][0] + 1000
        assert counts[-1][1] < counts[0][1] - 100
        assert device.endpoint.refused == 0


def test_rtu_is_silent_to_other_units_broadcasts_and_wrong_checksums(tmp_path) -> None:
    link = tmp_path / "port"
    with running(tmp_path, device_data(RTU), link) as device, RawPort(link) as port:
        good = _rtu(struct.pack(">BHH", 3, 10, 1))
        for wrong in (
            _rtu(struct.pack(">BHH", 3, 10, 1), unit=2),
            good[:-1] + bytes((good[-1] ^ 1,)),
            good[:5],
            _rtu(struct.pack(">BHHB", 16, 0x0800, 4, 8) + struct.pack(">hhHH", 3277, 0, 1, 1), 0),
        ):
            port.write(wrong)
            assert port.read(0.05) == b""
        assert device.machine.volts[0] == pytest.approx(1.0, abs=1e-3)  # a broadcast is obeyed
        port.write(good)
        assert len(port.read_bytes(7)) == 7


def test_the_link_is_there_while_the_device_is(tmp_path) -> None:
    link = tmp_path / "port"
    with running(tmp_path, device_data(RTU), link) as device:
        assert str(link.readlink()) == device.endpoint.address
    assert not link.is_symlink()
