"""The gantry behind a serial line, spoken to by a raw host."""

from __future__ import annotations

import re
import struct
import time
from pathlib import Path

import pytest
from gantry_device_bench import SerialPeer, device_data, running, until
from hypothesis import given
from hypothesis import strategies as st

from motorctl_devices.serial_codec import from_wire, to_wire

pytestmark = pytest.mark.wall_clock(lanes=3)

SERIAL: dict = {"serial": {}}
PAGE = Path(__file__).parents[2] / "docs" / "drivers" / "serial.md"
HELLO, COMMAND, EXCHANGE, POLL, START, STOP, SAFE = range(1, 8)
IN_FORCE, WATCHDOG, REFUSED = 1, 2, 4


def _error(body: bytes) -> tuple[int, int, int, int]:
    assert body[0] == 0x83, body.hex()
    return struct.unpack("<BBBH", body[2:])


def test_the_pages_vectors_are_what_travels() -> None:
    rows = re.findall(
        r"^\| \w+ \| `([0-9a-f ]+)` \| `\w+` \| `([0-9a-f ]+)` \|", PAGE.read_text(), re.M
    )
    assert len(rows) >= 10
    for body, wire in rows:
        assert to_wire(bytes.fromhex(body)).hex(" ") == wire
        assert from_wire(bytes.fromhex(wire)[:-1]) == bytes.fromhex(body)


@given(st.binary(min_size=2, max_size=250))
def test_every_body_comes_back_from_its_wire(body) -> None:
    wire = to_wire(body)
    assert len(wire) == len(body) + 4
    assert wire.index(0) == len(wire) - 1
    assert from_wire(wire[:-1]) == body


@given(st.binary(max_size=300))
def test_no_bytes_make_the_decoder_fail(noise) -> None:
    body = from_wire(noise)
    assert body is None or to_wire(body)[:-1] == noise


def test_hello_is_answered_with_what_the_box_is(tmp_path) -> None:
    with running(tmp_path, device_data(SERIAL)) as device, SerialPeer(device.endpoint.address) as p:
        body = p.hello(watchdog_ms=20)
        assert len(body) == 36
        told = struct.unpack("<BBBBBBHHII16s", body[2:])
        assert told[:2] == (1, 1)
        assert told[3:8] == (2, 32, 7, 20, 5000)
        assert told[8] == device.machine.boot_id
        assert told[9] == 10_000_000
        assert told[10] == b"simulated gantry"


def test_poll_and_command_move_the_axis(tmp_path) -> None:
    with running(tmp_path, device_data(SERIAL)) as device, SerialPeer(device.endpoint.address) as p:
        p.hello()
        before = p.poll()
        for _ in range(40):
            sent = p.command((3.0, 0.0))
            state = p.poll()
            assert state["in_force"] == sent
            assert state["flags"] == IN_FORCE
            time.sleep(0.002)
        assert state["counts"][0] > before["counts"][0] + 1000
        assert state["sample"] == before["sample"] + 40
        assert device.machine.volts[0] == pytest.approx(3.0, abs=1e-3)


def test_exchange_does_both_at_once(tmp_path) -> None:
    with running(tmp_path, device_data(SERIAL)) as device, SerialPeer(device.endpoint.address) as p:
        p.hello(mode=2)
        states = []
        for _ in range(40):
            sent = p.command((0.0, 5.0), kind=EXCHANGE)
            states.append(p.state())
            assert states[-1]["answers"] == states[-1]["in_force"] == sent
            time.sleep(0.002)
        assert states[-1]["counts"][1] > states[0]["counts"][1] + 500


def test_a_stream_comes_by_the_devices_clock_until_it_is_stopped(tmp_path) -> None:
    with running(tmp_path, device_data(SERIAL)) as device, SerialPeer(device.endpoint.address) as p:
        p.hello(mode=4, period_us=2000)
        sent = p.send(START)
        begun = time.monotonic()
        states = [p.state() for _ in range(50)]
        took = time.monotonic() - begun
        assert 0.07 < took < 0.3
        assert {state["answers"] for state in states} == {sent}
        samples = [state["sample"] for state in states]
        assert samples == list(range(samples[0], samples[0] + 50))
        p.send(STOP)
        while p.read(0.05):
            pass
        assert p.poll()["sample"] > samples[-1]
        assert device.endpoint.refused == 0


