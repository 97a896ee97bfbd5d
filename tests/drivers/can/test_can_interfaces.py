"""The CAN driver over slcan on a pty, over UDP multicast, and where an interface is missing."""

import contextlib
import errno
import random
import socket
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import can
import pytest
from can_bench import COMMAND, STATE, SYNC, bus, channels, message, options, state_bytes
from slcan_peer import SlcanPeer

from motorctl.hal import Inputs, Outputs, RunError, Status
from motorctl_can import CanDriver, bus_driver

pytestmark = pytest.mark.wall_clock(lanes=3)

STALE = int(Status.STALE)
WAIT_S = 0.2


def usual(k):
    return [(STATE, state_bytes(10 * k, -k, k))]


@contextmanager
def over_slcan(answer=usual, **given):
    with SlcanPeer(answer) as peer:
        given = {"sync": {"id": SYNC, "wait_s": WAIT_S}, **given}
        chosen = options(interface="slcan", channel=peer.port, **given)
        driver = CanDriver(chosen, channels(), 0.01)
        driver.open()
        try:
            yield driver, peer, Inputs(2)
        finally:
            driver.close()


def seen(driver, inputs):
    driver.read(inputs)
    return inputs.counts.tolist(), inputs.status.tolist()


@pytest.mark.parametrize("fd", [False, True])
def test_a_slcan_adapter_carries_samples_and_commands(fd):
    more = {"fd": True, "data_bitrate": 5000000} if fd else {}
    with over_slcan(**more) as (driver, peer, inputs):
        assert "S8" in peer.orders
        assert ("Y5" in peer.orders) == fd
        outputs = Outputs(2)
        outputs.volts[:], outputs.enable[:] = (1.0, -1.0), 1
        for _ in range(10):
            k = peer.samples + 1
            assert seen(driver, inputs) == ([10 * k, -k], [0, 0])
            driver.write(outputs)
        seen(driver, inputs)
        assert peer.fd == fd
        sent = [data for identifier, data in peer.frames if identifier == COMMAND]
        assert sent[-1][:5] == bytes.fromhex("D00730F803")


def test_noise_on_a_slcan_line_is_corrupt_and_never_a_position():
    noise = random.Random(3)
    with over_slcan() as (driver, peer, inputs):
        accepted = 0
        for _ in range(60):
            text = noise.choice(
                [
                    b"t18",
                    b"t1808FF\r",
                    b"tXYZ8\r",
                    b"\xff\xfe\r",
                    b"t1808" + b"ZZ" * 8 + b"\r",
                    b"t180F\r",
                    b"\r\r\a\r",
                    bytes(noise.randrange(256) for _ in range(20)).replace(b"\r", b"") + b"\r",
                ]
            )
            peer.say(text)
            before = inputs.counts.tolist()
            counts, status = seen(driver, inputs)
            if status[0] & STALE:
                assert counts == before
            else:
                assert counts == [10 * peer.samples, -peer.samples]
                accepted += 1
        assert accepted > 10
        for _ in range(3):
            seen(driver, inputs)
        assert seen(driver, inputs) == ([10 * peer.samples, -peer.samples], [0, 0])


def test_a_line_without_an_end_is_forgotten():
    with over_slcan() as (driver, peer, inputs):
        for _ in range(50):
            peer.say(b"t" * 1000)
            driver.read(inputs)
            if not inputs.status[0] & STALE:
                assert inputs.counts[0] == 10 * peer.samples
        assert len(driver._link._begun) < 2500
        peer.say(b"\r")
        for _ in range(2):
            driver.read(inputs)
        assert seen(driver, inputs) == ([10 * peer.samples, -peer.samples], [0, 0])


def test_an_unplugged_slcan_adapter_is_status_and_not_an_exception():
    with over_slcan() as (driver, peer, inputs):
        assert seen(driver, inputs)[1] == [0, 0]
        peer.unplug()
        gone = int(Status.BUS_OFF | Status.COMMUNICATION_LOST)
        for _ in range(3):
            start = time.monotonic()
            assert seen(driver, inputs)[1] == [gone | STALE] * 2
            driver.write(Outputs(2))
            assert time.monotonic() - start < WAIT_S
        driver.safe()


def test_a_serial_port_that_is_not_there_is_named():
    chosen = options(interface="slcan", channel="/dev/nothing-here")
    with pytest.raises(RunError, match=r"slcan channel '/dev/nothing-here' cannot be opened"):
        CanDriver(chosen, channels(), 0.01).open()


def open_files():
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


