"""Faults that a device file orders, seen from the other end of the wire."""

from __future__ import annotations

import time
from typing import Any

import can
import pytest
from gantry_device_bench import (
    MODBUS,
    SerialPeer,
    TcpPeer,
    device_data,
    exchange_pdu,
    from_wire,
    running,
    state_of,
    until,
    write_device,
)
from gantry_device_frames import CHANNELS, FRAMES, STATE_ID, SYNC_ID, CanPeer
from hypothesis import given
from hypothesis import strategies as st

from motorctl.errors import ConfigError
from motorctl_benchmarks.buses.beams import can_frames
from motorctl_devices.line import Line, flip_bits
from motorctl_devices.load import load_device
from motorctl_devices.orders import FaultOrder
from motorctl_devices.schedule import Schedule

pytestmark = pytest.mark.wall_clock(lanes=3)

TCP = {"modbus": {"tcp": {"port": 0}, **MODBUS}}
SERIAL: dict[str, Any] = {"serial": {}}
MS = 1_000_000


def _with(serve: dict[str, Any], *faults: dict[str, Any], **changes: Any) -> dict[str, Any]:
    return device_data(serve, faults=list(faults), **changes)


def _can(*faults: dict[str, Any], channel: str) -> dict[str, Any]:
    bus = {"interface": "virtual", "channel": channel, "sync": {"id": SYNC_ID}, "frames": FRAMES}
    return _with({"can": bus}, *faults, channels=CHANNELS)


def _fired(device: Any) -> list[int]:
    return [fault.fired for fault in device.schedule.faults]


class _Wire:
    """A line of bytes with faults in force, and what comes out of it."""

    def __init__(self, *orders: dict[str, Any], seed: int = 1) -> None:
        parsed = [FaultOrder.model_validate({"at_s": 0.0, **order}) for order in orders]
        self.schedule = Schedule(parsed, seed)
        self.out: list[bytes] = []
        self.line: Line[bytes] = Line(
            self.out.append, flip_bits, lambda m, f: m[:1], self.schedule.faults, "from_device"
        )
        self.schedule.start(0)
        self.schedule.update(0)
        self.line.settle()

    def pass_through(self, count: int) -> list[bytes]:
        for k in range(count):
            self.line.send(b"%06d" % k, k * MS)
            if self.line.due_ns <= k * MS:
                self.line.flush(k * MS)
        self.line.flush(10**15)
        return self.out


MESSAGES = [b"%06d" % k for k in range(200)]


def test_a_line_without_faults_changes_nothing() -> None:
    assert _Wire().pass_through(200) == MESSAGES


@given(st.integers(1, 20))
def test_every_nth_message_is_lost(every) -> None:
    kept = [m for k, m in enumerate(MESSAGES, 1) if k % every]
    assert _Wire({"kind": "loss", "every": every}).pass_through(200) == kept


@given(st.integers(0, 2**32))
def test_a_share_of_messages_is_lost_and_the_same_seed_loses_the_same(seed) -> None:
    first, again = (_Wire({"kind": "loss", "share": 0.3}, seed=seed) for _ in range(2))
    kept = first.pass_through(200)
    assert kept == again.pass_through(200)
    assert 100 <= len(kept) <= 180


@given(st.floats(1e-4, 0.05), st.floats(1e-4, 0.05))
def test_delay_and_jitter_keep_every_message_in_order(delay_s, jitter_s) -> None:
    wire = _Wire({"kind": "delay", "amount_s": delay_s}, {"kind": "jitter", "amount_s": jitter_s})
    assert wire.pass_through(200) == MESSAGES


def test_a_delayed_message_comes_when_it_is_due() -> None:
    wire = _Wire({"kind": "delay", "amount_s": 0.002})
    wire.line.send(b"late", 0)
    wire.line.flush(2 * MS - 1)
    assert wire.out == []
    assert wire.line.due_ns == 2 * MS
    wire.line.flush(2 * MS)
    assert wire.out == [b"late"]


def test_reordering_lets_the_next_message_overtake() -> None:
    assert _Wire({"kind": "reordering", "every": 3}).pass_through(6) == [
        MESSAGES[k] for k in (0, 1, 3, 2, 4)
    ]  # the sixth waits for one to overtake it