def test_the_watchdog_zeroes_and_holds_until_nothing_is_enabled(tmp_path) -> None:
    with running(tmp_path, device_data(SERIAL)) as device, SerialPeer(device.endpoint.address) as p:
        p.hello(watchdog_ms=20)
        p.command((2.0, 0.0), enable=1)
        until(lambda: device.machine.watchdog_trips == 1, 0.5)
        assert device.machine.volts == [0.0, 0.0]
        for _ in range(2):  # it stays, though commands come
            state = p.poll()
            assert (state["flags"], state["in_force"]) == (WATCHDOG, 0)
            assert [word & 4 for word in state["status"]] == [4, 4]
            p.command((2.0, 0.0), enable=1)
            time.sleep(0.005)
            assert device.machine.enabled == [False, False]
        sent = p.command((0.0, 0.0), enable=0)
        state = p.poll()
        assert (state["flags"], state["in_force"], state["status"]) == (IN_FORCE, sent, [0, 0])
        p.command((2.0, 0.0), enable=1)
        assert p.poll()["flags"] == IN_FORCE
        assert device.machine.enabled == [True, False]


def test_polls_do_not_feed_the_watchdog(tmp_path) -> None:
    with running(tmp_path, device_data(SERIAL)) as device, SerialPeer(device.endpoint.address) as p:
        p.hello(watchdog_ms=30)
        p.command((1.0, 0.0))
        for _ in range(30):
            p.poll()
            time.sleep(0.002)
        assert device.machine.watchdog_trips == 1


@pytest.mark.parametrize(
    ("fields", "code", "detail"),
    [
        ((2, 2, 1, 0, 20, 1000), 1, 0x0101),
        ((1, 0, 1, 0, 20, 1000), 9, 3),
        ((1, 2, 3, 0, 20, 1000), 9, 4),
        ((1, 2, 1, 7, 20, 1000), 9, 5),
        ((1, 2, 1, 0, 0, 1000), 9, 6),
        ((1, 2, 1, 0, 20, 0), 9, 8),
        ((1, 3, 1, 0, 20, 1000), 3, 2),
        ((1, 2, 4, 0, 20, 1000), 4, 3),
        ((1, 2, 1, 0, 20, 100), 5, 5000),
        ((1, 2, 1, 0, 2000, 1000), 6, 1000),
    ],
)
def test_a_hello_that_cannot_be_is_refused_with_its_reason(tmp_path, fields, code, detail) -> None:
    serve = {"serial": {"modes": ["poll", "exchange"], "longest_watchdog_s": 1.0}}
    with running(tmp_path, device_data(serve)) as device, SerialPeer(device.endpoint.address) as p:
        p.receive()  # the announcement of the start
        sent = p.send(HELLO, struct.pack("<BBBBHI", *fields))
        assert _error(p.receive()) == (code, HELLO, sent, detail)
        sent = p.send(POLL)
        assert _error(p.receive()) == (2, POLL, sent, 0)  # there is no session
        assert device.endpoint.refused == 0


def test_wrong_frames_are_answered_or_shown_and_change_nothing(tmp_path) -> None:
    with running(tmp_path, device_data(SERIAL)) as device, SerialPeer(device.endpoint.address) as p:
        p.hello()
        good = p.command((1.0, 0.0))
        assert p.poll()["in_force"] == good
        p.send(COMMAND, b"\x03\0\0")  # too short
        state = p.poll()
        assert (state["in_force"], state["flags"]) == (good, IN_FORCE | REFUSED)
        assert p.poll()["flags"] == IN_FORCE
        sent = p.send(EXCHANGE, struct.pack("<Bhh", 3, 0, -32768))
        assert _error(p.receive()) == (9, EXCHANGE, sent, 5)
        sent = p.send(POLL, b"\0")
        assert _error(p.receive()) == (7, POLL, sent, 2)
        sent = p.send(0x55)
        assert _error(p.receive()) == (8, 0x55, sent, 0)
        p.send(0x82, b"echo of the device's own frame")
        p.write(b"\x09noise\0\0\0" + bytes(range(1, 256)) * 2 + b"\0")
        assert p.poll()["in_force"] == good
        assert device.machine.volts[0] == pytest.approx(1.0, abs=1e-3)


