"""A daemon of a shipped machine opens no port on any network: its one door is a Unix socket."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest
from daemon_rig import Daemon

from motorctl.config.shipped import shipped_config

pytestmark = pytest.mark.slow

TABLES = ("tcp", "tcp6", "udp", "udp6", "raw", "raw6")


def processes_of_session(session: int) -> list[int]:
    """Return every process that one began, whatever has become of its parents."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            words = (folder / "stat").read_text().rpartition(")")[2].split()
        except OSError:  # it has ended
            continue
        if int(words[3]) == session:
            found.append(int(folder.name))
    return found


def network_sockets(pid: int) -> list[str]:
    """Return the process' sockets of TCP, UDP and raw IP, as the kernel's tables tell them."""
    inodes = set()
    for link in Path(f"/proc/{pid}/fd").iterdir():
        try:
            target = str(link.readlink())
        except OSError:
            continue
        if target.startswith("socket:["):
            inodes.add(target[len("socket:[") : -1])
    found = []
    for table in TABLES:
        path = Path(f"/proc/{pid}/net/{table}")
        for line in path.read_text().splitlines()[1:] if path.exists() else ():
            words = line.split()
            if words[9] in inodes:
                found.append(f"{table} {words[1]}")
    return found


@pytest.mark.parametrize("family", [socket.AF_INET, socket.AF_INET6])
@pytest.mark.parametrize("kind", [socket.SOCK_STREAM, socket.SOCK_DGRAM])
def test_a_port_that_is_open_is_found(family: int, kind: int) -> None:
    before = len(network_sockets(os.getpid()))
    try:
        door = socket.socket(family, kind)
        door.bind(("::1" if family == socket.AF_INET6 else "127.0.0.1", 0))
    except OSError:
        pytest.skip("no such address here")
    with door:
        if kind == socket.SOCK_STREAM:
            door.listen()
        assert len(network_sockets(os.getpid())) == before + 1


@pytest.mark.wall_clock(lanes=3)
@pytest.mark.bears_pauses
def test_a_running_daemon_of_a_shipped_gantry_has_no_port_open(tmp_path: Path) -> None:
    with Daemon(tmp_path, shipped_config("published_gantry").read_text()) as daemon:
        daemon.ask_when_it_stands("start", "x")
        pids = processes_of_session(daemon.process.pid)
        loop = daemon.ask("status")["loop"]["pid"]
        assert {daemon.process.pid, loop} <= set(pids)
        for pid in pids:
            assert network_sockets(pid) == []
        assert daemon.end() == 0, daemon.said
