"""Frames and registers of the Modbus driver against pymodbus' framer and plain arithmetic."""

import math
import struct

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from modbus_bench import channels, crc, options, rtu_frame, taken_apart, tcp_frame
from pymodbus.framer import FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.register_message import ReadWriteMultipleRegistersResponse

from motorctl.hal import Outputs, Status
from motorctl_modbus.crc import crc16
from motorctl_modbus.exchange import FRESH, NOTHING, RtuExchange, TcpExchange
from motorctl_modbus.layout import InputBlock, OutputBlock

RTU = {"port": "p", "baud": 115200}


def parts_of(told, n=2, rtu=False):
    axes = channels(n)
    outputs, inputs = OutputBlock(told, axes), InputBlock(told, axes)
    if rtu:
        return outputs, inputs, RtuExchange(told.unit, outputs, inputs, 1.0, numbered=True)
    return outputs, inputs, TcpExchange(told.unit, outputs, inputs)


def put(exchange, data):
    exchange.space()[: len(data)] = data
    exchange.received(len(data))


@given(st.binary(max_size=256))
def test_the_checksum_is_that_of_the_specification_and_of_pymodbus(data):
    found = crc16(data, len(data)).to_bytes(2, "little")
    assert found == crc(data)
    assert found == FramerRTU.compute_CRC(data).to_bytes(2, "big")


volts = st.floats(allow_nan=True, allow_infinity=True)


@given(
    st.lists(st.tuples(volts, st.integers(0, 1)), min_size=2, max_size=2),
    st.integers(0, 65535),
    st.integers(1, 247),
    st.booleans(),
)
def test_pymodbus_reads_every_request_as_it_was_meant(commands, sequence, unit, rtu):
    outputs, _, exchange = parts_of(options(unit=unit, **({"rtu": RTU} if rtu else {})), rtu=rtu)
    asked = Outputs(2)
    asked.volts[:], asked.enable[:] = zip(*commands, strict=True)
    outputs.encode(exchange.request, exchange.data_at, asked, sequence)
    exchange.seal()
    framer = (FramerRTU if rtu else FramerSocket)(DecodePDU(True))
    size, request = framer.handleFrame(bytes(exchange.request), 0, 0)
    assert size == len(exchange.request)
    assert request.dev_id == unit
    assert (request.read_address, request.read_count, request.write_address) == (0, 5, 0x100)
    expected, enables = [], 0
    for i, (value, enable) in enumerate(commands):
        count = 0
        if enable and not math.isnan(value):
            enables |= 1 << i
            count = round(min(max(value, -20.0), 20.0) * 32767 / 10)
            count = min(max(count, -32768), 32767)
        expected.append(count & 0xFFFF)
    for found, wanted in zip(request.write_registers[:2], expected, strict=True):
        assert (found - wanted + 1) % 65536 <= 2, "within a rounding of the last count"
    assert request.write_registers[2:] == [enables, sequence]


@given(st.lists(st.integers(0, 65535), min_size=5, max_size=5), st.integers(1, 247), st.booleans())
def test_every_reply_that_pymodbus_makes_is_taken_whole(registers, unit, rtu):
    _, inputs, exchange = parts_of(options(unit=unit, **({"rtu": RTU} if rtu else {})), rtu=rtu)
    exchange.seal()
    exchange.sent(0.0)
    framer = (FramerRTU if rtu else FramerSocket)(DecodePDU(True))
    reply = ReadWriteMultipleRegistersResponse(registers=registers, dev_id=unit, transaction_id=1)
    frame = framer.buildFrame(reply)
    for byte in frame[:-1]:
        put(exchange, bytes([byte]))
        assert exchange.judge(0.0) == NOTHING
    put(exchange, frame[-1:])
    assert exchange.judge(0.0) == FRESH
    assert exchange.registers == tuple(registers)
    inputs.decode(exchange.registers)
    words = struct.pack(">5H", *registers)
    assert inputs.counts.tolist() == list(struct.unpack(">2i", words[:8]))
    assert exchange.judge(0.0) == NOTHING


def test_requests_are_those_of_the_specification_byte_by_byte():
    outputs, _, exchange = parts_of(options(unit=17))
    asked = Outputs(2)
    asked.volts[:], asked.enable[:] = (10.0, -10.0), 1
    outputs.encode(exchange.request, exchange.data_at, asked, 0x0102)
    exchange.seal()
    pdu = bytes.fromhex("17 0000 0005 0100 0004 08 7fff 8001 0003 0102")
    assert bytes(exchange.request) == tcp_frame(1, pdu, unit=17)
    outputs, _, exchange = parts_of(options(unit=17, rtu=RTU), rtu=True)
    outputs.encode(exchange.request, exchange.data_at, asked, 0x0102)
    exchange.seal()
    assert bytes(exchange.request) == rtu_frame(pdu, unit=17)
    assert taken_apart(17, pdu).registers == [0x7FFF, 0x8001, 3, 0x0102]


