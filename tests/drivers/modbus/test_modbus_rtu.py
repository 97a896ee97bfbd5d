"""The Modbus driver on RTU over a pseudo terminal, against a peer made from the specification."""

import time

import pytest
from modbus_bench import RtuPeer, make, registers_of, reply_pdu, rtu_bench, rtu_frame

from motorctl.hal import RunError, Status

pytestmark = pytest.mark.wall_clock(lanes=3)

STALE = Status.STALE
CORRUPT = Status.STALE | Status.CORRUPT
GONE = Status.STALE | Status.BUS_OFF | Status.COMMUNICATION_LOST
TIMEOUT_S = 0.015


def opened(**changes):
    bench = rtu_bench(line={"timeout_s": TIMEOUT_S}, **changes)
    bench.open()
    bench.read()
    return bench


@pytest.fixture
def bench():
    bench = opened()
    yield bench
    bench.close()


def good(request, counts=(9, 9)):
    return rtu_frame(reply_pdu(registers_of(counts, request.sequence)))


def time_out():
    time.sleep(TIMEOUT_S + 0.002)


def test_one_period_is_one_exchange_collected_in_the_next(bench):
    for k in range(1, 20):
        request = bench.ask((1.0, -10.0), (1, 1))
        assert request.registers[:3] == [3277, 0x8001, 3]
        assert bench.read()[1] == [STALE, STALE]
        bench.peer.answer(request, (k, -k))
        assert bench.read() == ([k, -k], [0, 0])


def test_a_reply_in_pieces_is_accepted_once_it_is_whole(bench):
    request = bench.ask()
    frame = good(request, (7, 8))
    bench.peer.send(frame[:1])
    assert bench.read() == ([0, 0], [STALE, STALE])
    bench.peer.send(frame[1:4])
    assert bench.read() == ([0, 0], [STALE, STALE])
    bench.peer.send(frame[4:])
    assert bench.read() == ([7, 8], [0, 0])


def test_the_driver_never_talks_into_an_outstanding_reply(bench):
    bench.ask()
    bench.driver.write(bench.outputs)
    bench.driver.write(bench.outputs)
    assert bench.peer.idle()
    time_out()
    bench.peer.answer(bench.ask(), (4, 4))
    assert bench.read() == ([4, 4], [0, 0])


def test_with_sequence_numbers_a_late_reply_is_refused_and_the_next_one_counts(bench):
    late = bench.ask()
    time_out()
    request = bench.ask()
    bench.peer.send(good(late))
    assert bench.read() == ([0, 0], [CORRUPT, CORRUPT])
    time_out()
    request = bench.ask()
    bench.peer.answer(request, (4, 4))
    assert bench.read() == ([4, 4], [0, 0])


def test_without_sequence_numbers_the_line_is_left_alone_after_a_missing_reply():
    bench = rtu_bench(line={"timeout_s": TIMEOUT_S}, sequence=None)

    def answer(request, counts):
        bench.peer.send(rtu_frame(reply_pdu(registers_of(counts, 0)[:4])))

    bench.open(lambda: answer(bench.peer.request(), (0, 0)))
    bench.read()
    late = bench.ask()
    time_out()
    assert bench.read()[1] == [STALE, STALE]
    bench.driver.write(bench.outputs)
    assert bench.peer.idle(), "a reply that comes now would pass for that to a new request"
    answer(late, (9, 9))
    assert bench.read() == ([0, 0], [CORRUPT, CORRUPT])
    answer(bench.ask(), (4, 4))
    assert bench.read() == ([4, 4], [0, 0])
    bench.close()


