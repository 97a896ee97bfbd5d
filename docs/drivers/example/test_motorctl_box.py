"""The motion box's driver passes motorctl's conformance suite, against a box in a thread."""
# ruff: noqa: D102

import socket
import struct
import threading

import numpy as np
import pytest
from motorctl_box import BoxDriver

from motorctl.hal import Channel
from motorctl.hal.conformance import DriverConformance, Received, Rig


class Box(threading.Thread):
    """A box of two channels, written from the description of its datagrams alone."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self.socket = socket.socket(type=socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", port))
        self.socket.settimeout(0.05)
        self.port = self.socket.getsockname()[1]
        self.running, self.silent, self.boot, self.served = True, False, 7, 0
        self.counts, self.volts, self.enabled = [0, 0], [0.0, 0.0], [False, False]
        self.next_answers = []  # what becomes of them: None is lost, else a generator
        self.start()

    def run(self):
        while self.running:
            try:
                datagram, host = self.socket.recvfrom(64)
            except TimeoutError:
                continue
            number, *values = struct.unpack("<q2h2B", datagram)
            self.volts = [code * 10.0 / 32767 for code in values[:2]]
            self.enabled = [bool(bit) for bit in values[2:]]
            answer = struct.pack("<qI2i2B", number, self.boot, *self.counts, 0, 0)
            if self.next_answers:
                answer = damaged(answer, self.next_answers.pop())
            if answer is not None and not self.silent:
                self.socket.sendto(answer, host)
            self.served = number
        self.socket.close()

    def end(self):
        self.running = False
        self.join()


def damaged(answer, random):
    """Damage an answer as UDP's own checksum would not notice: too short, too long, too old."""
    if random is None:
        return None
    kinds = (answer[: random.integers(len(answer))], answer + b"x", bytes(8) + answer[8:])
    return kinds[random.integers(3)]


class BoxRig(Rig):
    """The driver on a box of this machine."""

    driver_class, type_name = BoxDriver, "box"
    channels = tuple(Channel(name, i, 0.5e-6, 32, 10.0) for i, name in enumerate("xy"))
    absent = "127.0.0.1"
    volts_tolerance_v = 0.5 * 10.0 / 32767 + 1e-9
    full_scale_v = 10.0
    exchanges = 3000

    def __init__(self):
        with socket.socket(type=socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.options = {"host": "127.0.0.1", "port": self.port}
        self.box = None

    def start(self):
        self.box = Box(self.port)

    def stop(self):
        if self.box:
            self.box.end()

    def pass_period(self, driver):
        """Wait until the box has served the last command, as long as it is there."""
        waited = threading.Event()
        for _ in range(20 if self.box.running else 0):
            if self.box.served == driver._out["number"][0]:
                break
            waited.wait(0.25e-3)

    def move_to(self, counts):
        self.box.counts = counts.tolist()

    def received(self):
        return Received(np.array(self.box.volts), np.array(self.box.enabled))

    def lose_next_reply(self):
        self.box.next_answers.append(None)

    def garble_next_reply(self, random):
        self.box.next_answers.append(random)

    def go_silent(self):
        self.box.silent = True

    def speak_again(self):
        self.box.silent = False

    def restart(self):
        self.box.boot += 1
        self.box.counts, self.box.volts, self.box.enabled = [0, 0], [0.0, 0.0], [False, False]

    def vanish(self):
        self.box.end()

    def come_back(self):
        self.start()


class TestBoxDriver(DriverConformance):
    """All of motorctl's checks."""

    @pytest.fixture
    def rig(self):
        """Yield a new rig for each check."""
        with BoxRig() as rig:
            yield rig