def test_a_slcan_port_that_is_silent_is_closed_again():
    before = open_files()
    with SlcanPeer(lambda _: []) as peer:
        chosen = options(
            interface="slcan",
            channel=peer.port,
            sync={"id": SYNC, "wait_s": 0.01},
            open_timeout_s=0.1,
        )
        with pytest.raises(RunError, match=r"no state frame 'positions'.*answering SYNC 0x80"):
            CanDriver(chosen, channels(), 0.01).open()
    assert open_files() == before


def test_a_missing_socketcan_interface_is_named_with_the_way_to_bring_it_up():
    chosen = options(interface="socketcan", channel="nocan7")
    with pytest.raises(RunError, match=r"socketcan channel 'nocan7'.*ip link set nocan7 up"):
        CanDriver(chosen, channels(), 0.01).open()


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        return probe.getsockname()[1]


@pytest.mark.parametrize("fd", [False, True])
def test_udp_multicast_carries_samples_and_commands(fd):
    pytest.importorskip("msgpack", reason="python-can needs msgpack for udp_multicast")
    group, port = "239.74.163.77", free_port()
    try:
        peer = can.Bus(
            interface="udp_multicast", channel=group, port=port, fd=fd, ignore_config=True
        )
        peer.send(message(b""), 0.1)
    except (can.CanError, OSError) as error:
        pytest.skip(f"this machine has no multicast: {error}")
    stop, commands, samples = threading.Event(), [], [0]

    def serve():
        while not stop.is_set():
            got = None
            with contextlib.suppress(can.CanError):
                got = peer.recv(0.02)
            if got is None or got.arbitration_id == STATE:
                continue
            if got.arbitration_id != SYNC:
                commands.append(bytes(got.data))
                continue
            samples[0] += 1
            k = samples[0]
            peer.send(message(state_bytes(10 * k, -k, k), is_fd=fd))

    chosen = options(
        interface="udp_multicast",
        channel=group,
        port=port,
        fd=fd,
        sync={"id": SYNC, "wait_s": WAIT_S},
    )
    driver, inputs, outputs = CanDriver(chosen, channels(), 0.01), Inputs(2), Outputs(2)
    outputs.volts[:], outputs.enable[:] = (1.0, -1.0), 1
    thread = threading.Thread(target=serve)
    thread.start()
    try:
        driver.open()
        for _ in range(20):
            assert seen(driver, inputs) == ([10 * samples[0], -samples[0]], [0, 0])
            driver.write(outputs)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.sendto(b"no frame at all", (group, port))
        counts, status = seen(driver, inputs)
        assert counts == [10 * samples[0], -samples[0]]
        assert status[0] & ~int(Status.CORRUPT) == 0
        seen(driver, inputs)
        assert bytes.fromhex("D00730F803") in {data[:5] for data in commands}
        another_program_is_refused_and_sends_nothing(CanDriver(chosen, channels(), 0.01), commands)
    finally:
        driver.close()
        stop.set()
        thread.join()
        peer.shutdown()


def another_program_is_refused_and_sends_nothing(other, commands):
    time.sleep(0.05)
    commands.clear()
    with pytest.raises(RunError, match=r"frame 0x.* is driven by another program"):
        other.open()
    other.safe()
    time.sleep(0.05)
    assert not commands


class StandIn(can.BusABC):
    """In the place of SocketCAN, which not every kernel has: what the driver asks of it."""

    def __init__(self, **asked):
        self.asked, self.waiting, self.trouble = asked, [], None
        super().__init__(asked["channel"])

    def _recv_internal(self, timeout):
        if not self.waiting:
            return None, True
        item = self.waiting.pop(0)
        if isinstance(item, Exception):
            raise can.CanOperationError("Failed to receive") from item
        return item, True

    def send(self, msg, timeout=None):
        if self.trouble:
            raise can.CanOperationError("Failed to transmit", self.trouble.errno) from self.trouble

    def fileno(self):
        raise NotImplementedError


@pytest.fixture
def stand_in(monkeypatch):
    made = []

    def make(**asked):
        made.append(StandIn(**asked))
        made[0].waiting.append(message(state_bytes(0, 0, 0)))
        return made[0]

    monkeypatch.setattr(can, "Bus", make)
    driver = CanDriver(options(interface="socketcan", channel="can3"), channels(), 1e-3)
    driver.open()
    yield driver, made[0], Inputs(2)
    driver.close()


GONE = int(Status.BUS_OFF | Status.COMMUNICATION_LOST)


def test_the_kernel_filters_for_just_the_state_frames(stand_in):
    _, bus, _ = stand_in
    assert bus.asked["can_filters"] == [{"can_id": STATE, "can_mask": 0x7FF, "extended": False}]
    assert (bus.asked["channel"], bus.asked["fd"]) == ("can3", False)


def error(kind):
    return can.Message(
        arbitration_id=kind, is_error_frame=True, is_extended_id=False, data=bytes(8)
    )