def test_duplicates_come_twice() -> None:
    wire = _Wire({"kind": "duplicates", "every": 2})
    assert wire.pass_through(4) == [MESSAGES[k] for k in (0, 1, 1, 2, 3, 3)]


@given(st.floats(0.05, 1.0))
def test_a_share_of_bytes_is_damaged_by_one_bit_each(share) -> None:
    out = _Wire({"kind": "bit_errors", "byte_share": share}).pass_through(200)
    wrong = [
        (a ^ b).bit_count()
        for m, n in zip(out, MESSAGES, strict=True)
        for a, b in zip(m, n, strict=True)
    ]
    assert set(wrong) <= {0, 1}
    assert abs(sum(wrong) / 1200 - share) < 0.1


def test_faults_have_random_numbers_of_their_own() -> None:
    alone = _Wire({"kind": "loss", "share": 0.3}).pass_through(200)
    beside = _Wire(
        {"kind": "loss", "share": 0.3}, {"kind": "jitter", "amount_s": 0.001}
    ).pass_through(200)
    assert alone == beside


def test_the_clock_of_faults_starts_with_the_first_enabled_command(tmp_path) -> None:
    data = _with(TCP, {"kind": "silence", "at_s": 0.15, "duration_s": 0.2})
    with running(tmp_path, data) as device, TcpPeer(device.endpoint.address, 0.1) as peer:
        time.sleep(0.2)
        peer.exchange((0.0, 0.0), enable=0)
        assert not device.schedule.started
        begun = time.monotonic()
        while time.monotonic() - begun < 0.1:
            peer.exchange((0.5, 0.0))
        time.sleep(0.1)
        peer.send(exchange_pdu((0.5, 0.0)))
        with pytest.raises(TimeoutError):
            peer.receive()
        time.sleep(0.2)
        assert peer.exchange((0.5, 0.0))["status"] == 0
        assert _fired(device) == [1]


def test_silence_ends_in_the_watchdog(tmp_path) -> None:
    data = _with(TCP, {"kind": "silence", "at_s": 0.0, "duration_s": 0.3}, watchdog_s=0.05)
    with running(tmp_path, data) as device, TcpPeer(device.endpoint.address, 0.03) as peer:
        peer.send(exchange_pdu((1.0, 0.0)))
        until(lambda: device.schedule.started)
        for _ in range(4):  # the host goes on, unheard
            time.sleep(0.03)
            peer.send(exchange_pdu((1.0, 0.0)))
        until(lambda: device.machine.watchdog_trips == 1, 0.5)
        assert device.machine.volts == [0.0, 0.0]


def test_a_delayed_reply_leaves_later(tmp_path) -> None:
    data = _with(TCP, {"kind": "delay", "at_s": 0.0, "amount_s": 0.05})
    with running(tmp_path, data) as device, TcpPeer(device.endpoint.address) as peer:
        peer.exchange((0.5, 0.0))
        until(lambda: device.schedule.faults[0].active)
        for _ in range(3):
            begun = time.monotonic()
            peer.exchange((0.5, 0.0))
            assert 0.05 <= time.monotonic() - begun < 0.25


def test_lost_commands_leave_the_old_ones_in_force(tmp_path) -> None:
    data = _with(TCP, {"kind": "loss", "at_s": 0.0, "every": 1, "way": "to_device"})
    with running(tmp_path, data) as device, TcpPeer(device.endpoint.address, 0.05) as peer:
        peer.exchange((0.5, 0.0))
        until(lambda: device.schedule.faults[0].active)
        peer.send(exchange_pdu((2.0, 0.0)))
        with pytest.raises(TimeoutError):
            peer.receive()
        assert device.machine.volts[0] == pytest.approx(0.5, abs=1e-3)


