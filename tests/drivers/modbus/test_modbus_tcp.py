"""The Modbus driver on TCP, step by step against a device that does what the test says."""

import copy
import select
import time
import tracemalloc

import pytest
from modbus_bench import CHANNELS, make, registers_of, reply_pdu, tcp_bench, tcp_frame

from motorctl.hal import Inputs, RunError, Status

pytestmark = pytest.mark.wall_clock(lanes=3)

STALE = Status.STALE
CORRUPT = Status.STALE | Status.CORRUPT
GONE = Status.STALE | Status.BUS_OFF | Status.COMMUNICATION_LOST


@pytest.fixture
def bench():
    bench = tcp_bench()
    bench.open()
    bench.read()
    yield bench
    bench.close()


def test_the_first_read_after_open_brings_counts_and_the_outputs_were_off():
    bench = tcp_bench()
    asked = []

    def serve():
        asked.append(bench.peer.request())
        bench.peer.answer(asked[0], (-5, 70000))

    bench.open(serve)
    assert bench.read() == ([-5, 70000], [0, 0])
    assert bench.read() == ([-5, 70000], [STALE, STALE])
    assert (asked[0].function, asked[0].registers[:3]) == (23, [0, 0, 0])
    bench.close()


def test_one_period_is_one_exchange_collected_in_the_next(bench):
    for k in range(1, 50):
        request = bench.ask((1.0, -10.0), (1, 1))
        assert (request.read, request.written) == ((0, 5), (0x100, 4))
        assert request.registers[:3] == [3277, 0x8001, 3]
        assert bench.read()[1] == [STALE, STALE]
        bench.peer.answer(request, (k, -k))
        assert bench.read() == ([k, -k], [0, 0])
    assert bench.driver.exchange_delay_periods == 1.0


def test_disabled_and_impossible_commands_are_zero_and_what_is_too_much_is_clamped(bench):
    cases = [
        ((5.0, 5.0), (0, 1), [0, 16384, 2]),
        ((float("nan"), 1.0), (1, 1), [0, 3277, 2]),
        ((float("inf"), float("-inf")), (1, 1), [0x7FFF, 0x8000, 3]),
        ((1e300, -1e300), (1, 1), [0x7FFF, 0x8000, 3]),
        ((float("inf"), float("nan")), (0, 0), [0, 0, 0]),
    ]
    for volts, enable, registers in cases:
        request = bench.ask(volts, enable)
        assert request.registers[:3] == registers
        bench.peer.answer(request)
        bench.read()


def test_a_reply_in_pieces_is_accepted_once_it_is_whole(bench):
    request = bench.ask()
    frame = bench.peer.frame(request, reply_pdu(registers_of((7, 8), request.sequence)))
    for i in range(len(frame) - 1):
        bench.peer.send(frame[i : i + 1])
        assert bench.read() == ([0, 0], [STALE, STALE])
    bench.peer.send(frame[-1:])
    assert bench.read() == ([7, 8], [0, 0])


def test_of_two_replies_in_one_segment_the_newest_wins(bench):
    first, second = bench.ask(), bench.ask()
    older = bench.peer.frame(first, reply_pdu(registers_of((1, 1), first.sequence)))
    newer = bench.peer.frame(second, reply_pdu(registers_of((2, 2), second.sequence)))
    bench.peer.send(older + newer)
    assert bench.read() == ([2, 2], [0, 0])
    assert bench.read()[1] == [STALE, STALE]


def test_a_reply_to_an_older_request_is_thrown_away(bench):
    first, second = bench.ask(), bench.ask()
    bench.peer.answer(first, (1, 1))
    assert bench.read() == ([0, 0], [STALE, STALE])
    bench.peer.answer(second, (2, 2))
    assert bench.read() == ([2, 2], [0, 0])
    bench.peer.answer(first, (1, 1))
    assert bench.read() == ([2, 2], [CORRUPT, CORRUPT])


def test_a_reply_counts_once_only(bench):
    request = bench.ask()
    bench.peer.answer(request, (3, 3))
    assert bench.read()[1] == [0, 0]
    bench.peer.answer(request, (4, 4))
    assert bench.read() == ([3, 3], [CORRUPT, CORRUPT])


