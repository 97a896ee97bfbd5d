"""The page of the serial protocol and the code say the same: vectors, layouts, rates."""

import struct
from pathlib import Path

import numpy as np
import pytest
from serial_bench import channels, framed, slow_uncobs

from motorctl_serial import SerialDriver, SerialOptions, frames, protocol, receiver
from motorctl_serial.protocol import FrameType, Mode
from motorctl_serial.receiver import News

pytestmark = pytest.mark.slow

PAGE = (Path(__file__).parents[3] / "docs/drivers/serial.md").read_text()


def table(heading, first_cell):
    """Return the cells of the table behind a heading, without backquotes."""
    lines = iter(PAGE.split(heading, 1)[1].splitlines())
    for line in lines:
        if line.startswith(f"| {first_cell} |"):
            break
    next(lines)
    rows = []
    for line in lines:
        if not line.startswith("|"):
            break
        rows.append([cell.strip().strip("`") for cell in line.strip("|").split("|")])
    return rows


VECTORS = [
    (row[0], bytes.fromhex(row[1]), int(row[2], 16), bytes.fromhex(row[3]), row[4])
    for row in table("## Test vectors", "frame")
]


def command(kind, sequence, enable, codes):
    volts = np.array(codes) * 10.0 / 32767
    flags = np.array([enable >> i & 1 for i in range(len(codes))], np.uint8)
    body, wire = np.zeros(64, np.uint8), np.zeros(64, np.uint8)
    numbers = np.arange(len(codes))
    size = frames.put_command(
        int(kind), sequence, volts, flags, numbers, len(codes), 32767 / 10.0, body, wire
    )
    return wire[:size].tobytes()


# What the column of meanings says, in order, as this driver says it.
SENT = [
    frames.frame_of(protocol.hello(0, 2, Mode.POLL, 20, 1000)),
    frames.frame_of(protocol.hello(255, 1, Mode.STREAM, 5, 200)),
    command(FrameType.COMMAND, 1, 3, [16384, -32767]),
    command(FrameType.COMMAND, 2, 0, [0, 0]),
    command(FrameType.EXCHANGE, 9, 1, [-1]),
    frames.frame_of(protocol.bare(FrameType.POLL, 3)),
    frames.frame_of(protocol.bare(FrameType.START_STREAM, 4)),
    frames.frame_of(protocol.bare(FrameType.STOP_STREAM, 5)),
    frames.frame_of(protocol.bare(FrameType.SAFE, 6)),
]


def taken(wire, session_channels=0):
    rx = receiver.make_receiver()
    rx["channels"], rx["counter_bits"], rx["boot_id"] = session_channels, 32, 1
    data = np.frombuffer(wire, np.uint8).copy()
    return rx, News(receiver.take(rx, data, data.size))


def states():
    return [wire for name, _, _, wire, _ in VECTORS if name == "STATE"]


def test_the_page_has_a_vector_for_each_frame():
    assert {name for name, *_ in VECTORS} == {kind.name for kind in FrameType}


@pytest.mark.parametrize(("name", "body", "crc", "wire", "meaning"), VECTORS)
def test_each_vector_is_what_encoder_and_decoder_make_of_it(name, body, crc, wire, meaning):
    assert FrameType(body[0]).name == name, meaning
    assert frames.crc16(np.frombuffer(body, np.uint8).copy(), len(body)) == crc
    assert frames.frame_of(body) == wire == framed(body)
    data = np.zeros(len(wire), np.uint8)
    size = frames.cobs_decode(np.frombuffer(wire, np.uint8).copy(), len(wire) - 1, data)
    assert data[:size].tobytes() == body + struct.pack("<H", crc) == slow_uncobs(wire[:-1])


def test_the_driver_sends_the_hosts_vectors():
    assert [wire for _, body, _, wire, _ in VECTORS if body[0] < 0x80] == SENT


