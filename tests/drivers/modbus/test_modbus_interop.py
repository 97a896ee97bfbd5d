"""The Modbus driver against servers of others: pymodbus' own, and libmodbus on TCP and RTU."""

import os
import shutil
import subprocess
import threading
import time
import tty
from pathlib import Path

import numpy as np
import pytest
from modbus_bench import PymodbusServer, make

from motorctl.hal import Inputs, Outputs, RunError

pytestmark = pytest.mark.wall_clock(lanes=3)

SOURCE = Path(__file__).parent / "modbus_server" / "gantry.c"


@pytest.fixture(scope="session")
def gantry_program(tmp_path_factory):
    if shutil.which("gcc") is None:
        pytest.skip("no gcc to compile the libmodbus server with")
    program = tmp_path_factory.mktemp("libmodbus") / "gantry"
    found = next((d for d in ("/usr/include", "/usr/local/include") if _header(d)), None)
    if found is None:
        pytest.skip("libmodbus is not installed: apt-get install libmodbus-dev")
    build = ["gcc", "-O1", "-Wall", "-Wextra", f"-I{found}/modbus", SOURCE, "-lmodbus", "-o"]
    subprocess.run([*build, program], check=True)
    return program


def _header(directory):
    return (Path(directory) / "modbus" / "modbus.h").exists()


class LibmodbusServer:
    def __init__(self, program, *words):
        self._process = subprocess.Popen([program, *words], stdout=subprocess.PIPE, text=True)
        ready, port = self._process.stdout.readline().split()
        assert ready == "ready"
        self.port = int(port)

    def close(self):
        self._process.kill()
        self._process.wait()
        self._process.stdout.close()


def drive_and_compare(driver, periods=40, timeout_s=1.0):
    """Run and keep a book of where the axes have to be; every new sample has to show it."""
    inputs, outputs = Inputs(2), Outputs(2)
    random = np.random.default_rng(1)
    expected = np.zeros(2, np.int64)
    driver.open()
    try:
        driver.read(inputs)
        start = inputs.counts.copy()
        assert not inputs.status.any()
        for _ in range(periods):
            outputs.volts[:] = random.uniform(-10, 10, 2)
            outputs.enable[:] = random.integers(0, 2, 2)
            driver.write(outputs)
            expected += np.round(outputs.volts * 3276.7).astype(np.int64) * outputs.enable
            deadline = time.monotonic() + timeout_s
            driver.read(inputs)
            while inputs.status.any() and time.monotonic() < deadline:
                time.sleep(1e-4)
                driver.read(inputs)
            assert not inputs.status.any()
            assert np.array_equal(inputs.counts - start, expected)
        driver.safe()
        assert driver.safe_sent is True
        driver.read(inputs)
        assert not inputs.status.any(), "the answer to `safe` is a sample like any other"
        assert np.array_equal(inputs.counts - start, expected)
    finally:
        driver.close()


@pytest.fixture
def pymodbus_server():
    server = PymodbusServer()
    yield server
    server.close()


def test_pymodbus_server_and_driver_agree_on_every_count(pymodbus_server):
    drive_and_compare(make(tcp={"host": "127.0.0.1", "port": pymodbus_server.port}))


def test_a_second_open_after_close_works_as_the_first(pymodbus_server):
    driver = make(tcp={"host": "127.0.0.1", "port": pymodbus_server.port})
    for _ in range(3):
        drive_and_compare(driver, periods=5)


def test_safe_without_a_connection_makes_one_and_writes_zeros(pymodbus_server):
    driver = make(tcp={"host": "localhost", "port": pymodbus_server.port})
    driver.safe()
    assert pymodbus_server.requests == [(16, [0, 0, 0, 0])]
    driver.open()
    driver.close()
    driver.safe()
    assert pymodbus_server.requests[-1] == (16, [0, 0, 0, 0])
    assert driver.safe_sent is True


def test_safe_tries_function_code_23_where_16_does_nothing(pymodbus_server):
    pymodbus_server.refused = 16
    driver = make(tcp={"host": "localhost", "port": pymodbus_server.port})
    driver.safe()
    assert pymodbus_server.requests == [(23, [0, 0, 0, 0])]
    assert driver.safe_sent is True


def test_pymodbus_refusing_an_address_is_told_with_the_range(pymodbus_server):
    driver = make(tcp={"host": "127.0.0.1", "port": pymodbus_server.port}, output_base=0x1FE)
    with pytest.raises(RunError, match=r"0x0000 to 0x0004.*0x01fe to 0x0201"):
        driver.open()
    driver.safe()
    assert driver.safe_sent is False
    assert "exception 2 (illegal data address)" in driver.safe_failed


def test_libmodbus_on_tcp_and_driver_agree_on_every_count(gantry_program):
    server = LibmodbusServer(gantry_program, "tcp")
    try:
        driver = make(tcp={"host": "127.0.0.1", "port": server.port})
        drive_and_compare(driver)
        drive_and_compare(driver)
    finally:
        server.close()


NO_PARITY = {"baud": 115200, "parity": "none", "stop_bits": 2}  # pseudo terminals have none


class Crossed:
    """Two pseudo terminals, wired across: both ends can be opened by their names."""

    def __init__(self):
        self.ends = [os.openpty() for _ in range(2)]
        self.names = [os.ttyname(other) for _, other in self.ends]
        for end, other in self.ends:
            for descriptor in (end, other):
                os.set_blocking(descriptor, True)
                tty.setraw(descriptor)
        self._threads = [
            threading.Thread(target=self._carry, args=(a, b), daemon=True)
            for a, b in ((0, 1), (1, 0))
        ]
        for thread in self._threads:
            thread.start()

    def _carry(self, a, b):
        while True:
            data = os.read(self.ends[a][0], 512)
            if data == b"\0end":
                return
            os.write(self.ends[b][0], data)

    def close(self):
        for _, other in self.ends:
            os.write(other, b"\0end")
        for thread in self._threads:
            thread.join(5)
        for pair in self.ends:
            for descriptor in pair:
                os.close(descriptor)


def test_libmodbus_on_rtu_and_driver_agree_on_every_count(gantry_program):
    line = Crossed()
    try:
        server = LibmodbusServer(gantry_program, "rtu", line.names[1], "115200")
        try:
            drive_and_compare(make(0.2, rtu={**NO_PARITY, "port": line.names[0]}), periods=25)
        finally:
            server.close()
    finally:
        line.close()