@pytest.mark.parametrize(
    "spoilt",
    [
        lambda r, good: tcp_frame(r.transaction + 1, good),
        lambda r, good: tcp_frame(r.transaction - 30, good),
        lambda r, good: tcp_frame(r.transaction, good, protocol=1),
        lambda r, good: tcp_frame(r.transaction, good, unit=2),
        lambda r, good: tcp_frame(r.transaction, bytes([3]) + good[1:]),
        lambda r, good: tcp_frame(r.transaction, good[:1] + bytes([8]) + good[2:]),
        lambda r, good: tcp_frame(r.transaction, good[:-2]),
        lambda r, good: tcp_frame(r.transaction, good + b"\0\0"),
        lambda r, good: tcp_frame(r.transaction, reply_pdu(registers_of((9, 9), r.sequence - 1))),
        lambda r, good: tcp_frame(r.transaction, bytes([0x97, 2])),
        lambda r, good: tcp_frame(r.transaction, bytes([0x97, 4])),
        lambda r, good: tcp_frame(r.transaction, bytes([0x83, 2])),
        lambda r, good: b"HTTP/1.1 400 Bad Request\r\n\r\n",
    ],
    ids=[
        "transaction never sent",
        "transaction long past",
        "protocol",
        "unit",
        "function",
        "byte count",
        "too short",
        "too long",
        "sequence echo",
        "exception",
        "device failure",
        "foreign exception",
        "text",
    ],
)
def test_what_is_no_reply_to_the_request_is_refused_and_the_next_one_counts(bench, spoilt):
    request = bench.ask()
    bench.peer.send(spoilt(request, reply_pdu(registers_of((9, 9), request.sequence))))
    assert bench.read() == ([0, 0], [CORRUPT, CORRUPT])
    bench.peer.answer(bench.ask(), (1, 2))
    assert bench.read() == ([1, 2], [0, 0])


def test_a_device_that_stalls_is_not_sent_a_queue_of_old_commands(bench):
    asked = [bench.ask() for _ in range(4)]
    bench.driver.write(bench.outputs)
    assert bench.peer.idle()
    assert bench.read()[1] == [STALE, STALE]
    for request in asked:
        bench.peer.answer(request, (request.sequence, 0))
    # The newest request is older than a period by now, and so is the sample.
    assert bench.read() == ([0, 0], [STALE, STALE])
    bench.peer.answer(bench.ask(), (1, 1))
    assert bench.read() == ([1, 1], [0, 0])


def test_a_device_that_forgot_its_requests_is_asked_again_after_a_while(bench):
    for _ in range(4):
        bench.ask()
    bench.driver.write(bench.outputs)
    assert bench.peer.idle()
    time.sleep(0.11)
    bench.peer.answer(bench.ask(), (6, 6))
    assert bench.read() == ([6, 6], [0, 0])


def test_a_connection_that_is_closed_is_reported_and_nothing_is_raised(bench):
    bench.peer.answer(bench.ask(), (5, 5))
    bench.peer.drop()
    assert bench.read() == ([5, 5], [0, 0])
    for _ in range(3):
        assert bench.read() == ([5, 5], [GONE, GONE])
        bench.driver.write(bench.outputs)


def test_a_connection_that_is_reset_while_writing_is_reported_and_nothing_is_raised(bench):
    bench.ask()
    bench.peer.drop()
    for _ in range(3):
        bench.driver.write(bench.outputs)
    assert bench.read() == ([0, 0], [GONE, GONE])


def test_after_a_loss_close_and_open_bring_counts_again(bench):
    bench.peer.drop()
    bench.read()
    assert bench.read()[1] == [GONE, GONE]
    bench.driver.close()
    bench.open(lambda: bench.peer.answer(bench.peer.request(), (8, 9)))
    assert bench.read() == ([8, 9], [0, 0])


def test_read_and_write_without_a_connection_tell_it_and_do_not_raise():
    driver = make()
    inputs = Inputs(2)
    driver.read(inputs)
    assert inputs.status.tolist() == [GONE, GONE]
    driver.close()
    driver.safe()


def test_safe_sends_zero_and_disable_whatever_is_outstanding(bench):
    for _ in range(4):
        bench.ask((10.0, 10.0), (1, 1))
    started = time.monotonic()
    bench.driver.safe()
    assert time.monotonic() - started < 2.0  # pymodbus' own time-out is 3 s
    assert bench.peer.request().registers[:3] == [0, 0, 0]
    assert bench.driver.safe_sent is None  # sent, and not answered


def test_safe_after_a_loss_connects_for_itself(bench):
    bench.peer.drop()
    bench.read()
    bench.driver.safe()  # the listening socket takes the connection; nobody answers
    bench.peer.accept()
    request = bench.peer.request()
    assert (request.function, request.registers) == (16, [0, 0, 0, 0])
    assert bench.driver.safe_sent is False
    assert "no valid answer" in bench.driver.safe_failed