@pytest.mark.parametrize(
    "spoilt",
    [
        lambda r: good(r)[:-1] + bytes([good(r)[-1] ^ 1]),
        lambda r: good(r)[:5] + bytes([good(r)[5] ^ 0x80]) + good(r)[6:],
        lambda r: good(r)[:-2],
        lambda r: good(r)[:2],
        lambda r: good(r) + b"\0",
        lambda r: b"\0" + good(r),
        lambda r: good(r) + good(r),
        lambda r: rtu_frame(reply_pdu(registers_of((9, 9), r.sequence)), unit=2),
        lambda r: rtu_frame(reply_pdu(registers_of((9, 9), r.sequence), function=3)),
        lambda r: rtu_frame(reply_pdu(registers_of((9, 9), r.sequence - 1))),
        lambda r: rtu_frame(reply_pdu(registers_of((9, 9), r.sequence)[:-1])),
        lambda r: rtu_frame(b"\x97\x02"),
        lambda r: rtu_frame(b"\x97\x04"),
        lambda r: b"\x01\x97\x02\x00\x00",
        lambda r: b"\xff" * 300,
    ],
    ids=[
        "checksum",
        "data",
        "too short",
        "two bytes",
        "too long",
        "glitch",
        "twice",
        "unit",
        "function",
        "echo",
        "registers",
        "exception",
        "device failure",
        "exception's checksum",
        "noise",
    ],
)
def test_what_is_no_reply_to_the_request_is_refused_and_a_later_one_counts(bench, spoilt):
    request = bench.ask()
    bench.peer.send(spoilt(request))
    time_out()
    counts, status = bench.read()
    assert (counts, status) == ([0, 0], [CORRUPT, CORRUPT])
    bench.peer.answer(bench.ask(), (1, 2))
    assert bench.read() == ([1, 2], [0, 0])


def test_noise_that_nobody_asked_for_is_refused(bench):
    bench.peer.send(b"\x01\x17")
    assert bench.read()[1] == [CORRUPT, CORRUPT]
    bench.peer.answer(bench.ask(), (1, 2))
    assert bench.read() == ([1, 2], [0, 0])


def test_a_port_that_vanishes_is_reported_and_nothing_is_raised(bench):
    bench.ask()
    bench.peer.close()
    for _ in range(3):
        bench.driver.write(bench.outputs)
        bench.read()
    assert bench.read() == ([0, 0], [GONE, GONE])
    bench.driver.safe()


def test_open_works_again_after_close(bench):
    bench.driver.close()
    bench.open(lambda: bench.peer.answer(bench.peer.request(), (5, 6)))
    assert bench.read() == ([5, 6], [0, 0])


def test_safe_waits_for_an_outstanding_reply_and_then_sends_zero_and_disable(bench):
    request = bench.ask((10.0, 10.0), (1, 1))
    started = time.monotonic()
    bench.driver.safe()
    assert time.monotonic() - started < 2.0  # pymodbus' own time-out is 3 s
    assert request.registers[2] == 3
    assert bench.peer.request().registers[:3] == [0, 0, 0]


def test_safe_before_open_writes_zeros_on_a_port_opened_for_it():
    bench = rtu_bench()
    bench.driver.safe()
    request = bench.peer.request()
    assert (request.function, request.registers) == (16, [0, 0, 0, 0])
    bench.close()


def test_a_missing_port_is_named():
    with pytest.raises(RunError, match=r"^rtu.port: there is no port /dev/ttyNONE9$"):
        make(rtu={"port": "/dev/ttyNONE9", "baud": 9600}).open()


def test_what_is_no_serial_port_is_named():
    with pytest.raises(RunError, match=r"^rtu.port: /dev/null is no serial port$"):
        make(rtu={"port": "/dev/null", "baud": 9600}).open()


def test_settings_that_a_port_refuses_are_named():
    peer = RtuPeer()  # a pseudo terminal has no parity
    with pytest.raises(RunError, match=f"^rtu.baud: {peer.port} refuses 9600 baud, parity even"):
        make(rtu={"port": peer.port, "baud": 9600, "parity": "even"}).open()
    peer.close()


def test_low_latency_that_a_port_refuses_is_noted(monkeypatch):
    bench = opened()
    assert bench.driver.notes == ()  # a pseudo-terminal has no such mode
    bench.driver.close()
    monkeypatch.setattr("motorctl_modbus.opening.PSEUDO_TERMINALS", ())  # as if it had
    bench.open()
    (note,) = bench.driver.notes
    assert note.startswith(f"rtu.port: {bench.peer.port} refuses low latency (")
    assert "16 ms" in note
    bench.close()


def test_a_silent_line_is_told_with_what_to_check():
    bench = rtu_bench(connect_timeout_s=0.1)
    with pytest.raises(RunError, match=r"unit: unit 1 at /dev/pts/\d+: no valid answer.*echo"):
        bench.driver.open()
    bench.close()


def test_a_device_without_function_code_23_is_named_as_such():
    bench = rtu_bench()
    with pytest.raises(RunError, match="does not support function code 23"):
        bench.open(lambda: bench.peer.send(bench.peer.frame(bench.peer.request(), b"\x97\x01")))
    bench.close()
