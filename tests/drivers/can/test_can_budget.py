"""The arithmetic of the bus, against figures of the field and against the standard's frames."""

import pytest
from can_bench import PERIOD_S, channels, command_frame, frames_of_both, options, state_frame
from hypothesis import given
from hypothesis import strategies as st

from motorctl_can import CanDriver
from motorctl_can.budget import Wire, classic_bits, fd_bits, slcan_characters


@pytest.mark.parametrize(
    ("length", "least", "most"), [(0, 47, 55), (2, 63, 75), (4, 79, 95), (8, 111, 135)]
)
def test_classic_frames_take_what_the_field_says(length, least, most):
    assert classic_bits(length, stuffed=False) == least
    assert classic_bits(length) == most
    assert Wire(1000000).frame_s(length) == pytest.approx(most * 1e-6)


def stuff_bits(bits):
    """Insert stuff bits as the standard says, and count them."""
    count, run, last = 0, 0, None
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            count, run, last = count + 1, 1, 1 - bit
    return count


def worst_pattern(n):
    """Five equal bits, then each stuff bit begins the next run with four of its kind."""
    return [0] * 5 + [1 - (i // 4) % 2 for i in range(n - 5)]


@given(st.integers(0, 8), st.booleans())
def test_the_worst_stuffing_of_classic_frames_is_reached_and_never_passed(length, extended):
    unstuffed = classic_bits(length, extended, stuffed=False)
    n = unstuffed - 13
    assert stuff_bits(worst_pattern(n)) == classic_bits(length, extended) - unstuffed


@given(st.lists(st.integers(0, 1), min_size=34, max_size=118))
def test_no_pattern_of_bits_takes_more_stuffing(pattern):
    assert stuff_bits(pattern) <= (len(pattern) - 1) // 4


def test_fd_frames_take_about_what_the_field_says():
    wire = Wire(1000000, True, 5000000)
    both = wire.frame_s(4) + wire.frame_s(8)
    assert 90e-6 <= both <= 1.04 * 102e-6
    assert Wire(1000000, True).frame_s(8) == pytest.approx(sum(fd_bits(8)) * 1e-6)
    assert wire.frame_s(64) > wire.frame_s(20) > wire.frame_s(16)


def fd_bits_by_parts(length, extended):
    """Put an FD frame together field by field: SOF to BRS, ESI to data, check, tail."""
    sof, base, rrs, ide, fdf, res, brs = 1, 11, 1, 1, 1, 1, 1
    arbitration = sof + base + rrs + ide + fdf + res + brs
    if extended:
        arbitration += 18 + 1  # identifier extension, SRR
    crc = 17 if length <= 16 else 21
    check = 4 + crc
    fixed = -(-check // 4)  # one before the stuff count, one after each four bits
    everything = arbitration + 1 + 4 + 8 * length
    tail = 1 + 1 + 1 + 7 + 3
    return everything + (everything - 1) // 4 + check + fixed + tail


@pytest.mark.parametrize("length", [0, 1, 8, 12, 16, 20, 64])
@pytest.mark.parametrize("extended", [False, True])
def test_fd_frames_have_every_bit_of_the_standard(length, extended):
    assert sum(fd_bits(length, extended)) == pytest.approx(fd_bits_by_parts(length, extended), 0.02)


def budget(**given):
    return CanDriver(options(**given), channels(), PERIOD_S).rate_budget()


def sized(command, state):
    frames = {"command": command_frame(), "state": state_frame()}
    frames["command"]["length"], frames["state"]["length"] = command, state
    return frames


def test_a_shared_classic_bus_does_not_carry_5_khz_but_2_5_with_sync():
    socketcan = {"interface": "socketcan", "channel": "can0"}
    plain = budget(**socketcan)
    assert plain.max_rate_hz == pytest.approx(0.8 / (115e-6 + 135e-6))
    synced = budget(**socketcan, sync={"id": 0x80, "wait_s": 2e-4})
    assert synced.max_rate_hz == pytest.approx(0.8 / (115e-6 + 135e-6 + 55e-6))
    assert 2500 < synced.max_rate_hz < plain.max_rate_hz < 5000
    for word in ("command (6 B) 115.0 us", "SYNC (0 B) 55.0 us", "305.0 us", "80%", "USB"):
        assert word in synced.arithmetic


def test_an_fd_bus_carries_5_khz():
    fd = {"interface": "socketcan", "channel": "can0", "fd": True, "data_bitrate": 5000000}
    assert budget(**fd).max_rate_hz > 5000
    assert "CAN FD at 1/5 Mbit/s" in budget(**fd).arithmetic
    slow = budget(interface="socketcan", channel="can0", fd=True)
    assert slow.max_rate_hz < budget(**fd).max_rate_hz


def test_29_bit_identifiers_cost_their_bits():
    frames = frames_of_both()
    for frame in frames.values():
        frame["extended"] = True
    found = budget(interface="socketcan", channel="can0", frames=frames)
    assert found.max_rate_hz == pytest.approx(0.8e6 / (160 + classic_bits(6, True)))


def test_slcan_is_limited_by_its_serial_line():
    assert slcan_characters(8) == len("t1808" + "00" * 8 + "\r")
    assert slcan_characters(2, True) == len("T000001802" + "0000" + "\r")
    found = budget(interface="slcan", channel="/dev/ttyACM0", tty_baudrate=115200)
    # the state frame (22 characters) and the answer to the command (2)
    assert found.max_rate_hz == pytest.approx(0.8 * 115200 / (24 * 10))
    assert "115200 baud" in found.arithmetic
    fast = budget(interface="slcan", channel="/dev/ttyACM0", tty_baudrate=12000000)
    assert fast.max_rate_hz == pytest.approx(0.8 / 250e-6)


def test_without_a_bus_the_arithmetic_says_so():
    for interface, channel in (("virtual", "here"), ("udp_multicast", "239.74.163.2")):
        found = budget(interface=interface, channel=channel)
        assert "no bus" in found.arithmetic
        assert 1000 < found.max_rate_hz < 20000


def test_a_long_wait_for_answers_limits_the_rate():
    found = budget(sync={"id": 0x80, "wait_s": 0.01})
    assert found.max_rate_hz == pytest.approx(80.0)
    assert "wait_s" in found.arithmetic
