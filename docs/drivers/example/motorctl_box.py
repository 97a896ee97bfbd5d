"""Driver for the motion box: one UDP datagram each way a period, answered at once."""

import contextlib
import select
import socket

import numpy as np
from pydantic import Field

from motorctl.hal import Driver, DriverOptions, Inputs, Outputs, RateBudget, RunError, Status

GONE = Status.COMMUNICATION_LOST | Status.BUS_OFF
RESTARTED = Status.DEVICE_RESTARTED | Status.ENCODER_LOST


class BoxDriver(Driver):
    """One motion box. UDP has a checksum of its own, so the datagrams need none."""

    class Options(DriverOptions):
        """Where the box is."""

        host: str
        port: int = Field(default=7710, ge=1, le=65535)

    exchange_delay_periods = 1.0  # what `read` brings was sampled at the last `write`

    def __init__(self, options, channels, period_s):
        super().__init__(options, channels, period_s)
        n, number = (len(channels),), ("number", "<i8")
        command = [number, ("volts", "<i2", n), ("enable", "u1", n)]
        answer = [number, ("boot", "<u4"), ("counts", "<i4", n), ("flags", "u1", n)]
        self._out, self._in, self._good = (np.zeros(1, f) for f in (command, answer, answer))
        self._socket, self._poll, self._trouble = None, select.poll(), Status(0)

    def rate_budget(self):
        """Add up an exchange: Ethernet, IP and UDP need 66 bytes for each datagram."""
        size = self._out.nbytes + self._in.nbytes + 2 * 66
        return RateBudget(1e6 / (size * 0.08 + 160), f"{size} bytes of 0.08 us + 160 us to answer")

    def problems(self):
        """Compare the axes with what a box has."""
        fits = [c.number == i and c.counter_bits == 32 for i, c in enumerate(self.channels)]
        return [] if all(fits) else [((), "a box has channels 0, 1, ..., with counters of 32 bits")]

    def open(self):
        """Disable every channel; the answer brings the counts and the number of the box's start."""
        self._trouble, self._good["boot"], first = Status(0), 0, Inputs(len(self.channels))
        try:
            self._socket = socket.socket(type=socket.SOCK_DGRAM)
            self._socket.connect((self.options.host, self.options.port))
            self._poll.register(self._socket, select.POLLIN)
            self.safe()
            self._poll.poll(1000)  # ms
            self.read(first)
            if first.status[0] & Status.STALE:
                raise TimeoutError("no answer within 1 s")
        except OSError as why:
            self.close()
            raise RunError(f"motion box at {self.options.host}:{self.options.port}: {why}") from why

    def close(self):
        """Let go of the socket."""
        if self._socket:
            self._socket.close()
        self._socket, self._poll = None, select.poll()

    def read(self, inputs):
        """Take the answer to the last command, no older one; time is bounded."""
        status, new, good, most = Status.STALE, self._in[0], self._good[0], 16
        try:
            while most and self._poll.poll(0):
                most -= 1
                size = self._socket.recv_into(self._in.view("u1"), 0, socket.MSG_TRUNC)
                if size != self._in.nbytes or new["number"] != self._out["number"]:
                    status |= Status.CORRUPT
                    continue
                self._trouble |= RESTARTED if good["boot"] not in (0, new["boot"]) else 0
                self._good[:], status = self._in, status & ~Status.STALE
        except OSError:  # the network tells that nobody listens there
            self._trouble |= GONE
        inputs.counts[:] = good["counts"]
        inputs.status[:] = good["flags"] & 0b11011 | np.uint32(status | self._trouble)

    def write(self, outputs):
        """Send volts, 32767 for 10 V, and enables; what is no number is disabled."""
        on = (outputs.enable != 0) & np.isfinite(outputs.volts)
        volts = np.clip(np.where(on, outputs.volts, 0) / 10, -1, 1) * 32767
        self._out[0] = self._out["number"][0] + 1, np.rint(volts), on
        try:
            if self._socket:
                self._socket.send(self._out, socket.MSG_DONTWAIT)
        except OSError as error:  # a queue that is full costs this command, and no more
            self._trouble |= 0 if isinstance(error, BlockingIOError) else GONE

    def safe(self):
        """Send zero and disable, also by a socket of its own: the other may be closed or broken."""
        self.write(Outputs(len(self.channels)))
        with contextlib.suppress(OSError), socket.socket(type=socket.SOCK_DGRAM) as line:
            line.sendto(self._out, (self.options.host, self.options.port))