def test_a_channel_that_no_axis_uses_stays_at_its_zero_and_disabled():
    some = copy.deepcopy(CHANNELS)
    # Offset binary, between the axis' own registers; and another one beyond them all.
    some[0]["enable"]["address"] = 6
    some[1]["volts"] |= {"address": 4, "bits": 32, "signed": False, "zero_count": 1 << 31}
    some[2] = copy.deepcopy(some[1])
    some[2]["volts"]["address"], some[2]["enable"]["bit"] = 20, 2
    some[2]["counts"]["address"] = 10
    bench = tcp_bench(n=1, channels=some, word_order="low_first")
    asked = []

    def serve():
        asked.append(bench.peer.request())
        bench.peer.answer(asked[0])

    bench.open(serve)
    asked.append(bench.ask((0.0,), (0,)))
    asked.append(bench.ask((1.0,), (1,)))
    bench.driver.safe()
    asked.append(bench.peer.request())
    bench.peer.drop()
    bench.read()
    bench.driver.safe()
    bench.peer.accept()
    asked.append(bench.peer.request())
    assert [r.function for r in asked] == [23, 23, 23, 23, 16]
    volts_and_enable = [(r.registers[0], r.registers[6]) for r in asked]
    assert volts_and_enable == [(0, 0)] * 2 + [(3277, 1)] + [(0, 0)] * 2
    assert [r.registers[4:6] for r in asked] == [[0, 0x8000]] * 5
    assert {len(r.registers) for r in asked} == {7}
    bench.close()


def test_safe_of_an_unreachable_device_is_over_within_a_second():
    driver = make(tcp={"host": "192.0.2.1"})  # a network for documentation: nobody is there
    started = time.monotonic()
    driver.safe()
    assert time.monotonic() - started < 1
    assert driver.safe_sent is False
    assert "cannot connect to 192.0.2.1" in driver.safe_failed


def test_status_bits_pass_inverted_or_not_and_are_repeated_but_for_the_index():
    status = {
        "limit_negative": {"address": 5, "bit": 0},
        "home_switch": {"address": 5, "bit": 15},
        "index_latched": {"address": 5, "bit": 3},
        "estop": {"address": 6, "bit": 2, "inverted": True},
    }
    bench = tcp_bench(
        n=1,
        channels={
            0: {
                **CHANNELS[0],
                "index_counts": {"address": 2, "bits": 32},
                "status": status,
            }
        },
    )

    def answer(request, bits, estop_ok):
        words = [0, 1, 0xFFFF, 0xFFFE, request.sequence, bits, estop_ok]
        bench.peer.send(tcp_frame(request.transaction, reply_pdu(words)))

    bench.open(lambda: answer(bench.peer.request(), 0, 4))
    assert bench.read() == ([1], [0])
    answer(bench.ask(0.0, 0), 0b1001, 4)
    assert bench.read() == ([1], [Status.LIMIT_NEGATIVE | Status.INDEX_LATCHED])
    assert bench.inputs.index_counts[0] == -2
    assert bench.read() == ([1], [Status.LIMIT_NEGATIVE | STALE])
    answer(bench.ask(0.0, 0), 0x8000, 0)
    assert bench.read() == ([1], [Status.HOME_SWITCH | Status.ESTOP])
    bench.close()


MARK = int(Status.INDEX_LATCHED)


def bench_with_index():
    """Return a bench, and what answers one of its requests."""
    status = {"index_latched": {"address": 5, "bit": 3}}
    index = {"index_counts": {"address": 2, "bits": 32}, "status": status}
    bench = tcp_bench(n=1, channels={0: {**CHANNELS[0], **index}})

    def answer(request, mark_at, bit=0, sequence=None):
        number = request.sequence if sequence is None else sequence
        words = [0, 1, *divmod(mark_at, 0x10000), number, bit << 3]
        bench.peer.send(tcp_frame(request.transaction, reply_pdu(words)))

    return bench, answer


def test_another_index_mark_is_told_though_the_reply_with_its_bit_was_lost_or_late():
    bench, answer = bench_with_index()
    bench.open(lambda: answer(bench.peer.request(), 70000))
    assert bench.read() == ([1], [0])
    answer(bench.ask(0.0, 0), 70000)
    assert bench.read() == ([1], [0])
    bench.ask(0.0, 0)  # whose reply, with the bit, is lost
    assert bench.read() == ([1], [STALE])
    answer(bench.ask(0.0, 0), 80000)
    assert bench.read() == ([1], [MARK])
    assert bench.inputs.index_counts[0] == 80000
    late, newest = bench.ask(0.0, 0), bench.ask(0.0, 0)
    answer(late, 90000, 1)
    assert bench.read() == ([1], [STALE])
    answer(newest, 90000)
    assert bench.read() == ([1], [MARK])
    answer(bench.ask(0.0, 0), 90000)
    assert bench.read() == ([1], [0])
    bench.close()


