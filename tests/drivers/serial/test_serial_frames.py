"""The serial frames: COBS and CRC against slow references, and what a damaged frame can do."""

import binascii
import itertools

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numba import njit
from serial_bench import framed, slow_cobs, slow_uncobs, state_body

from motorctl.hal import Status
from motorctl_serial import frames, receiver
from motorctl_serial.receiver import News

FRESH = int(News.FRESH)  # Numba takes plain integers for constants
FIRST = framed(state_body(1, 1, [11, -12]))
SECOND = state_body(2, 2, [21, -2_000_000_000], answers=9, in_force=7, flags=1)
MANY_ZEROS = state_body(2, 2, [0, 0])
WITH_INDEX = state_body(2, 2, [-1, 256], flags=1, status=[0x40, 0x60], index=[-5, 0x01000000])
LAST = framed(state_body(4, 4, [41, 42]))

# Pieces around the length where COBS cuts.
PIECES = st.sampled_from([b"\0", b"\xff", b"\1" * 253, b"\2" * 254, b"\3" * 255])
FRAMES = st.one_of(st.binary(max_size=600), st.lists(PIECES, max_size=6).map(b"".join))


def array(data):
    return np.frombuffer(data, np.uint8).copy()


def encode(data):
    coded = np.zeros(len(data) + len(data) // 254 + 1, np.uint8)
    return coded[: frames.cobs_encode(array(data), len(data), coded)].tobytes()


def decode(coded):
    data = np.zeros(max(1, len(coded)), np.uint8)
    size = frames.cobs_decode(array(coded), len(coded), data)
    return None if size < 0 else data[:size].tobytes()


def session(channels=2):
    rx = receiver.make_receiver()
    rx["channels"], rx["counter_bits"], rx["boot_id"] = channels, 32, 1
    return rx


def take(rx, wire):
    return News(receiver.take(rx, array(wire), len(wire)))


@given(FRAMES)
def test_cobs_is_what_the_paper_says(data):
    assert encode(data) == slow_cobs(data)
    assert 0 not in encode(data)


@given(FRAMES)
def test_cobs_gives_back_what_was_coded(data):
    assert decode(encode(data)) == data
    assert slow_uncobs(encode(data)) == data


@given(st.binary(min_size=1, max_size=40))
def test_bytes_that_are_no_cobs_are_refused(coded):
    decoded = decode(coded)
    if decoded is None:
        at = 0
        while at < len(coded) and coded[at] and 0 not in coded[at + 1 : at + coded[at]]:
            at += coded[at]
        assert at != len(coded)
    else:
        assert slow_uncobs(coded) == decoded


def test_the_overhead_of_a_frame_is_one_byte_up_to_the_longest():
    for size in range(frames.LONGEST_BODY + frames.CRC_BYTES + 1):
        assert len(encode(b"\1" * size)) == len(encode(b"\0" * size)) == size + frames.COBS_BYTES


def test_the_crc_has_its_check_value():
    assert frames.crc16(array(b"123456789"), 9) == 0x29B1


@given(st.binary(max_size=300))
def test_the_crc_is_the_one_of_binascii(data):
    assert frames.crc16(array(data), len(data)) == binascii.crc_hqx(data, 0xFFFF)


@given(st.binary(min_size=2, max_size=frames.LONGEST_BODY))
def test_a_frame_is_cobs_of_body_and_crc_and_a_zero(body):
    assert frames.frame_of(body) == framed(body)


@given(
    st.floats(allow_nan=True, allow_infinity=True),
    st.integers(0, 3),
    st.sampled_from([1.0, 5.0, 10.0, 4294.0]),
)
def test_volts_are_rounded_clamped_and_never_wrap(volts, enable, full_scale_v):
    wire, body = np.zeros(64, np.uint8), np.zeros(64, np.uint8)
    size = frames.put_command(
        2, 1, np.array([volts]), np.array([enable], np.uint8), np.array([1]), 3,
        32767 / full_scale_v, body, wire,
    )  # fmt: skip
    sent = slow_uncobs(wire[: size - 1].tobytes())[:-2]
    codes = np.frombuffer(sent[3:], "<i2")
    assert codes[0] == codes[2] == 0
    if not enable or np.isnan(volts):
        assert sent[2] == 0
        assert codes[1] == 0
    else:
        assert sent[2] == 2
        wanted = np.clip(volts, -full_scale_v, full_scale_v)
        assert abs(codes[1] * full_scale_v / 32767 - wanted) <= 0.501 * full_scale_v / 32767


@pytest.mark.slow
@pytest.mark.parametrize("body", [SECOND, MANY_ZEROS, WITH_INDEX], ids=["plain", "zeros", "index"])
def test_one_or_two_wrong_bits_are_never_accepted(body):
    fresh = session()
    assert take(fresh, FIRST) == News.FRESH
    wire = framed(body)
    bits = range(8 * (len(wire) - 1))
    places = itertools.chain(itertools.combinations(bits, 1), itertools.combinations(bits, 2))
    for flipped in places:
        damaged = bytearray(wire)
        for bit in flipped:
            damaged[bit // 8] ^= 1 << bit % 8
        rx = fresh.copy()
        assert not take(rx, bytes(damaged)) & News.FRESH, flipped
        assert rx["counts"][0, :2].tolist() == [11, -12]
        assert take(rx, LAST) & News.FRESH
        assert rx["counts"][0, :2].tolist() == [41, 42]


@pytest.mark.slow
@given(st.data())
def test_three_wrong_bits_beside_the_codes_are_never_accepted(data):
    counts = data.draw(st.lists(st.integers(-(2**31), 2**31 - 1), min_size=2, max_size=2))
    wire = framed(state_body(2, 2, counts))
    codes, at = set(), 0
    while at < len(wire) - 1:
        codes.add(at)
        at += wire[at]
    bits = [b for b in range(8 * (len(wire) - 1)) if b // 8 not in codes]
    flipped = data.draw(st.lists(st.sampled_from(bits), min_size=1, max_size=3, unique=True))
    damaged = bytearray(wire)
    for bit in flipped:
        damaged[bit // 8] ^= 1 << bit % 8
    rx = session()
    take(rx, FIRST)
    assert not take(rx, bytes(damaged)) & News.FRESH
    assert rx["counts"][0, :2].tolist() == [11, -12]


@given(st.binary(max_size=700), st.lists(st.integers(1, 40), min_size=1, max_size=8))
def test_after_any_garbage_the_frame_behind_the_next_zero_is_taken(garbage, cuts):
    rx = session()
    stream = garbage + b"\0" + FIRST
    sizes = itertools.cycle(cuts)
    news, at = News(0), 0
    while at < len(stream):
        size = next(sizes)
        news |= take(rx, stream[at : at + size])
        at += size
    assert news & News.FRESH
    assert rx["counts"][0, :2].tolist() == [11, -12]


@given(st.lists(st.integers(1, 5), min_size=1, max_size=20))
def test_a_frame_may_come_in_any_pieces(cuts):
    rx, at, news = session(), 0, News(0)
    for size in itertools.chain(cuts, itertools.repeat(1)):
        if at >= len(FIRST):
            break
        assert not news & News.FRESH
        news |= take(rx, FIRST[at : at + size])
        at += size
    assert news == News.FRESH


def test_the_newest_of_many_frames_wins():
    rx = session()
    many = b"".join(framed(state_body(i, i, [i, -i])) for i in range(1, 101))
    assert take(rx, many) == News.FRESH
    assert rx["counts"][0, :2].tolist() == [100, -100]


def test_a_duplicate_is_ignored_and_a_step_back_refused():
    rx = session()
    take(rx, framed(state_body(5, 5, [5, 5])))
    assert take(rx, framed(state_body(5, 6, [9, 9]))) == News(0)
    assert take(rx, framed(state_body(4, 6, [9, 9]))) == News.REFUSED
    assert take(rx, framed(state_body(6, 5, [9, 9]))) == News(0)
    assert take(rx, framed(state_body(7, 4, [9, 9]))) == News.REFUSED
    assert rx["counts"][0, :2].tolist() == [5, 5]
    assert take(rx, framed(state_body(7, 6, [6, 6]))) == News.FRESH


def test_commands_that_are_refused_time_after_time_are_communication_lost():
    rx, lost = session(), int(Status.COMMUNICATION_LOST)
    numbers, told = np.arange(2), np.zeros(2, np.uint32)
    counts, index = np.zeros(2, np.int64), np.zeros(2, np.int64)

    def status(k, refused):
        news = take(rx, framed(state_body(k, k, [k, k], flags=4 if refused else 0)))
        assert news & News.FRESH
        assert bool(news & News.REFUSED) == refused
        receiver.deliver(rx, numbers, int(news), 0, counts, index, told)
        assert counts.tolist() == [k, k]
        return int(told[0]) & lost

    # Where the two clocks drift, a STATE in between tells of no command.
    refused = [1, 0, 0, 1, 1, 0, 1, 1, 1, 0, 0, 0, 1]
    assert [status(k, bool(one)) for k, one in enumerate(refused, 1)] == [
        lost if k in (8, 9) else 0 for k in range(1, len(refused) + 1)
    ]


def test_after_a_break_of_half_a_round_the_second_frame_is_taken():
    rx = session()
    take(rx, framed(state_body(0, 0, [1, 1])))
    assert take(rx, framed(state_body(200, 200, [2, 2]))) == News.REFUSED
    assert take(rx, framed(state_body(201, 201, [3, 3]))) == News.FRESH


@given(st.integers(1, 10**6), st.integers(1, 100))
def test_after_any_silence_the_second_frame_of_a_stream_is_taken(missed, stride):
    assume((missed + 1) % 256)  # then the first one passes for a repetition
    rx = session()
    take(rx, framed(state_body(0, 0, [1, 1])))
    for k in range(1, 4):
        news = take(rx, framed(state_body(missed + k, (missed + k) * stride, [k, k])))
        assert news == News.FRESH or k == 1
    assert rx["counts"][0, :2].tolist() == [3, 3]


def test_a_frame_from_long_ago_is_not_taken_and_two_that_do_not_follow_each_other_neither():
    rx = session()
    take(rx, framed(state_body(10, 20000, [1, 1])))
    assert take(rx, framed(state_body(11, 2000, [2, 2]))) == News.REFUSED
    assert take(rx, framed(state_body(13, 2001, [3, 3]))) == News.REFUSED
    assert take(rx, framed(state_body(14, 2000, [4, 4]))) == News.REFUSED
    assert take(rx, framed(state_body(15, 20001, [5, 5]))) == News.FRESH
    assert rx["counts"][0, :2].tolist() == [5, 5]


@given(st.integers(0, 255), st.integers(0, 65535), st.integers(1, 127))
def test_sequence_and_sample_go_round(sequence, sample, step):
    rx = session()
    take(rx, framed(state_body(sequence, sample, [1, 1])))
    assert take(rx, framed(state_body(sequence + step, sample + step, [2, 2]))) == News.FRESH


@pytest.mark.parametrize("channels", [1, 3])
def test_a_state_for_another_number_of_channels_is_refused(channels):
    assert take(session(), framed(state_body(1, 1, [7] * channels))) == News.REFUSED


def test_without_a_session_no_state_is_taken():
    assert take(receiver.make_receiver(), FIRST) == News.REFUSED


def test_what_the_host_sent_is_ignored_when_the_line_echoes_it():
    assert take(session(), framed(b"\4\1") + framed(b"\2\1\3" + bytes(4))) == News(0)


def fuzz(total, chunk, seed):
    random = np.random.default_rng(seed)
    rx, accepted, at, sample = session(), 0, 0, 0
    while at < total:
        garbage = random.integers(0, 256, chunk, np.uint8)
        garbage[random.random(chunk) < 0.05] = 0
        accepted += bool(receiver.take(rx, garbage, chunk) & News.FRESH)
        at += chunk
        if at % (64 * chunk) == 0:
            sample += 1
            wire = b"\0" + framed(state_body(sample, sample, [sample, -sample]))
            assert take(rx, wire) & News.FRESH, "it has to find its feet after any garbage"
            assert rx["counts"][0, :2].tolist() == [sample, -sample]
    return accepted


def test_random_bytes_are_never_a_sample():
    assert fuzz(100_000, 509, 1) == 0


@njit
def judge_frames(rx, before, good, total, random):
    """Decode `total` frames: random ones, and `good` with bytes changed, lost, put in.

    Returns how many were fresh and differed from `good`, how many were `good` itself, how many of
    those were refused, and after how many the good one that followed was not taken.
    """
    wire = np.zeros(200, np.uint8)
    wrong = whole = refused = deaf = 0
    for _ in range(total):
        rx[0] = before[0]
        size = good.size
        kind = random.integers(0, 4)
        if kind == 0:
            size = random.integers(2, 60)
            for i in range(size - 1):
                wire[i] = random.integers(1, 256)
        else:
            wire[:size] = good
            for _ in range(random.integers(0, 5)):
                at = random.integers(0, size - 1)
                if kind == 1:
                    wire[at] = random.integers(0, 256)
                elif kind == 2:
                    wire[at] ^= 1 << random.integers(0, 8)
                elif size > 2 and random.integers(0, 2) == 0:
                    for i in range(at, size - 1):
                        wire[i] = wire[i + 1]
                    size -= 1
                else:
                    for i in range(size, at, -1):
                        wire[i] = wire[i - 1]
                    wire[at] = random.integers(0, 256)
                    size += 1
        wire[size - 1] = 0
        same = size == good.size and np.all(wire[:size] == good)
        fresh = receiver.take(rx, wire, size) & FRESH != 0
        wrong += fresh and not same
        whole += same
        refused += same and not fresh
        if not fresh:
            deaf += receiver.take(rx, good, good.size) & FRESH == 0
    return wrong, whole, refused, deaf


def fuzz_frames(total, seed):
    before = session()
    take(before, FIRST)
    random = np.random.default_rng(seed)
    counts = judge_frames(before.copy(), before, array(framed(SECOND)), total, random)
    wrong, whole, refused, deaf = (int(count) for count in counts)
    print(f"{wrong} of {total} wrong frames passed, {refused} of {whole} right ones did not")
    assert wrong <= 1.5 * total / 65536
    assert refused == 0
    assert whole > total / 20
    assert deaf == 0


@pytest.mark.slow
def test_random_frames_are_no_sample_and_hide_none():
    fuzz_frames(200_000, 4)


@pytest.mark.slow
def test_a_million_random_frames_are_no_sample_and_hide_none():
    fuzz_frames(1_000_000, 5)


@pytest.mark.slow
def test_a_million_random_bytes_are_never_a_sample():
    assert fuzz(1_000_000, 509, 2) == 0


@pytest.mark.long
@pytest.mark.slow
def test_of_frames_damaged_at_random_no_more_pass_than_a_crc_of_16_bits_lets():
    random = np.random.default_rng(3)
    before = session()
    take(before, FIRST)
    wire = array(framed(SECOND))
    frames_sent, passed = 2_000_000, 0
    places = random.integers(0, wire.size - 1, (frames_sent, 3))
    values = random.integers(0, 256, (frames_sent, 3), np.uint8)
    rx, damaged = before.copy(), wire.copy()
    for place, value in zip(places, values, strict=True):
        damaged[:] = wire
        damaged[place] = value
        rx[:] = before
        if receiver.take(rx, damaged, wire.size) & News.FRESH:
            passed += not np.array_equal(damaged, wire)
    print(f"{passed} of {frames_sent} damaged frames passed")
    assert passed <= 1.5 * frames_sent / 65536
