"""The service notification protocol."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from motorctl.daemon.notify import ServiceNotifier


@pytest.fixture
def manager(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(str(tmp_path / "notify"))
        receiver.settimeout(5)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        yield receiver


def test_each_event_reaches_the_service_manager(manager: socket.socket) -> None:
    notifier = ServiceNotifier()
    notifier.ready("axes x, y")
    notifier.alive()
    notifier.needs_time(2.5)
    notifier.stopping("stopping every axis")
    notifier.close()
    told = [manager.recv(4096).decode() for _ in range(4)]
    assert told == [
        "READY=1\nSTATUS=axes x, y",
        "WATCHDOG=1",
        "EXTEND_TIMEOUT_USEC=2500000",
        "STOPPING=1\nSTATUS=stopping every axis",
    ]


def test_abstract_addresses_are_understood(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind("")  # the kernel chooses an abstract address
        address = receiver.getsockname()
        receiver.settimeout(5)
        monkeypatch.setenv("NOTIFY_SOCKET", "@" + address[1:].decode())
        notifier = ServiceNotifier()
        notifier.status("x running")
        notifier.close()
        assert receiver.recv(4096) == b"STATUS=x running"


def test_a_deaf_service_manager_stops_nothing(
    manager: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NOTIFY_SOCKET", "/nonexistent/notify")
    gone = ServiceNotifier()
    gone.ready("nobody listens")
    gone.close()
    monkeypatch.delenv("NOTIFY_SOCKET")
    absent = ServiceNotifier()
    absent.ready("nobody asked")
    absent.close()
    manager.setblocking(False)
    with pytest.raises(BlockingIOError):
        manager.recv(4096)