def test_a_reset_in_motion_changes_the_start_and_zeroes_counters_and_volts(tmp_path) -> None:
    data = _with(SERIAL, {"kind": "reset", "at_s": 0.1, "duration_s": 0.05})
    with running(tmp_path, data) as device, SerialPeer(device.endpoint.address) as peer:
        peer.hello()
        boot = device.machine.boot_id
        while device.machine.restarts == 0:
            peer.command((3.0, 0.0))
            time.sleep(0.002)
        assert device.machine.volts == [0.0, 0.0]
        assert device.machine.travelled_counts()[0][1] > 3000
        body = peer.receive(0.5)
        while body[0] != 0x81 or body[8:10] != b"\0\0":
            body = peer.receive(0.5)
        assert int.from_bytes(body[12:16], "little") == device.machine.boot_id != boot
        sent = peer.send(4)
        body = peer.receive()
        assert (body[0], body[2], body[4]) == (0x83, 2, sent)  # there is no session
        peer.hello()
        assert peer.poll()["sample"] < 10
        assert _fired(device) == [1]


def test_a_reset_hangs_up_on_tcp_and_counts_begin_anew(tmp_path) -> None:
    data = _with(TCP, {"kind": "reset", "at_s": 0.08, "duration_s": 0.05})
    with running(tmp_path, data) as device:
        address = device.endpoint.address
        with TcpPeer(address) as peer:
            boot = peer.exchange((2.0, 0.0))["boot"]

            seen = [0]

            def hung_up() -> bool:
                try:
                    seen.append(peer.exchange((2.0, 0.0))["counts"][0])
                except ConnectionError:
                    return True
                return False

            until(hung_up, 1.0)
        before_reset = seen[-1]
        assert before_reset > 1000
        until(device.endpoint.filenos, 1.0)
        with TcpPeer(address) as peer:
            state = peer.exchange((0.0, 0.0), enable=0)
            assert state["boot"] == (boot + 1) % 65536
            # It still coasts; what it made before the reset is missing in the count.
            assert device.machine.travelled_counts()[0][1] - state["counts"][0] > before_reset / 2
            assert state["counts"][0] >= 0


def test_a_broken_amplifier_says_so_and_gives_nothing_until_it_is_mended(tmp_path) -> None:
    data = _with(TCP, {"kind": "amplifier_fault", "at_s": 0.1, "duration_s": 0.15, "channel": 1})
    fault_x, fault_y = 1 << 1, 1 << 7
    with running(tmp_path, data) as device, TcpPeer(device.endpoint.address) as peer:
        told = lambda: peer.exchange((1.0, 1.0))["status"] & (fault_x | fault_y)  # noqa: E731
        assert told() == 0
        until(told, 1.0)
        assert told() == fault_y
        assert device.machine.volts == [pytest.approx(1.0, abs=1e-3), 0.0]
        assert device.machine.enabled == [True, False]
        until(lambda: not told(), 1.0)
        assert device.machine.enabled == [True, True]
        assert _fired(device) == [1]


def test_a_lost_encoder_says_so_and_its_count_stands_still_until_it_is_back(tmp_path) -> None:
    data = _with(TCP, {"kind": "encoder_lost", "at_s": 0.1, "duration_s": 0.2, "channel": 1})
    lost_x, lost_y = 1 << 0, 1 << 6
    with running(tmp_path, data) as device, TcpPeer(device.endpoint.address) as peer:
        exchange = lambda: peer.exchange((2.0, 2.0))  # noqa: E731
        told = lambda: exchange()["status"] & (lost_x | lost_y)  # noqa: E731
        assert told() == 0
        until(told, 1.0)
        assert told() == lost_y
        before = exchange()["counts"]
        time.sleep(0.05)
        after = exchange()["counts"]
        assert after[0] != before[0]  # the other end moves on
        assert after[1] == before[1]
        until(lambda: not told(), 1.0)
        assert exchange()["counts"][1] != before[1]
        assert _fired(device) == [1]


BEAM_ENDS = [dict(CHANNELS[0], axis=end, counter_bits=32) for end in ("x", "x.2")]


def _beam_on_can(*faults: dict[str, Any], channel: str) -> dict[str, Any]:
    bus = {"interface": "virtual", "channel": channel, "sync": {"id": SYNC_ID}}
    serve = {"can": {**bus, "frames": can_frames()}}
    return _with(serve, *faults, channels=BEAM_ENDS)


