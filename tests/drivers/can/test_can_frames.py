"""State frames on a bus that loses, repeats, reorders, cuts and adds them."""

import time

import can
import pytest
from can_bench import (
    COMMAND,
    PERIOD_S,
    STATE,
    STATE_Y,
    Bench,
    answering,
    bits,
    bus,
    channels,
    frames_apart,
    frames_of_both,
    lone_bytes,
    message,
    opened,
    opened_apart,
    options,
    state_bytes,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from motorctl.hal import Inputs, Outputs, RunError, Status
from motorctl_can import CanDriver

pytestmark = pytest.mark.wall_clock(lanes=3)

STALE, CORRUPT = int(Status.STALE), int(Status.CORRUPT)
COMMUNICATION_LOST = int(Status.COMMUNICATION_LOST)
LOST = int(Status.BUS_OFF) | COMMUNICATION_LOST
RESTARTED = int(Status.DEVICE_RESTARTED | Status.ENCODER_LOST)


def test_the_newest_of_several_samples_wins():
    with opened() as bench:
        for k in range(1, 6):
            bench.send(state_bytes(k, -k, k))
        assert bench.read() == ([5, -5], [0, 0])


def test_without_news_the_count_repeats_and_is_stale():
    with opened() as bench:
        bench.send(state_bytes(7, 8, 1))
        bench.read()
        for _ in range(3):
            assert bench.read() == ([7, 8], [STALE, STALE])


def test_a_repeated_frame_is_ignored():
    with opened() as bench:
        bench.send(state_bytes(7, 8, 1))
        bench.read()
        bench.send(state_bytes(99, 99, 1))
        assert bench.read() == ([7, 8], [STALE, STALE])


def test_a_late_frame_is_refused_even_when_it_comes_after_the_newest():
    with opened() as bench:
        bench.send(state_bytes(3, 3, 3))
        bench.send(state_bytes(2, 2, 2))
        assert bench.read() == ([3, 3], [CORRUPT, CORRUPT])
        bench.send(state_bytes(1, 1, 1))
        assert bench.read() == ([3, 3], [STALE | CORRUPT] * 2)


def test_a_gap_is_a_loss_and_the_newest_is_taken():
    with opened() as bench:
        bench.send(state_bytes(1, 1, 1))
        bench.read()
        bench.send(state_bytes(9, 9, 9))
        assert bench.read() == ([9, 9], [0, 0])


@pytest.mark.parametrize("length", [0, 1, 7])
def test_a_frame_of_wrong_length_is_never_accepted(length):
    with opened() as bench:
        bench.send(state_bytes(1, 1, 1)[:length])
        assert bench.read() == ([0, 0], [STALE | CORRUPT] * 2)


def test_a_longer_frame_and_one_that_lies_about_its_length_are_refused():
    with opened() as bench:
        bench.send(state_bytes(1, 1, 1) + bytes(4), is_fd=True)
        assert bench.read()[1] == [STALE | CORRUPT] * 2
        bench.send(state_bytes(1, 1, 1), dlc=4)
        assert bench.read() == ([0, 0], [STALE | CORRUPT] * 2)


def test_foreign_extended_and_remote_frames_are_ignored():
    with opened() as bench:
        bench.send(state_bytes(1, 1, 1), identifier=STATE + 1)
        extended = can.Message(arbitration_id=STATE, is_extended_id=True, data=state_bytes(1, 1, 1))
        bench.peer.send(extended)
        remote = can.Message(
            arbitration_id=STATE, is_extended_id=False, is_remote_frame=True, dlc=8
        )
        bench.peer.send(remote)
        bench.send(b"\x01", identifier=COMMAND)
        assert bench.read() == ([0, 0], [STALE, STALE])
        for _ in range(20):  # foreign frames hide nothing that waits behind them
            bench.send(b"\x01", identifier=STATE + 7)
        bench.send(state_bytes(2, 3, 2))
        assert bench.read() == ([2, 3], [0, 0])


def test_an_old_frame_is_refused():
    chosen = options(max_age_s=0.5)
    with bus(chosen.channel, preserve_timestamps=True) as peer:
        bench = Bench(chosen, peer)
        with answering(peer, {STATE: state_bytes(0, 0, 0)}):
            bench.driver.open()
        try:
            bench.send(state_bytes(1, 1, 1), timestamp=time.time() - 1.0)
            assert bench.read() == ([0, 0], [STALE | CORRUPT] * 2)
            bench.send(state_bytes(2, 2, 2), timestamp=time.time())
            assert bench.read() == ([2, 2], [0, 0])
        finally:
            bench.driver.close()


def test_each_axis_is_stale_by_itself():
    with opened_apart() as bench:
        bench.send(lone_bytes(5, 1), STATE)
        assert bench.read() == ([5, 0], [0, STALE])
        bench.send(lone_bytes(6, 1), STATE_Y)
        assert bench.read() == ([5, 6], [STALE, 0])
        bench.send(lone_bytes(7, 2), STATE_Y)
        bench.send(lone_bytes(9, 0), STATE)
        assert bench.read() == ([5, 7], [STALE | CORRUPT, 0])


def test_two_frames_of_one_moment_are_read_a_period_apart_where_a_read_falls_between_them():
    """So `sampled_apart_s` is a period without SYNC, whoever sends the frames."""
    with opened_apart() as bench:
        assert bench.driver.sampled_apart_s == PERIOD_S
        bench.send(lone_bytes(10, 1), STATE)
        assert bench.read() == ([10, 0], [0, STALE])
        for moment in range(2, 5):
            bench.send(lone_bytes(10 * (moment - 1), moment - 1), STATE_Y)
            bench.send(lone_bytes(10 * moment, moment), STATE)
            assert bench.read() == ([10 * moment, 10 * (moment - 1)], [0, 0])


def test_a_babbling_bus_is_read_in_bounded_pieces():
    with opened(max_frames_per_read=8) as bench:
        for k in range(1, 21):
            bench.send(state_bytes(k, k, k))
        # the oldest come first: what is taken is not known to be the newest
        assert bench.read() == ([0, 0], [STALE | CORRUPT] * 2)
        assert bench.read() == ([0, 0], [STALE | CORRUPT] * 2)
        assert bench.read() == ([20, 20], [0, 0])
        for _ in range(10):
            bench.send(b"", identifier=0x7FF)
        assert bench.read()[1] == [STALE | CORRUPT] * 2


def test_a_changed_boot_counter_is_a_restart_until_opened_again():
    with opened() as bench:
        bench.send(state_bytes(1, 1, 100))
        assert bench.read()[1] == [0, 0]
        bench.send(state_bytes(0, 0, 0, boot=2))  # its sequence begins anew as well
        assert bench.read() == ([0, 0], [RESTARTED] * 2)
        bench.send(state_bytes(4, 4, 1, boot=2))
        assert bench.read() == ([4, 4], [RESTARTED] * 2)


def test_after_long_silence_without_boot_counter_the_count_is_not_trusted():
    with opened_apart() as bench:
        for _ in range(127):
            bench.read()
        bench.send(lone_bytes(1, 1), STATE)
        assert bench.read()[1] == [0, STALE]
        for _ in range(10):
            bench.read()
        bench.send(lone_bytes(2, 2), STATE)
        bench.send(lone_bytes(2, 200), STATE_Y)
        assert bench.read() == ([2, 2], [0, RESTARTED])


def test_after_long_silence_an_unchanged_boot_counter_says_that_the_count_holds():
    with opened() as bench:
        for _ in range(200):
            bench.read()
        bench.send(state_bytes(5, 6, 200))
        assert bench.read() == ([5, 6], [0, 0])


def with_index():
    frames = frames_apart()
    state = frames["state_x"]
    state["length"] = 12
    state["signals"]["index"] = bits("index_counts", 40, 32, "x", signed=True)
    state["signals"]["latched"] = bits("index_latched", 72, 1, "x")
    return frames


def index_bytes(count, sequence, index, latched=0):
    return lone_bytes(count, sequence) + lone_bytes(index, latched) + bytes(2)


def test_an_index_mark_is_told_once_even_if_its_frame_was_not_the_newest():
    first = {STATE: index_bytes(0, 0, 77), STATE_Y: lone_bytes(0, 0)}
    mark = int(Status.INDEX_LATCHED)
    with opened(first, 32, frames=with_index(), fd=True) as bench:
        bench.send(index_bytes(1, 1, 77))
        assert bench.read()[1] == [0, STALE]
        bench.send(index_bytes(2, 2, -5, 1))
        bench.send(index_bytes(3, 3, -5))
        assert bench.read() == ([3, 0], [mark, STALE])
        assert bench.inputs.index_counts[0] == -5
        bench.send(index_bytes(4, 4, -5))
        assert bench.read()[1] == [0, STALE]
        bench.send(index_bytes(5, 5, -5, 1))  # the same mark again
        assert bench.read()[1] == [mark, STALE]
        bench.send(index_bytes(7, 7, 40))  # after the frame with the bit of another one was lost
        assert bench.read()[1] == [mark, STALE]


def test_an_error_frame_without_a_cause_is_bus_off_until_frames_come_again():
    with opened() as bench:
        bench.peer.send(can.Message(is_error_frame=True))
        assert bench.read()[1] == [LOST | STALE] * 2
        assert bench.read()[1] == [LOST | STALE] * 2
        bench.send(state_bytes(1, 1, 1))
        assert bench.read() == ([1, 1], [0, 0])


def test_a_bus_that_vanished_is_status_and_not_an_exception():
    with opened() as bench:
        bench.driver._link._bus.shutdown()
        bench.driver.write(bench.outputs)
        assert bench.read()[1] == [LOST | STALE | CORRUPT] * 2
        assert bench.read()[1] == [LOST | STALE] * 2  # no command was to be sent
        bench.driver.safe()


def test_a_transmit_buffer_full_for_three_periods_is_a_lost_bus_until_a_frame_is_sent():
    with opened() as bench, bus(bench.driver.options.channel, rx_queue_size=2) as slow:
        lost = CORRUPT | COMMUNICATION_LOST
        for told in (0, 0, CORRUPT, CORRUPT, lost, lost):  # two found room
            bench.driver.write(bench.outputs)
            assert bench.read()[1] == [told | STALE] * 2
        while slow.recv(0):
            pass
        bench.driver.write(bench.outputs)
        bench.send(state_bytes(1, 1, 1))
        assert bench.read()[1] == [0, 0]


def test_two_commands_without_room_are_told_and_do_not_stop_a_machine():
    with opened() as bench, bus(bench.driver.options.channel, rx_queue_size=2) as slow:
        for k in range(1, 20):
            for _ in range(4):  # two of four find room
                bench.driver.write(bench.outputs)
            while slow.recv(0):
                pass
            bench.send(state_bytes(k, k, k))
            assert bench.read() == ([k, k], [CORRUPT] * 2)
            while slow.recv(0):
                pass


def told_of_periods(bench, slow, room):
    """Return what each read tells after a write with room for the commands, or without."""
    told = []
    for has_room in room:
        if has_room:
            while slow.recv(0):
                pass
        bench.driver.write(bench.outputs)
        told.append(bench.read()[1][0] & ~STALE)
    return told


def test_commands_that_are_refused_in_two_of_three_periods_are_a_lost_bus():
    with opened() as bench, bus(bench.driver.options.channel, rx_queue_size=1) as slow:
        told = told_of_periods(bench, slow, [True, False, False] * 4)
    lost = CORRUPT | COMMUNICATION_LOST
    assert told[:6] == [0, CORRUPT, CORRUPT, 0, CORRUPT, lost]
    assert told[6:] == [0, lost, lost] * 2


def test_commands_that_are_refused_in_every_second_period_are_told_each_time():
    with opened() as bench, bus(bench.driver.options.channel, rx_queue_size=1) as slow:
        assert told_of_periods(bench, slow, [True, False] * 20) == [0, CORRUPT] * 20


def test_after_a_wrong_sequence_number_the_third_right_one_is_taken():
    with opened() as bench:
        bench.send(state_bytes(9, 9, 1))
        assert bench.read() == ([9, 9], [0, 0])
        bench.send(state_bytes(10, 10, 100))  # the number is wrong
        assert bench.read() == ([10, 10], [0, 0])
        for k in (3, 4):
            bench.send(state_bytes(8 + k, 8 + k, k))
            assert bench.read() == ([10, 10], [CORRUPT | STALE] * 2)
        bench.send(state_bytes(13, 13, 5))
        assert bench.read() == ([13, 13], [0, 0])


def test_a_wrong_sequence_number_a_little_ahead_is_passed():
    with opened() as bench:
        for k in (1, 2, 3 + 16):
            bench.send(state_bytes(k, k, k))
            assert bench.read() == ([k, k], [0, 0])
        for k in range(4, 20):
            bench.send(state_bytes(k, k, k))
            assert bench.read()[0] == [19, 19]
        bench.send(state_bytes(20, 20, 20))
        assert bench.read() == ([20, 20], [0, 0])


@pytest.mark.parametrize(
    ("sent", "again"),
    [
        ((10, 11, 12, 13, 14), (11, 12, 13)),  # repeated
        ((10, 11, 12, 13, 14), (12, 13, 14)),
        ((10, 14), (11, 12, 13)),  # overtaken
        ((10, 30), (27, 28, 29)),  # and many lost
        ((20, 120, 21, 22, 23), (21, 22, 23)),  # after a number that was wrong
    ],
)
def test_old_frames_are_refused_though_they_follow_one_another(sent, again):
    with opened() as bench:
        for k in sent:
            bench.send(state_bytes(k, k, k))
            bench.read()
        newest = sent[-1]
        for k in again:
            bench.send(state_bytes(k, k, k))
            counts, status = bench.read()
            assert (counts, status[0] & STALE) == ([newest, newest], STALE)
        bench.send(state_bytes(newest + 1, newest + 1, newest + 1))
        assert bench.read() == ([newest + 1, newest + 1], [0, 0])


@pytest.mark.parametrize("last", [40, 100, 126, 127])
def test_a_device_that_began_anew_is_not_taken_for_one_with_a_wrong_number(last):
    frames = frames_of_both()
    del frames["positions"]["signals"]["boot"]
    with opened(frames=frames) as bench:
        for k in (last - 2, last - 1, last):
            bench.send(state_bytes(9, 9, k))
            bench.read()
        for k in range(6):  # its numbers and its counts begin again
            bench.send(state_bytes(0, 0, k))
            assert bench.read() == ([9, 9], [CORRUPT | STALE] * 2)


def test_old_frames_that_do_not_follow_each_other_are_never_taken():
    with opened() as bench:
        bench.send(state_bytes(9, 9, 100))
        assert bench.read() == ([9, 9], [0, 0])
        for k in (40, 42, 43, 50, 49, 48, 47, 60, 61):
            bench.send(state_bytes(k, k, k))
            assert bench.read() == ([9, 9], [CORRUPT | STALE] * 2)


def test_safe_zeroes_and_disables_from_any_state():
    driver = CanDriver(options(), channels(), 1e-3)
    driver.safe()  # never opened
    inputs, outputs = Inputs(2), Outputs(2)
    driver.read(inputs)
    assert inputs.status.tolist() == [int(Status.COMMUNICATION_LOST) | STALE] * 2
    driver.write(outputs)
    with opened() as bench:
        bench.outputs.volts[:], bench.outputs.enable[:] = 9.0, 1
        bench.driver.write(bench.outputs)
        bench.sent()
        bench.driver.safe()
        sent = bench.sent()
        assert len(sent) >= 2
        assert all(bytes(m.data[:5]) == bytes(5) for m in sent)
        bench.driver.close()
        assert all(bytes(m.data[:5]) == bytes(5) for m in bench.sent())
        bench.driver.safe()
        bench.driver.close()


def test_opening_without_a_device_names_the_frame_and_the_bus():
    chosen = options(open_timeout_s=0.05)
    driver = CanDriver(chosen, channels(), 1e-3)
    with pytest.raises(RunError, match=rf"{chosen.channel}.*positions.*0x180.*open_timeout_s"):
        driver.open()
    driver.close()


def test_opening_against_frames_of_another_length_says_so():
    chosen = options(open_timeout_s=0.2)
    with bus(chosen.channel) as peer:
        driver = CanDriver(chosen, channels(), 1e-3)
        with answering(peer, {STATE: b"\x01\x02"}), pytest.raises(RunError, match="wrong length"):
            driver.open()


def test_opening_again_starts_afresh():
    with opened() as bench:
        bench.send(state_bytes(1, 1, 1, boot=9))
        assert bench.read()[1] == [RESTARTED] * 2
        with answering(bench.peer, {STATE: state_bytes(3, 3, 200, boot=9)}):
            bench.driver.open()
        bench.send(state_bytes(4, 4, 201, boot=9))
        assert bench.read() == ([4, 4], [0, 0])


@settings(max_examples=60)
@given(st.lists(st.sampled_from(["send", "lose", "repeat", "late", "cut", "read"]), max_size=40))
def test_no_wrong_count_is_accepted_whatever_the_bus_does(deeds):
    """The true count is the sequence number; what is read is always one that was sent, newest."""
    with opened() as bench:
        k, newest, last_read = 0, 0, 0
        for deed in deeds:
            if deed in ("send", "lose"):
                k += 1
            if deed == "send":
                bench.send(state_bytes(k, -k, k))
                newest = k
            elif deed == "repeat":
                bench.send(state_bytes(newest, -newest, newest))
            elif deed == "late" and newest > 1:
                bench.send(state_bytes(newest - 1, 1 - newest, newest - 1))
            elif deed == "cut":
                bench.send(state_bytes(555, 555, k + 1)[:6])
            elif deed == "read":
                counts, status = bench.read()
                assert counts == [newest, -newest]
                stale = [bool(s & STALE) for s in status]
                assert stale == [newest == last_read] * 2
                last_read = newest


def test_messages_are_built_once(monkeypatch):
    with opened() as bench:
        made = []
        plain = can.Message.__init__
        monkeypatch.setattr(
            can.Message, "__init__", lambda self, *a, **k: (made.append(1), plain(self, *a, **k))[1]
        )
        link = bench.driver._link
        kept = []
        monkeypatch.setattr(link, "send", lambda m: kept.append(id(m)) or True)
        for _ in range(5):
            bench.driver.write(bench.outputs)
        assert not made
        assert len(set(kept)) == 1
        monkeypatch.undo()
    assert message(b"").dlc == 0
