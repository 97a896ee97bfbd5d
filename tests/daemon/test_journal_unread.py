"""A terminal that is stopped, or a journal that does not read, holds up nobody who tells it."""

from __future__ import annotations

import contextlib
import fcntl
import logging
import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from daemon_rig import Daemon, bench_config

from motorctl.daemon import patient_stream
from motorctl.daemon.patient_stream import PatientHandler

pytestmark = pytest.mark.slow

F_SETPIPE_SZ, PIPE_BYTES = 1031, 4096


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    """A pipe of a page, for reading and for writing."""
    ends = os.pipe()
    fcntl.fcntl(ends[1], F_SETPIPE_SZ, PIPE_BYTES)
    yield ends
    for end in ends:
        os.close(end)


def tell(handler: PatientHandler, number: int) -> None:
    handler.handle(logging.makeLogRecord({"msg": f"message {number} {'.' * 80}"}))


def read_until(descriptor: int, last: bytes) -> list[bytes]:
    found = b""
    while last not in found:
        found += os.read(descriptor, 1 << 16)
    return found.splitlines()


def test_what_nobody_reads_is_dropped_and_counted(pipe: tuple[int, int]) -> None:
    handler = PatientHandler(pipe[1])
    most = patient_stream.MOST_LINES
    began_s = time.monotonic()
    for number in range(most + 500):
        tell(handler, number)
    assert time.monotonic() - began_s < 1.0
    lines = read_until(pipe[0], b"in time\n")
    told = [int(line.split()[1]) for line in lines[:-1]]
    assert told[:most] == list(range(most))
    assert told == sorted(set(told))  # later ones where the writing thread had a turn meanwhile
    missing = most + 500 - len(told)
    assert lines[-1].decode().startswith(f"motorctl: {missing} messages are missing here")
    tell(handler, 9999)
    assert b"message 9999" in read_until(pipe[0], b"\n")[0]
    handler.close()


def test_the_end_waits_for_a_reader_but_not_for_long(
    pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(patient_stream, "FLUSH_S", 0.2)
    handler = PatientHandler(pipe[1])
    for number in range(200):
        tell(handler, number)
    began_s = time.monotonic()
    handler.close()
    assert time.monotonic() - began_s < 2.0
    read_until(pipe[0], b"message 199")  # the thread ends


@pytest.mark.wall_clock(lanes=3)
def test_axes_stay_enabled_while_nobody_reads_standard_error(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "stderr.txt")
    unread = os.open(tmp_path / "stderr.txt", os.O_RDWR | os.O_NONBLOCK)
    fcntl.fcntl(unread, F_SETPIPE_SZ, PIPE_BYTES)
    try:
        with Daemon(tmp_path, bench_config()) as daemon:
            daemon.ask("start", axis="x")
            with contextlib.suppress(BlockingIOError):
                while True:
                    os.write(unread, b"." * 16)
            for _ in range(3):  # each is told: off, idle, off
                daemon.ask_when_it_stands("start", "y")
                time.sleep(0.3)
                daemon.ask("stop", axis="y")
                time.sleep(0.3)
            assert daemon.state("x") == "idle"
            daemon.process.terminate()
            os.set_blocking(unread, True)
            assert b"motorctl: axis y: idle" in b"\n".join(read_until(unread, b"ticks, "))
            assert daemon.process.wait(60) == 0
    finally:
        os.close(unread)
