"""Nothing but a right reply to the newest request is ever accepted, whatever comes."""

import random

import pytest
from modbus_bench import channels, crc, options, packed, registers_of, reply_pdu, tcp_frame
from modbus_bench import rtu_frame as framed

from motorctl_modbus.exchange import FRESH, RtuExchange, TcpExchange
from motorctl_modbus.layout import InputBlock, OutputBlock

RTU = {"port": "p", "baud": 115200}
SMALL, LARGE = 20_000, 1_000_000
ROUNDS = [
    SMALL,
    pytest.param(LARGE, marks=[pytest.mark.slow, pytest.mark.long, pytest.mark.timeout(1800)]),
]


def exchange_of(rtu):
    told = options(rtu=RTU) if rtu else options()
    outputs, inputs = OutputBlock(told, channels()), InputBlock(told, channels())
    if rtu:
        return RtuExchange(1, outputs, inputs, 1.0, numbered=True)
    return TcpExchange(1, outputs, inputs)


def put(exchange, data):
    data = data[: len(exchange.space())]
    exchange.space()[: len(data)] = data
    exchange.received(len(data))


def mangled(rng, frame):
    """A frame with some bits flipped, bytes lost, doubled or put in, cut off, or noise instead."""
    data = bytearray(frame)
    kind = rng.randrange(8)
    if kind == 0:
        return rng.randbytes(rng.randrange(40))
    if kind == 1:
        return bytes(data[: rng.randrange(len(data))])
    if kind == 2:
        at = rng.randrange(len(data))
        return bytes(data[:at] + rng.randbytes(rng.randrange(1, 4)) + data[at:])
    if kind == 3:
        del data[rng.randrange(len(data))]
        return bytes(data)
    if kind == 4:
        data[rng.randrange(min(9, len(data)))] = rng.randrange(256)
        return bytes(data)
    for _ in range(rng.randrange(1, 6) if kind < 7 else 0):
        at = rng.randrange(8 * len(data))
        data[at >> 3] ^= 1 << (at & 7)
    return bytes(data)


@pytest.mark.parametrize("rounds", ROUNDS)
def test_a_frame_with_a_wrong_crc_is_never_accepted(rounds):
    rng = random.Random(rounds)
    exchange = exchange_of(rtu=True)
    accepted = spoilt = 0
    for k in range(rounds):
        exchange.sent(float(k))
        words = [rng.randrange(65536) for _ in range(5)]
        frame = framed(reply_pdu(words)) if k % 64 == 0 else PREPARED[k % len(PREPARED)]
        data = mangled(rng, frame)
        put(exchange, data)
        if exchange.judge(k + 0.5) == FRESH:
            assert len(data) == 15
            assert data[:3] == b"\x01\x17\x0a"
            assert crc(data[:-2]) == data[-2:]
            assert packed(exchange.registers) == data[3:-2]
            accepted += 1
        else:
            assert data != frame, "a right frame is accepted"
            spoilt += 1
        exchange.may_send(k + 2.0)
    assert accepted > rounds / 20
    assert spoilt > rounds / 2


PREPARED = [
    framed(reply_pdu([i * 7919 % 65536, i, 65535 - i, i * i % 65536, i])) for i in range(97)
]


@pytest.mark.parametrize("rounds", ROUNDS)
def test_a_reply_to_another_transaction_is_never_accepted(rounds):
    rng = random.Random(rounds)
    exchange = exchange_of(rtu=False)
    newest = accepted = refused = 0
    stream = b""
    for _ in range(rounds):
        if not exchange.may_send(0.0):
            exchange = exchange_of(rtu=False)
            newest, stream = 0, b""
        exchange.seal()
        exchange.sent(0.0)
        newest = (newest + 1) & 0xFFFF
        age = rng.choice((0, 0, 0, 1, 2, 5, 65535, 32768, rng.randrange(65536)))
        frame = tcp_frame(newest - age, BODY)
        data = frame if rng.randrange(3) else mangled(rng, frame)
        stream = (stream + data)[-600:]
        put(exchange, data)
        if exchange.judge(0.0) == FRESH:
            right = newest.to_bytes(2, "big") + b"\0\0\0\x0d\x01\x17\x0a"
            assert right + packed(exchange.registers) in stream
            accepted += 1
        else:
            refused += 1
    assert accepted > rounds / 10
    assert refused > rounds / 10


BODY = reply_pdu(registers_of((123456, -7), 99))


@pytest.mark.parametrize("rtu", [False, True], ids=["tcp", "rtu"])
def test_after_any_noise_a_right_reply_is_accepted_within_three_periods(rtu):
    rng = random.Random(5)
    exchange = exchange_of(rtu)
    newest = 0
    for k in range(3000):
        put(exchange, rng.randbytes(rng.randrange(1, 60)))
        exchange.judge(10.0 * k)
        for attempt in range(3):
            now_s = 10.0 * k + 2.0 * attempt + 1.0
            assert exchange.may_send(now_s)
            exchange.seal()
            exchange.sent(now_s)
            newest = (newest + 1) & 0xFFFF
            put(exchange, framed(BODY) if rtu else tcp_frame(newest, BODY))
            if exchange.judge(now_s) == FRESH:
                break
        else:
            pytest.fail("no reply accepted after noise")


def test_a_long_reply_fits_and_more_than_the_buffer_holds_is_dropped():
    for rtu in (False, True):
        exchange = exchange_of(rtu)
        exchange.sent(0.0)
        for _ in range(200):
            put(exchange, b"\x01\x17\x0a" * 100)
            assert exchange.judge(0.0) != FRESH
            assert len(exchange.space()) > 200
