"""The watchdog of Beckhoff's couplers: armed at open, reset by the next open after a trip."""

import threading

import pytest
from modbus_bench import Bench, TcpPeer, make, packed, registers_of, reply_pdu, tcp_frame

from motorctl.hal import RunError, Status

pytestmark = pytest.mark.wall_clock(lanes=3)

TRIPPED = Status.COMMUNICATION_LOST | Status.STALE | Status.CORRUPT


class Coupler:
    """A coupler's registers as its manual has them."""

    def __init__(self, time_ms=1000, ran_out=False, closed=False, stuck=False, deaf=False):
        self.peer = TcpPeer()
        self.time_ms, self.ran_out, self.closed = time_ms, ran_out, closed
        self.stuck, self.deaf = stuck, deaf
        self.words, self.written, self.reset_word = [], [], 0
        self.exchanges = []

    def serve_until_exchange(self):
        while not self.exchanges or self.exchanges[-1] is not self.request:
            self.request = self.peer.request()
            self.peer.send(tcp_frame(self.request.transaction, self.answer(self.request)))

    def answer(self, request):
        if request.function == 3:
            value = {0x100C: 0x8000 * self.ran_out, 0x1120: self.time_ms}.get(request.read[0])
            assert request.read[1] == 1
            return b"\x83\x02" if value is None else b"\x03\x02" + packed([value])
        if request.function == 6:
            return self.set(request.written[0], request.registers[0])
        assert (request.function, request.read[0], request.written[0]) == (23, 0x0000, 0x0800)
        self.exchanges.append(request)
        if self.ran_out:
            return b"\x97\x04"
        return reply_pdu(registers_of((3, 4), request.sequence))

    def set(self, address, value):
        if address == 0x1121:
            self.words.append(value)
            if self.words[-2:] == [0xBECF, 0xAFFE] and not self.stuck:
                self.ran_out = self.closed = False
        elif address == 0x1120 and (self.closed or self.stuck):
            return b"\x86\x03"
        elif address == 0x1120:
            self.written.append(value)
            self.time_ms = self.time_ms if self.deaf else value
        return b"\x06" + packed([address, value])


def bench_of(coupler, **changes):
    told = {
        "coupler": "beckhoff_bk9000",
        "output_base": None,
        "watchdog_s": 0.2,
        "tcp": {"host": "127.0.0.1", "port": coupler.peer.port},
    }
    return Bench(coupler.peer, make(**{**told, **changes}))


def test_the_watchdog_gets_its_time_before_the_first_exchange():
    coupler = Coupler()
    bench = bench_of(coupler).open(coupler.serve_until_exchange)
    assert (coupler.written, coupler.words) == ([200], [])
    assert bench.read() == ([3, 4], [0, 0])
    bench.close()


def test_a_watchdog_that_has_its_time_is_not_written():
    coupler = Coupler()
    bench_of(coupler, watchdog_s=None).open(coupler.serve_until_exchange).close()
    assert (coupler.written, coupler.words) == ([], [])


def test_a_watchdog_that_ran_out_is_reset_at_open():
    coupler = Coupler(time_ms=200, ran_out=True)
    bench = bench_of(coupler).open(coupler.serve_until_exchange)
    assert coupler.words == [0xBECF, 0xAFFE]
    assert bench.read() == ([3, 4], [0, 0])
    bench.close()


def test_a_watchdog_that_is_still_active_is_reset_to_take_its_time():
    coupler = Coupler(closed=True)
    bench_of(coupler).open(coupler.serve_until_exchange).close()
    assert coupler.words == [0xBECF, 0xAFFE]
    assert coupler.time_ms == 200


def test_a_trip_while_running_is_lost_communication_until_the_next_open():
    coupler = Coupler()
    bench = bench_of(coupler).open(coupler.serve_until_exchange)
    bench.read()
    coupler.ran_out = True
    for _ in range(3):
        request = bench.ask()
        coupler.peer.send(tcp_frame(request.transaction, coupler.answer(request)))
        assert bench.read() == ([3, 4], [TRIPPED, TRIPPED])
    assert coupler.words == [], "a trip is not reset behind the operator's back"
    bench.driver.close()
    bench.open(coupler.serve_until_exchange)
    assert bench.read() == ([3, 4], [0, 0])
    bench.close()


@pytest.mark.parametrize(
    ("state", "words"),
    [
        ({"stuck": True}, "refuses 200 ms in its watchdog register 0x1120"),
        ({"stuck": True, "ran_out": True}, "ran out and stays so"),
        ({"deaf": True}, "was given 200 ms.*and shows 1000 ms"),
    ],
    ids=["refused", "stays", "ignored"],
)
def test_a_watchdog_that_does_not_take_its_time_is_refused_by_name(state, words):
    coupler = Coupler(**state)
    bench = bench_of(coupler)
    serving = threading.Thread(target=_serve, args=(coupler,))
    serving.start()
    with pytest.raises(RunError, match=f"^watchdog_s: .*127.0.0.1:{coupler.peer.port}.*{words}"):
        bench.driver.open()
    serving.join(5)
    bench.close()
    assert coupler.exchanges == []


def _serve(coupler):
    coupler.peer.accept()
    with pytest.raises(EOFError):
        coupler.serve_until_exchange()


def test_a_device_without_such_registers_is_asked_whether_it_is_that_coupler():
    coupler = Coupler()
    coupler.answer = lambda request: bytes([request.function | 0x80, 2])
    bench = bench_of(coupler)
    serving = threading.Thread(target=_serve, args=(coupler,))
    serving.start()
    with pytest.raises(RunError, match=r"0x100c.*exception 2.*is it a beckhoff_bk9000"):
        bench.driver.open()
    serving.join(5)
    bench.close()