def test_one_of_two_drives_is_silent_while_the_other_answers(tmp_path) -> None:
    order = {"kind": "drive_silent", "at_s": 0.1, "duration_s": 0.2, "channel": 1}
    data = _beam_on_can(order, channel="silent")
    with (
        running(tmp_path, data) as device,
        can.Bus("silent", interface="virtual") as peer,
    ):
        frame = can_frames()["command"]

        def heard() -> set[int]:
            for identifier, content in ((frame["id"], bytes(4) + b"\x03\xff\0"), (SYNC_ID, b"")):
                peer.send(
                    can.Message(arbitration_id=identifier, data=content, is_extended_id=False)
                )
            time.sleep(0.01)
            found = set()
            while (message := peer.recv(0)) is not None:
                found.add(message.arbitration_id)
            return found

        both = {0x181, 0x182}
        assert heard() == both
        until(lambda: heard() == {0x181}, 1.0)
        until(lambda: heard() == both, 1.0)
        assert device.machine.enabled == [True, True]  # it heard all the while
        assert _fired(device) == [1]


@pytest.mark.parametrize(
    "data",
    [
        _can({"kind": "drive_silent", "at_s": 0.1, "channel": 1}, channel="together"),
        _with(TCP, {"kind": "drive_silent", "at_s": 0.1, "channel": 1}),
    ],
    ids=["one frame for both", "one reply for both"],
)
def test_a_drive_without_a_message_of_its_own_cannot_be_silent_alone(tmp_path, data) -> None:
    with pytest.raises(ConfigError, match="where one message tells of all channels, order silence"):
        load_device(write_device(tmp_path, data))


def test_a_counter_jumps_once_for_good(tmp_path) -> None:
    data = _with(TCP, {"kind": "counter_jump", "at_s": 0.1, "counts": -5000, "channel": 0})
    with running(tmp_path, data) as device, TcpPeer(device.endpoint.address) as peer:
        counts = lambda: peer.exchange((0.0, 0.0))["counts"]  # noqa: E731
        x, y = counts()
        until(lambda: counts()[0] < x - 2500, 1.0)
        time.sleep(0.05)
        after = counts()
        assert abs(after[0] - (x - 5000)) < 500
        assert abs(after[1] - y) < 500


def test_an_unplugged_port_is_gone_and_comes_back_behind_its_link(tmp_path) -> None:
    link = tmp_path / "port"
    data = _with(SERIAL, {"kind": "unplug", "at_s": 0.05, "duration_s": 0.1})
    with running(tmp_path, data, link) as device:
        with SerialPeer(link) as peer:
            peer.hello()
            peer.command((1.0, 0.0))
            until(lambda: not link.is_symlink())

            def hung_up() -> bool:
                try:
                    peer.write(b"\0")
                except OSError:
                    return True
                return False

            until(hung_up)  # the link goes first, the port a moment later
        until(lambda: device.endpoint.plugged and link.exists())
        with SerialPeer(link) as peer:
            assert peer.hello()[0] == 0x81


def test_counters_that_start_near_the_wrap_wrap(tmp_path) -> None:
    data = _with(TCP, {"kind": "counter_wrap", "counts": 500, "channel": 0})
    with running(tmp_path, data) as device, TcpPeer(device.endpoint.address) as peer:
        assert abs(peer.exchange((5.0, 0.0))["counts"][0] - (2**31 - 500)) < 20
        until(lambda: peer.exchange((5.0, 0.0))["counts"][0] < 0, 1.0)
        assert peer.exchange((0.0, 0.0))["counts"][0] < -(2**31) + 20000
        assert abs(peer.exchange((0.0, 0.0))["counts"][1]) < 500


def test_wrong_sequences_are_stuck_or_random(tmp_path) -> None:
    stuck = {"kind": "wrong_sequence", "at_s": 0.0, "duration_s": 0.1}
    data = _with(TCP, stuck, {**stuck, "at_s": 0.2, "sequence": "random"})
    with running(tmp_path, data) as device, TcpPeer(device.endpoint.address) as peer:
        peer.exchange((0.1, 0.0), sequence=500)
        until(lambda: device.schedule.faults[0].active)
        assert [peer.exchange((0.1, 0.0), sequence=k)["sequence"] for k in (501, 502)] == [500] * 2
        until(lambda: device.schedule.faults[1].active)
        wrong = [peer.exchange((0.1, 0.0), sequence=k)["sequence"] for k in range(600, 605)]
        assert wrong != list(range(600, 605))
        assert len(set(wrong)) > 2


