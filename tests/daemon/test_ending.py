"""The end of a run on a disk that hangs: it is given up, and what was recorded is kept."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import socket
import threading
import time
from contextlib import suppress
from pathlib import Path

import daemon_rig
import pytest
from daemon_rig import Daemon, bench_config, command, wait_until

from motorctl.daemon import ending
from motorctl.daemon.ending import Ending
from motorctl.daemon.notify import ServiceNotifier
from motorctl.errors import RunError
from motorctl.log import recover

pytestmark = [pytest.mark.wall_clock(lanes=3), pytest.mark.bears_pauses, pytest.mark.slow]

HANGS = (
    "import threading; from motorctl.daemon import ending, rotating_log;"
    "ending.ENDING_LIMIT_S, ending.MORE_TIME_S = 1.0, 0.4;"
    "rotating_log.RotatingLog.close = lambda *_: threading.Event().wait();"
)

SLOW_TO_SAVE = (
    "import os, sys, time, types; from motorctl.daemon import ending, learned;"
    "ending.MORE_TIME_S = 0.4;"
    "say = lambda words: print(words, file=sys.stderr, flush=True);"
    "wait = lambda fd: (say('saving begins'), time.sleep(4.0), say('saving ends'), os.fsync(fd));"
    "learned.os = types.SimpleNamespace(getpid=os.getpid, fsync=wait);"
)
"""Patches the disk under what was learned: it takes four seconds."""
LIMITED = "ending.ENDING_LIMIT_S = 1.0;"


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


SLOW_TO_CLOSE = (
    "import time; from motorctl.daemon import rotating_log; close = rotating_log.RotatingLog.close;"
    "rotating_log.RotatingLog.close = lambda *given: (time.sleep(6.0), close(*given))[1];"
)


def test_a_loop_that_died_is_told_at_once_and_its_axes_are_not_shown_as_running(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def slow(*arguments: str) -> list[str]:
        python, option, code, *rest = command(*arguments)
        return [python, option, SLOW_TO_CLOSE + code, *rest]

    monkeypatch.setattr(daemon_rig, "command", slow)
    with Daemon(tmp_path, bench_config("shuttle")) as daemon:
        daemon.ask("start", axis="x")
        os.kill(daemon.ask("status")["loop"]["pid"], signal.SIGKILL)
        cause = "the loop process ended (killed by SIGKILL)"
        wait_until(lambda: f"motorctl: ending: {cause}" in daemon.said)
        wait_until(lambda: daemon.ask("status")["loop"]["phase"] == "failed", 5.0)
        status = daemon.ask("status")
        assert status["daemon"]["stopping"]
        x, y = status["axes"]["x"], status["axes"]["y"]
        assert (x["state"], x["motion"], x["command_v"]) == ("fault", None, None)
        assert x["fault"]["cause"] == "loop_ended"
        assert x["fault"]["message"].startswith(cause)
        assert y["state"] == "off"
        shown = daemon.cli("status").stdout
        assert "ending, its loop is gone" in shown
        assert "running" not in shown
        assert daemon.process.poll() is None  # all of this while the log is closed
        assert daemon.process.wait(60) == 1
        assert daemon.said.splitlines()[-1] == f"motorctl: {cause}"


@pytest.mark.slow
def test_a_disk_that_is_slow_to_save_what_was_learned_holds_up_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def slow(*arguments: str) -> list[str]:
        python, option, code, *rest = command(*arguments)
        return [python, option, SLOW_TO_SAVE + code, *rest]

    monkeypatch.setattr(daemon_rig, "command", slow)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        config = bench_config(keep_learned=True)
        with Daemon(tmp_path, config, NOTIFY_SOCKET=str(tmp_path / "notify")) as daemon:
            daemon.process.send_signal(signal.SIGTERM)
            wait_until(lambda: "saving begins" in daemon.said)
            # Meanwhile clients are answered, though not longer than the disk takes.
            assert set(daemon.ask("status")["axes"]) == {"x", "y"}
            assert "saving ends" not in daemon.said
            drained(manager)
            wait_until(lambda: "saving ends" in daemon.said)
            asked = [told for told in drained(manager) if "EXTEND_TIMEOUT_USEC" in told]
            assert len(asked) > 5, "systemd was not told that it goes on"
            assert daemon.process.wait(60) == 0, daemon.said
    saved = json.loads((tmp_path / "state" / "motorctl" / "bench.json").read_text())
    assert set(saved["axes"]) == {"x", "y"}


def drained(manager: socket.socket) -> list[str]:
    """Take what systemd was told so far."""
    told = []
    with suppress(BlockingIOError):
        while True:
            told.append(manager.recv(4096, socket.MSG_DONTWAIT).decode())
    return told


@pytest.mark.slow
def test_a_disk_that_never_saves_what_was_learned_keeps_the_old_file_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hangs = SLOW_TO_SAVE.replace("time.sleep(4.0)", "time.sleep(600.0)")

    def hanging(*arguments: str) -> list[str]:
        python, option, code, *rest = command(*arguments)
        return [python, option, hangs + LIMITED + code, *rest]

    with Daemon(tmp_path, bench_config(keep_learned=True)) as daemon:
        assert daemon.end() == 0, daemon.said
        kept = tmp_path / "state" / "motorctl" / "bench.json"
        before = kept.read_bytes()
        monkeypatch.setattr(daemon_rig, "command", hanging)
        daemon.process = daemon.launch()
        daemon.wait_until_running()
        assert daemon.end() == 1
        assert "the learned parameters were not saved: saving the learned" in daemon.said
        assert kept.read_bytes() == before


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