def test_bus_off_lasts_until_the_controller_restarts_or_frames_come(stand_in):
    driver, bus, inputs = stand_in
    bus.waiting += [message(state_bytes(1, 1, 1)), error(0x40)]
    assert seen(driver, inputs) == ([1, 1], [GONE] * 2)
    assert seen(driver, inputs)[1] == [GONE | STALE] * 2
    bus.waiting += [error(0x100)]
    assert seen(driver, inputs)[1] == [STALE] * 2
    bus.waiting += [error(0x40)]
    assert seen(driver, inputs)[1] == [GONE | STALE] * 2
    bus.waiting += [message(state_bytes(2, 2, 2))]
    assert seen(driver, inputs) == ([2, 2], [0, 0])


def test_other_error_frames_are_told_but_are_no_fault(stand_in):
    driver, bus, inputs = stand_in
    bus.waiting += [error(0x04), message(state_bytes(1, 1, 1))]
    assert seen(driver, inputs) == ([1, 1], [int(Status.CORRUPT)] * 2)


def test_an_interface_that_goes_down_is_bus_off_until_it_is_back(stand_in):
    driver, bus, inputs = stand_in
    bus.waiting += [OSError(errno.ENETDOWN, "Network is down")]
    assert seen(driver, inputs)[1] == [GONE | STALE] * 2
    bus.trouble = OSError(errno.ENETDOWN, "Network is down")
    driver.write(Outputs(2))
    bus.trouble = None
    assert seen(driver, inputs)[1] == [GONE | STALE] * 2
    driver.write(Outputs(2))
    bus.waiting += [message(state_bytes(3, 3, 3))]
    assert seen(driver, inputs) == ([3, 3], [0, 0])


def test_no_buffer_space_for_three_periods_is_communication_lost_and_not_bus_off(stand_in):
    driver, bus, inputs = stand_in
    bus.trouble = OSError(errno.ENOBUFS, "No buffer space available")
    for lost in (0, 0, int(Status.COMMUNICATION_LOST)):
        driver.write(Outputs(2))
        assert seen(driver, inputs)[1] == [lost | STALE | int(Status.CORRUPT)] * 2
    bus.trouble = None
    driver.write(Outputs(2))
    assert seen(driver, inputs)[1] == [STALE] * 2


def test_a_serial_port_belongs_to_one_program():
    with over_slcan() as (driver, peer, inputs):
        chosen = options(interface="slcan", channel=peer.port)
        with pytest.raises(RunError, match="in use by another program"):
            CanDriver(chosen, channels(), 0.01).open()
        assert peer.is_open
        assert seen(driver, inputs)[1] == [0, 0]


def test_safe_of_a_bus_that_is_not_open_opens_it_to_disable_every_amplifier():
    chosen = options()
    with bus(chosen.channel) as peer:
        CanDriver(chosen, channels(), 0.01).safe()
        heard = [peer.recv(1.0) for _ in range(3)]
        assert [m.arbitration_id for m in heard if m] == [COMMAND] * 3
        assert all(not any(m.data[:5]) for m in heard if m)


@pytest.mark.parametrize(("settle_s", "sent"), [(5.0, None), (0.02, True)])
def test_safe_of_an_adapter_that_is_not_open_lets_it_settle_for_a_bounded_time(
    monkeypatch, settle_s, sent
):
    monkeypatch.setattr(bus_driver, "SAFE_SETTLE_S", 0.1, raising=False)
    with SlcanPeer(usual) as peer:
        chosen = options(interface="slcan", channel=peer.port, settle_s=settle_s)
        driver = CanDriver(chosen, channels(), 0.01)
        driver.prepare()
        start = time.monotonic()
        driver.safe()
        assert time.monotonic() - start < 2.0
        while len(peer.frames) < 3 and time.monotonic() - start < 4.0:
            time.sleep(0.01)
        assert [identifier for identifier, _ in peer.frames] == [COMMAND] * 3
        assert driver.safe_sent is sent


def test_safe_tells_whether_the_bus_took_it():
    with over_slcan() as (driver, peer, _inputs):
        driver.safe()
        assert (driver.safe_sent, driver.safe_failed) == (True, "")
        other = CanDriver(options(interface="slcan", channel=peer.port), channels(), 0.01)
        other.safe()
        assert other.safe_sent is False
        assert "in use by another program" in other.safe_failed
        peer.unplug()
        driver.safe()
        assert driver.safe_sent is False
        assert driver.safe_failed.startswith(f"serial port {peer.port}: ")
    absent = CanDriver(options(interface="socketcan", channel="nocan7"), channels(), 0.01)
    absent.safe()
    assert absent.safe_sent is False
    assert "socketcan channel 'nocan7' cannot be opened" in absent.safe_failed