def test_duplicates_are_ignored_and_old_numbers_refused_until_the_count_came_round(
    tmp_path,
) -> None:
    with running(tmp_path, device_data(SERIAL)) as device, SerialPeer(device.endpoint.address) as p:
        p.hello()
        sent = p.command((1.0, 0.0))
        p.send(COMMAND, struct.pack("<Bhh", 3, 100, 0), number=sent)  # a duplicate
        assert p.poll()["in_force"] == sent
        now = p.number_sent
        old = p.send(POLL, number=(now - 5) % 256)
        assert _error(p.receive()) == (9, POLL, old, 1)
        p.send(POLL, number=(old + 1) % 256)
        assert p.state()["answers"] == (old + 1) % 256
        assert device.machine.volts[0] == pytest.approx(1.0, abs=1e-3)


def test_an_index_mark_is_told_in_four_states(tmp_path) -> None:
    mark = {0: {"encoder": {"index_marks_m": [0.001]}}}
    data = device_data(SERIAL, gantry={"preset": "published_gantry_clean", "plants": mark})
    with running(tmp_path, data) as device, SerialPeer(device.endpoint.address) as p:
        p.hello()
        told = []
        for _ in range(200):
            p.command((3.0, 0.0))
            state = p.poll()
            told.append(state["index"])
            if len([marks for marks in told if marks]) >= 4 and not state["index"]:
                break
            time.sleep(0.001)
        marks = [marks for marks in told if marks]
        assert len(marks) == 4
        assert {len(m) for m in marks} == {1}
        assert all(abs(m[0] - 2000) < 3 for m in marks)
        assert device.endpoint.refused == 0


def test_safe_zeroes_and_the_session_goes_on(tmp_path) -> None:
    with running(tmp_path, device_data(SERIAL)) as device, SerialPeer(device.endpoint.address) as p:
        p.hello()
        p.command((1.0, 1.0))
        p.send(SAFE)
        state = p.poll()
        assert (state["flags"], state["in_force"]) == (0, 0)
        assert device.machine.enabled == [False, False]


def test_half_duplex_speaks_only_when_asked(tmp_path) -> None:
    serve = {"serial": {"half_duplex": True}}
    with running(tmp_path, device_data(serve)) as device, SerialPeer(device.endpoint.address) as p:
        assert p.read(0.05) == b""
        p.command((1.0, 0.0))
        assert p.read(0.05) == b""
        assert p.hello()[7] == 3  # poll and exchange
        assert device.endpoint.exchanges == 1


def test_narrow_counters_wrap_and_are_sign_extended(tmp_path) -> None:
    narrow = {"resolution_m": 0.5e-6, "counter_bits": 12, "max_voltage_v": 10.0}
    data = device_data(
        SERIAL,
        channels=[narrow, narrow],
        faults=[{"kind": "counter_wrap", "counts": 100, "channel": 0}],
    )
    with running(tmp_path, data) as device, SerialPeer(device.endpoint.address) as p:
        p.hello()
        seen = [p.poll()["counts"][0]]
        while device.machine.travelled_counts()[0][1] < 2000:
            p.command((3.0, 0.0))
            seen.append(p.poll()["counts"][0])
            time.sleep(0.001)
        assert seen[0] == pytest.approx(2048 - 100, abs=2)  # it may tremble by a count
        assert -2048 <= min(seen) < 0
        assert max(seen) < 2048
