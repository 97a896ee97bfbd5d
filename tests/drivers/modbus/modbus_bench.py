"""Devices on the other side of the Modbus driver, written from the specification alone.

They share no line with the driver: frames are put together byte by byte, the checksum bit by bit.
"""

import asyncio
import contextlib
import copy
import os
import select
import socket
import threading
import time
import tty
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import real_time
from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from motorctl.hal import Channel, Inputs, Outputs
from motorctl_modbus import ModbusDriver, ModbusOptions

PERIOD_S = 0.02
VOLTS_PER_COUNT = 10 / 32767
CHANNELS = {
    0: {
        "volts": {"address": 0, "volts_per_count": VOLTS_PER_COUNT},
        "enable": {"address": 2, "bit": 0},
        "counts": {"address": 0, "bits": 32},
    },
    1: {
        "volts": {"address": 1, "volts_per_count": VOLTS_PER_COUNT},
        "enable": {"address": 2, "bit": 1},
        "counts": {"address": 2, "bits": 32},
    },
}
READ, WRITTEN = 5, 4
"""Registers a request reads and writes with the map of `options`: counts of two axes and the echo
of the sequence number; two volts, the enables and the sequence number."""


def options(**changes):
    told = {
        "output_base": 0x100,
        "channels": copy.deepcopy(CHANNELS),
        "sequence": {"output": 3, "input": 4},
        **changes,
    }
    if "tcp" not in told and "rtu" not in told:
        told["tcp"] = {"host": "127.0.0.1", "port": 1}
    return ModbusOptions.model_validate({k: v for k, v in told.items() if v is not None})


def channels(n=2, counter_bits=32, max_voltage_v=10.0):
    return [Channel("xyzuvw"[i], i, 0.5e-6, counter_bits, max_voltage_v) for i in range(n)]


def make(period_s=PERIOD_S, n=2, **changes):
    return ModbusDriver(options(**changes), channels(n), period_s)


def registers_of(counts, sequence):
    """The registers of a reply: two 32 bit counts, high word first, and the echo."""
    words = []
    for count in counts:
        words += [(count >> 16) & 0xFFFF, count & 0xFFFF]
    return [*words, sequence]


def packed(registers):
    return b"".join(register.to_bytes(2, "big") for register in registers)


def crc(data):
    rest = 0xFFFF
    for byte in data:
        rest ^= byte
        for _ in range(8):
            rest = (rest >> 1) ^ 0xA001 if rest & 1 else rest >> 1
    return rest.to_bytes(2, "little")


def tcp_frame(transaction, pdu, unit=1, protocol=0):
    length = len(pdu) + 1
    parts = (transaction % 0x10000, protocol, length)
    header = b"".join(part.to_bytes(2, "big") for part in parts)
    return header + bytes([unit]) + pdu


def rtu_frame(pdu, unit=1):
    body = bytes([unit]) + pdu
    return body + crc(body)


def reply_pdu(registers, function=23):
    return bytes([function, 2 * len(registers)]) + packed(registers)


@dataclass
class Request:
    """A request of function code 23, 16, 6 or 3, taken apart."""

    unit: int
    function: int
    transaction: int = 0
    read: tuple = (0, 0)
    written: tuple = (0, 0)
    registers: list = field(default_factory=list)

    @property
    def sequence(self):
        return self.registers[3]