WIDTHS = {16: "h", 32: "i", 64: "q"}


@given(st.data(), st.sampled_from([16, 32, 64]), st.booleans(), st.booleans())
def test_counts_of_every_width_sign_and_word_order_are_read_back(data, bits, signed, high_first):
    value = data.draw(st.integers(-(1 << (bits - 1)), (1 << (bits - 1)) - 1))
    axis = {
        "volts": {"address": 0, "volts_per_count": 1e-3},
        "enable": {"address": 1, "bit": 0},
        "counts": {"address": 0, "bits": bits, "signed": signed},
        "index_counts": {"address": 4, "bits": bits, "signed": signed},
    }
    order = "high_first" if high_first else "low_first"
    told = options(channels={0: axis}, sequence=None, word_order=order)
    _, inputs, _ = parts_of(told, n=1)
    words = list(struct.unpack(f">{bits // 16}H", struct.pack(f">{WIDTHS[bits]}", value)))
    words = words if high_first else words[::-1]
    index = [0] * (bits // 16 - 1)
    index = [*index, 5] if high_first else [5, *index]
    inputs.decode((*words, *[0xDEAD] * (4 - len(words)), *index))
    expected = value if signed or bits == 64 else value % (1 << bits)
    assert inputs.counts[0] == expected
    assert inputs.index_counts[0] == 5


@given(st.floats(-20, 20), st.sampled_from([16, 32]), st.booleans(), st.booleans(), st.booleans())
def test_volts_of_every_form_are_sent_as_the_nearest_count(value, bits, signed, high, enabled):
    middle = 0 if signed else 1 << (bits - 1)
    scale = 10 / ((1 << (bits - 1)) - 1)
    volts = {"address": 0, "bits": bits, "signed": signed, "zero_count": middle}
    axis = {
        "volts": {**volts, "volts_per_count": scale},
        "enable": {"address": 2, "bit": 7},
        "counts": {"address": 0, "bits": 32},
    }
    order = "high_first" if high else "low_first"
    outputs, _, _ = parts_of(options(channels={0: axis}, sequence=None, word_order=order), n=1)
    asked = Outputs(1)
    asked.volts[0], asked.enable[0] = value, enabled
    frame = bytearray(6)
    outputs.encode(frame, 0, asked, 0)
    words = list(struct.unpack(">3H", frame))
    assert words[2] == 0x80 * enabled
    number = (
        words[0]
        if bits == 16
        else (words[0] << 16 | words[1])
        if high
        else (words[1] << 16 | words[0])
    )
    if signed and number >> (bits - 1):
        number -= 1 << bits
    sent = (number - middle) * scale
    expected = np.clip(value, -10 - scale, 10) if enabled else 0.0
    assert abs(sent - expected) <= 0.5 * scale + 1e-12
    assert outputs.off_registers(0)[2] == 0


def test_unnamed_registers_in_between_are_written_with_zero():
    axis = {
        "volts": {"address": 0, "volts_per_count": 1e-3},
        "enable": {"address": 9, "bit": 0},
        "counts": {"address": 0, "bits": 32},
    }
    outputs, _, exchange = parts_of(options(channels={0: axis}, sequence=None), n=1)
    asked = Outputs(1)
    asked.volts[0], asked.enable[0] = 1.0, 1
    outputs.encode(exchange.request, exchange.data_at, asked, 0)
    assert struct.unpack(">10H", exchange.request[17:]) == (1000, *[0] * 8, 1)


@given(st.integers(0, 0xFFFF))
def test_status_bits_are_what_the_register_shows(word):
    names = ["encoder_lost", "amplifier_fault", "limit_negative", "limit_positive", "estop"]
    bits = {
        name: {"address": 5, "bit": 3 * i, "inverted": i % 2 == 1} for i, name in enumerate(names)
    }
    axis = {
        "volts": {"address": 0, "volts_per_count": 1e-3},
        "enable": {"address": 1, "bit": 0},
        "counts": {"address": 0, "bits": 32},
        "status": bits,
    }
    _, inputs, _ = parts_of(options(channels={0: axis}, sequence=None), n=1)
    inputs.decode((0, 0, 0, 0, 0, word))
    expected = 0
    for i, name in enumerate(names):
        if (word >> (3 * i) & 1) != i % 2:
            expected |= Status[name.upper()]
    assert inputs.status[0] == expected