def test_the_vector_of_capabilities_is_understood():
    (wire,) = (wire for name, _, _, wire, _ in VECTORS if name == "CAPABILITIES")
    rx, news = taken(wire)
    assert news & News.CAPABILITIES
    device = protocol.capabilities(rx["capabilities"][0].tobytes())
    assert device == protocol.Capabilities(
        0, 1, 1, 0, 2, 32, Mode(7), 20, 5000, 0xC0FFEE01, 10.0, "two-axis box"
    )


def test_the_vectors_of_state_are_understood():
    plain, tripped, single = states()
    rx, news = taken(plain, 2)
    assert news == News.FRESH
    assert rx["counts"][0, :2].tolist() == [100_000, -1]
    assert rx["status"][0, :2].tolist() == [0, 0x20]
    assert int(rx["sample"][0]) == 258
    rx, news = taken(tripped, 2)
    assert news == News.FRESH
    assert rx["counts"][0, :2].tolist() == [0, -(2**31)]
    assert rx["status"][0, :2].tolist() == [4, 4]
    assert rx["latched"][0, :2].tolist() == [1, 0]
    assert int(rx["index"][0, 0]) == -256
    assert int(rx["watchdog"][0]) == 1
    rx, news = taken(single, 1)
    assert news == News.FRESH | News.REFUSED  # of a COMMAND, says a flag
    assert int(rx["counts"][0, 0]) == 305_419_896
    assert int(rx["status"][0, 0]) == 0x82


def test_the_vectors_of_error_are_understood():
    version, session = (wire for name, _, _, wire, _ in VECTORS if name == "ERROR")
    rx, news = taken(version)
    assert news & News.ERROR
    assert not news & News.RESTARTED
    assert "versions 2 to 3" in protocol.refusal(rx["error"][0].tobytes()).in_words()
    rx, news = taken(session)
    assert news & News.RESTARTED
    refusal = protocol.refusal(rx["error"][0].tobytes())
    assert (refusal.about_type, refusal.about_sequence) == (FrameType.POLL, 17)


def test_the_pages_error_codes_are_the_codes():
    rows = table("**ERROR** names", "code")
    assert {(int(row[0]), row[1]) for row in rows} == {
        (int(code), code.name) for code in protocol.ErrorCode
    }


def test_the_pages_types_are_the_types():
    rows = table("## From the host", "type") + table("## From the device", "type")
    assert {(int(row[0], 16), row[1]) for row in rows} == {
        (int(kind), kind.name) for kind in FrameType
    }


def test_the_pages_options_are_the_options_with_their_defaults():
    rows = {row[0]: row[1] for row in table("## Configuration", "key")}
    fields = SerialOptions.model_fields
    assert set(rows) == set(fields)
    for key, default in rows.items():
        if not default:
            assert fields[key].is_required()
        elif key not in {"wait_s", "turnaround_s"}:
            assert default.strip("`") in {str(fields[key].default).lower(), "null"} | {
                f"{fields[key].default:g}" if isinstance(fields[key].default, float) else ""
            }


def test_the_pages_rates_are_the_budgets():
    rows = table("### Rates", "baud")
    assert len(rows) >= 10
    for baud, count, *rates in rows:
        for i, told in enumerate(rates):
            mode = ("poll", "exchange", "stream")[i % 3]
            port = "/dev/ttyS0" if i < 3 else "/dev/ttyUSB0"
            options = SerialOptions(port=port, baud=int(baud), mode=mode)
            driver = SerialDriver(options, channels(*range(int(count))), 1e-3)
            assert int(driver.rate_budget().max_rate_hz + 1e-9) == int(told)


def test_two_axes_fit_a_kilohertz_at_921600_baud():
    for port, rate_hz in (("/dev/ttyS0", 1000), ("/dev/ttyUSB0", 500)):
        options = SerialOptions(port=port, baud=921600)
        assert SerialDriver(options, channels(0, 1), 2e-3).rate_budget().max_rate_hz >= rate_hz
