"""A wall clock that is set back while a frame is waited for: no read waits for it."""

import socket
import time
from contextlib import contextmanager, nullcontext

import can
import pytest
from can_bench import STATE, bus, message, options
from slcan_peer import SlcanPeer

from motorctl.hal import RunError
from motorctl_can.link import Link

pytestmark = pytest.mark.wall_clock(lanes=3)

BACK_S = 2.0
WAIT_S = 0.05
WANTED = [(STATE, False)]


@pytest.fixture
def clock_set_back(monkeypatch):
    """Let python-can read the time once before, and from then on after the clock was set back."""

    def read():
        reads.append(None)
        return time.monotonic() - (BACK_S if len(reads) > 1 else 0.0)

    reads = []
    monkeypatch.setattr(can.bus, "time", read)
    return reads.clear


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        return probe.getsockname()[1]


def took_s(link, timeout_s):
    start = time.monotonic()
    assert link.receive(timeout_s) is None
    return time.monotonic() - start


@contextmanager
def linked(interface):
    """Open a link on an interface on which nobody speaks."""
    given, peer = {}, nullcontext()
    if interface == "udp_multicast":
        pytest.importorskip("msgpack", reason="python-can needs msgpack for udp_multicast")
        given = {"channel": "239.74.163.78", "port": free_port()}
    if interface == "slcan":
        peer = SlcanPeer(lambda _: [])
        given = {"channel": peer.port}
    with peer:
        try:
            link = Link(options(interface=interface, **given), WANTED)
        except RunError as error:
            if interface != "udp_multicast":
                raise
            pytest.skip(f"this machine has no multicast: {error}")
        try:
            while took_s(link, WAIT_S) < WAIT_S:
                pass  # what an adapter answers to its opening
            yield link
        finally:
            link.close()


@pytest.mark.parametrize("timeout_s", [0.0, WAIT_S])
@pytest.mark.parametrize("interface", ["virtual", "udp_multicast", "slcan"])
def test_a_clock_that_is_set_back_holds_no_read_up(clock_set_back, interface, timeout_s):
    with linked(interface) as link:
        clock_set_back()
        assert timeout_s <= took_s(link, timeout_s) < timeout_s + BACK_S / 4


def test_a_clock_that_is_set_back_loses_no_frame(clock_set_back):
    chosen = options()
    link = Link(chosen, WANTED)
    try:
        with bus(chosen.channel) as peer:
            for k in range(3):
                peer.send(message(bytes([k])))
                clock_set_back()
                assert bytes(link.receive(WAIT_S).data) == bytes([k])
    finally:
        link.close()


class Unfiltered(can.BusABC):
    """A bus whose kernel took no filter: two foreign frames are before each that is wanted."""

    def __init__(self, **asked):
        self.frames = []
        super().__init__(asked["channel"], can_filters=asked["can_filters"])

    def _recv_internal(self, timeout):
        return (self.frames.pop(0), False) if self.frames else (None, False)

    def send(self, msg, timeout=None):
        raise NotImplementedError

    def fileno(self):
        raise NotImplementedError


def test_frames_that_are_not_wanted_do_not_end_a_wait(monkeypatch):
    monkeypatch.setattr(can, "Bus", Unfiltered)
    link = Link(options(interface="socketcan", channel="can3"), WANTED)
    link._bus.frames = [message(b"", 0x7), message(b"", 0x8), message(b"\1"), message(b"", 0x9)]
    assert bytes(link.receive(WAIT_S).data) == b"\1"
    assert took_s(link, WAIT_S) >= WAIT_S
    link.close()