def test_the_same_index_mark_is_told_again_though_the_reply_with_its_bit_is_late():
    bench, answer = bench_with_index()
    bench.open(lambda: answer(bench.peer.request(), 70000))
    assert bench.read() == ([1], [0])
    late, newest = bench.ask(0.0, 0), bench.ask(0.0, 0)
    answer(late, 70000, 1)
    assert bench.read() == ([1], [STALE])  # with the next new counts
    answer(newest, 70000)
    assert bench.read() == ([1], [MARK])
    late, newest = bench.ask(0.0, 0), bench.ask(0.0, 0)
    answer(late, 70000, 1)
    answer(newest, 70000)
    assert bench.read() == ([1], [MARK])  # both came in one period
    answer(bench.ask(0.0, 0), 70000)
    assert bench.read() == ([1], [0])
    bench.close()


def test_a_late_reply_without_the_number_of_its_request_tells_no_index_mark():
    bench, answer = bench_with_index()
    bench.open(lambda: answer(bench.peer.request(), 70000))
    assert bench.read() == ([1], [0])
    late, newest = bench.ask(0.0, 0), bench.ask(0.0, 0)
    answer(late, 70000, 1, sequence=newest.sequence)
    answer(newest, 70000)
    assert bench.read() == ([1], [0])
    bench.close()


def test_a_restart_shows_in_the_boot_id_and_stays_until_open():
    bench = tcp_bench(boot_id={"address": 5})

    def answer(request, boot_id):
        words = [*registers_of((1, 2), request.sequence), boot_id]
        bench.peer.send(tcp_frame(request.transaction, reply_pdu(words)))

    bench.open(lambda: answer(bench.peer.request(), 41))
    assert bench.read()[1] == [0, 0]
    answer(bench.ask(), 42)
    restarted = Status.DEVICE_RESTARTED | Status.ENCODER_LOST
    assert bench.read() == ([1, 2], [restarted, restarted])
    answer(bench.ask(), 41)
    assert bench.read()[1] == [restarted, restarted]
    assert bench.read()[1] == [restarted | STALE] * 2
    bench.driver.close()
    bench.open(lambda: answer(bench.peer.request(), 42))
    assert bench.read()[1] == [0, 0]
    bench.close()


@pytest.mark.slow
def test_transactions_and_sequence_numbers_wrap(bench):
    seen = set()
    for k in range(66_000):
        request = bench.ask()
        seen.add(request.sequence)
        bench.peer.answer(request, (k, 0))
        bench.driver.read(bench.inputs)
        assert bench.inputs.counts[0] == k
        assert bench.inputs.status[0] == 0
    assert len(seen) == 65535
    assert 0 not in seen


def test_memory_does_not_grow_with_the_ticks(bench):
    def run(periods):
        for _ in range(periods):
            bench.peer.answer(bench.ask((1.0, 2.0), (1, 1)), (1, 1))
            bench.driver.read(bench.inputs)
            bench.driver.read(bench.inputs)

    run(200)
    tracemalloc.start()
    try:
        run(200)
        before, _ = tracemalloc.get_traced_memory()
        run(2000)
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert after - before < 2000


def test_channels_follow_their_numbers_and_not_their_order():
    bench = tcp_bench()
    bench.driver = type(bench.driver)(
        bench.driver.options, bench.driver.channels[::-1], bench.driver.period_s
    )
    bench.open(lambda: bench.peer.answer(bench.peer.request(), (10, 20)))
    assert bench.read()[0] == [20, 10]
    assert bench.ask((1.0, 2.0), (1, 0)).registers[:3] == [0, 3277, 2]
    bench.close()


def test_a_command_that_disables_does_not_wait_for_unanswered_requests(bench):
    for _ in range(4):
        assert bench.ask((1.0, 1.0), (1, 1)).registers[2] == 0b11
    bench.driver.write(bench.outputs)
    assert bench.peer.idle(0.01)
    assert bench.ask((0.0, 1.0), (0, 1)).registers[2] == 0b10
    bench.driver.write(bench.outputs)
    assert bench.peer.idle(0.01)


def test_a_program_whose_outputs_overlap_is_refused_too(bench):
    apart = {0: copy.deepcopy(CHANNELS[1])}
    other = make(
        n=1, channels=apart, sequence=None, tcp={"host": "127.0.0.1", "port": bench.peer.port}
    )
    with pytest.raises(RunError, match="output register 257 is driven by another program"):
        other.open()
    other.safe()
    assert not select.select([bench.peer.listener], [], [], 0.1)[0], "it connected"


def test_one_program_of_a_machine_drives_the_outputs_of_a_device(bench):
    other = make(tcp={"host": "127.0.0.1", "port": bench.peer.port})
    with pytest.raises(RunError, match="driven by another program"):
        other.open()
    bench.driver.close()
    bench.open()  # a claim ends with close
