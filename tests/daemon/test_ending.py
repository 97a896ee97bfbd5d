"""The end of a run on a disk that hangs: it is given up, and what was recorded is kept."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from pathlib import Path

import daemon_rig
import pytest
from daemon_rig import Daemon, command

from motorctl.daemon import ending
from motorctl.daemon.ending import Ending
from motorctl.daemon.notify import ServiceNotifier
from motorctl.errors import RunError
from motorctl.log import recover

pytestmark = pytest.mark.wall_clock(lanes=2)

HANGS = (
    "import threading; from motorctl.daemon import ending, rotating_log;"
    "ending.ENDING_LIMIT_S, ending.MORE_TIME_S = 1.0, 0.4;"
    "rotating_log.RotatingLog.close = lambda *_: threading.Event().wait();"
)


def test_a_daemon_whose_disk_hangs_ends_all_the_same_and_its_log_can_be_recovered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def hanging(*arguments: str) -> list[str]:
        python, option, code, *rest = command(*arguments)
        return [python, option, HANGS + code, *rest]

    monkeypatch.setattr(daemon_rig, "command", hanging)
    with Daemon(tmp_path) as daemon:
        assert daemon.end() == 1
        assert (
            "closing the log: given up, as the end of the run took longer than 1 s" in daemon.said
        )
        (partial,) = daemon.partial_logs()
    assert recover(partial).rows > 0


def test_systemd_is_asked_for_time_as_long_as_a_work_is_not_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ending, "ENDING_LIMIT_S", 0.5)
    monkeypatch.setattr(ending, "MORE_TIME_S", 0.2)
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
    released = threading.Event()
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))

        async def end(notifier: ServiceNotifier) -> None:
            last = Ending(notifier)
            with pytest.raises(RunError, match="a disk: given up"):
                await last.wait_for("a disk", released.wait)
            notifier.status("given up")
            with pytest.raises(RunError, match="another: given up"):
                await last.wait_for("another", released.wait)
            assert await last.wait_for("what is done at once", lambda: 7) == 7

        notifier = ServiceNotifier()
        asyncio.run(end(notifier))
        notifier.status("over")
        notifier.close()
        told = []
        while not told or told[-1] != "STATUS=over":
            told.append(manager.recv(4096).decode())
    assert told[-2:] == ["STATUS=given up", "STATUS=over"]
    assert set(told[:-2]) == {"EXTEND_TIMEOUT_USEC=200000"}
    released.set()


def test_a_work_that_takes_its_time_is_waited_for_and_its_failure_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ending, "MORE_TIME_S", 0.04)
    last = Ending(ServiceNotifier())

    def fail() -> None:
        time.sleep(0.1)
        raise OSError("the disk is full")

    with pytest.raises(OSError, match="the disk is full"):
        asyncio.run(last.wait_for("a log", fail))