def test_damaged_bytes_are_seen_by_both_checksums(tmp_path) -> None:
    errors = {"kind": "bit_errors", "at_s": 0.0, "every": 2, "way": "both"}
    with (
        running(tmp_path, _with(SERIAL, errors, watchdog_s=5.0)) as device,
        SerialPeer(device.endpoint.address) as peer,
    ):
        peer.hello()
        peer.command((0.1, 0.0))
        until(lambda: device.schedule.faults[0].active)
        good = bad = 0
        for _ in range(40):
            peer.send(4)
            try:
                decoded = from_wire(peer.read_until(b"\0", 0.05))
            except TimeoutError:
                continue
            good, bad = good + (decoded is not None), bad + (decoded is None)
        assert bad > 3
        assert good > 3
        assert device.endpoint.refused > 3


def test_frames_of_wrong_length_and_of_others_come_on_can(tmp_path) -> None:
    channel = "gantry-device-faults"
    wrong = {"kind": "wrong_length", "at_s": 0.0, "every": 2}
    data = _can(wrong, {"kind": "babbling", "at_s": 0.0, "rate_hz": 500}, channel=channel)
    with (
        running(tmp_path, data) as device,
        CanPeer(can.Bus(interface="virtual", channel=channel)) as peer,
    ):
        peer.command(0.5, 0.0)
        until(lambda: device.schedule.faults[0].active)
        lengths, foreign = [], 0
        for _ in range(20):
            peer.sync()
            while True:
                frame = peer.frame()
                assert frame is not None
                if frame.arbitration_id == STATE_ID:
                    break
                foreign += 1
            lengths.append(len(frame.data))
            time.sleep(0.005)
        assert sum(length != 8 for length in lengths) == 10
        assert foreign > 10


def test_can_bit_errors_hit_the_data_that_the_bus_lets_through(tmp_path) -> None:
    channel = "gantry-device-bits"
    data = _can({"kind": "bit_errors", "at_s": 0.0, "every": 1}, channel=channel)
    with (
        running(tmp_path, data) as device,
        CanPeer(can.Bus(interface="virtual", channel=channel)) as peer,
    ):
        still = peer.sample()
        peer.command(0.0, 0.0, watchdog_ms=0)
        until(lambda: device.schedule.faults[0].active)
        seen = [peer.sample() for _ in range(10)]
        assert sum(s["boot"] != still["boot"] or s["chain"] == 0 or s != still for s in seen) == 10
        assert _fired(device) == [10]


@pytest.mark.slow
def test_babbling_on_a_serial_line_hides_no_answer(tmp_path) -> None:
    data = _with(SERIAL, {"kind": "babbling", "at_s": 0.0, "rate_hz": 300})
    with running(tmp_path, data) as device, SerialPeer(device.endpoint.address) as peer:
        peer.hello()
        peer.command((0.1, 0.0))
        until(lambda: device.schedule.faults[0].fired > 5)
        answered = 0
        for _ in range(30):
            peer.send(4)
            try:
                answered += peer.state(0.02)["sample"] > 0
            except TimeoutError:
                continue
        assert answered > 3


def test_several_faults_at_once_each_fire(tmp_path) -> None:
    data = _with(
        TCP,
        {"kind": "delay", "at_s": 0.0, "amount_s": 0.001},
        {"kind": "duplicates", "at_s": 0.0, "every": 1},
        {"kind": "jitter", "at_s": 0.0, "amount_s": 0.001},
    )
    with running(tmp_path, data) as device, TcpPeer(device.endpoint.address) as peer:
        peer.exchange((0.1, 0.0))
        until(lambda: device.schedule.faults[0].active)
        sent = peer.send(exchange_pdu((0.1, 0.0), sequence=9))
        answers = [peer.receive() for _ in range(2)]
        assert [number for number, _ in answers] == [sent, sent]
        assert state_of(answers[1][1])["sequence"] == 9
        assert _fired(device) == [1, 1, 1]