def taken_apart(unit, pdu, transaction=0):
    words = [
        int.from_bytes(pdu[i : i + 2], "big") for i in range(1, 1 + (len(pdu) - 1) // 2 * 2, 2)
    ]
    if pdu[0] == 23:
        read, written, size, data = tuple(words[:2]), tuple(words[2:4]), pdu[9], pdu[10:]
    elif pdu[0] == 16:
        read, written, size, data = (0, 0), tuple(words[:2]), pdu[5], pdu[6:]
    elif pdu[0] == 6:
        return Request(unit, 6, transaction, written=(words[0], 1), registers=[words[1]])
    else:
        return Request(unit, pdu[0], transaction, read=tuple(words[:2]))
    assert size == len(data) == 2 * written[1]
    registers = [int.from_bytes(data[i : i + 2], "big") for i in range(0, size, 2)]
    return Request(unit, pdu[0], transaction, read, written, registers)


class TcpPeer:
    """A device on TCP that does what the test tells it, step by step."""

    def __init__(self, port=0):
        self.listener = socket.create_server(("127.0.0.1", port))
        self.port = self.listener.getsockname()[1]
        self.connection = None

    def accept(self):
        if self.connection is not None:
            self.connection.close()
        self.listener.settimeout(5)
        self.connection, _ = self.listener.accept()
        self.connection.settimeout(5)
        self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def request(self):
        header = self._exactly(7)
        assert header[2:4] == b"\0\0"
        pdu = self._exactly(int.from_bytes(header[4:6], "big") - 1)
        return taken_apart(header[6], pdu, int.from_bytes(header[:2], "big"))

    def _exactly(self, size):
        data = b""
        while len(data) < size:
            more = self.connection.recv(size - len(data))
            if not more:
                raise EOFError
            data += more
        return data

    def idle(self, time_s=0.0):
        """Whether nothing more was asked."""
        return not select.select([self.connection], [], [], time_s)[0]

    def send(self, data):
        self.connection.sendall(data)

    def frame(self, request, pdu, unit=None):
        return tcp_frame(request.transaction, pdu, request.unit if unit is None else unit)

    def answer(self, request, counts=(0, 0)):
        self.send(self.frame(request, reply_pdu(registers_of(counts, request.sequence))))

    def drop(self):
        if self.connection is not None:
            self.connection.close()
        self.connection = None

    def close(self):
        self.drop()
        self.listener.close()


class RtuPeer:
    """The same on a pseudo terminal."""

    def __init__(self):
        self.end, self.other = os.openpty()
        tty.setraw(self.end)
        tty.setraw(self.other)
        self.port = os.ttyname(self.other)

    def accept(self):
        """A line is always there."""

    def request(self):
        head = self._exactly(2)
        rest = self._exactly({23: 9, 16: 5}.get(head[1], 4))
        data = self._exactly(rest[-1]) if head[1] in (23, 16) else b""
        frame = head + rest + data
        assert self._exactly(2) == crc(frame)
        return taken_apart(frame[0], frame[1:])

    def _exactly(self, size):
        data = b""
        while len(data) < size:
            assert select.select([self.end], [], [], 5)[0], "the driver asked nothing"
            data += os.read(self.end, size - len(data))
        return data

    def idle(self, time_s=0.005):
        return not select.select([self.end], [], [], time_s)[0]

    def send(self, data):
        os.write(self.end, data)
        time.sleep(0.003)  # a pseudo terminal hands bytes on by a work queue

    def frame(self, request, pdu, unit=None):
        return rtu_frame(pdu, request.unit if unit is None else unit)

    def answer(self, request, counts=(0, 0)):
        self.send(self.frame(request, reply_pdu(registers_of(counts, request.sequence))))

    def close(self):
        for descriptor in (self.end, self.other):
            with contextlib.suppress(OSError):
                os.close(descriptor)


class Bench:
    """A driver, its peer, and arrays to read into and write from."""

    def __init__(self, peer, driver):
        self.peer, self.driver = peer, driver
        axes = len(driver.channels)
        self.inputs, self.outputs = Inputs(axes), Outputs(axes)

    def open(self, serve=None):
        """Open the driver while the peer answers, by default one exchange with counts 0."""
        with ThreadPoolExecutor(1) as pool:
            opening = pool.submit(self.driver.open)
            self.peer.accept()
            (serve or self.serve_once)()
            opening.result()
        return self

    def serve_once(self):
        self.peer.answer(self.peer.request())

    def read(self):
        self.driver.read(self.inputs)
        return list(self.inputs.counts), self.inputs.status.tolist()

    def ask(self, volts=(0.0, 0.0), enable=(0, 0)):
        """Write, and give the request that the peer got."""
        self.outputs.volts[:], self.outputs.enable[:] = volts, enable
        self.driver.write(self.outputs)
        return self.peer.request()

    def close(self):
        self.driver.close()
        self.peer.close()


def tcp_bench(**changes):
    peer = TcpPeer()
    return Bench(peer, make(tcp={"host": "127.0.0.1", "port": peer.port}, **changes))


def rtu_bench(period_s=PERIOD_S, **changes):
    peer = RtuPeer()
    line = {
        "port": peer.port,
        "baud": 115200,
        "parity": "none",
        "stop_bits": 2,
        **changes.pop("line", {}),
    }
    return Bench(peer, make(period_s, rtu=line, **changes))


class PymodbusServer:
    """pymodbus' own TCP server in a thread: a gantry whose counts move by the volts it is sent.

    Outputs and inputs as in `options`, on one set of registers.
    """

    def __init__(self, registers=0x200, unit=1):
        self.requests = []
        self.refused = None
        self.counts = [0, 0]
        self._device = SimDevice(
            unit,
            [SimData(0, count=registers, values=0, datatype=DataType.REGISTERS)],
            action=self._act,
        )
        self._ready = threading.Event()
        real_time.begins()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()), daemon=True)
        self._thread.start()
        assert self._ready.wait(5)

    async def _run(self):
        self._loop = asyncio.get_running_loop()
        self._server = ModbusTcpServer(self._device, address=("127.0.0.1", 0))
        await self._server.serve_forever(background=True)
        self.port = self._server.transport.sockets[0].getsockname()[1]
        self._ready.set()
        await self._server.serving
        await asyncio.sleep(0.05)

    async def _act(self, function, start, address, count, current, values):
        if function == self.refused:
            return ExcCodes.ILLEGAL_FUNCTION
        if values is not None and address == 0x100:
            self.requests.append((function, list(values)))
            for i in (0, 1):
                if values[2] >> i & 1:
                    word = values[i]
                    self.counts[i] += word - 0x10000 if word & 0x8000 else word
            current[0:5] = registers_of(self.counts, values[3])
        return None

    def close(self):
        asyncio.run_coroutine_threadsafe(self._server.shutdown(), self._loop).result(5)
        self._thread.join(5)
