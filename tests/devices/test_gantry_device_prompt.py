"""`motorctl gantry-device --raise-workers`: pseudo-terminals that are as prompt as a wire."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from gantry_device_bench import device_data, write_device

from motorctl_devices.prompt_ptys import can_be_prompt, prompt_ptys

pytestmark = [pytest.mark.wall_clock, pytest.mark.slow]

PR_CAPBSET_DROP, CAP_SYS_NICE = 24, 23
COMMAND = [sys.executable, "-c", "from motorctl.cli import main; main()", "gantry-device"]
capable = pytest.mark.skipif(not can_be_prompt(), reason="kernel threads cannot be raised here")


def workers() -> dict[int, int]:
    """Return the scheduling policy of each kernel thread that may carry a pseudo-terminal."""
    found = {}
    for comm in Path("/proc").glob("[0-9]*/comm"):
        try:
            if comm.read_text().startswith("kworker/u"):
                pid = int(comm.parent.name)
                found[pid] = os.sched_getscheduler(pid)
        except (FileNotFoundError, ProcessLookupError):
            continue  # it ended meanwhile
    return found


@pytest.mark.slow
@capable
@pytest.mark.parametrize("ending", [signal.SIGTERM, signal.SIGKILL])
def test_the_kernels_workers_are_raised_while_the_device_runs_and_put_back(tmp_path, ending):
    path = write_device(tmp_path, device_data({"serial": {}}, watchdog_s=0.1))
    with subprocess.Popen(
        [*COMMAND, str(path), "--raise-workers"], stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline().startswith("ready: ")
            raised = [pid for pid, policy in workers().items() if policy == os.SCHED_FIFO]
            assert raised
        finally:
            process.send_signal(ending)
    deadline_s = time.monotonic() + 5.0
    while os.SCHED_FIFO in (left := {p: v for p, v in workers().items() if p in raised}).values():
        assert time.monotonic() < deadline_s, left
        time.sleep(0.05)


@pytest.mark.slow
@capable
def test_without_the_right_to_raise_them_the_device_says_so_and_does_not_start(tmp_path):
    path = write_device(tmp_path, device_data({"serial": {}}, watchdog_s=0.1))
    libc = ctypes.CDLL(None)
    ended = subprocess.run(  # noqa: PLW1510
        [*COMMAND, str(path), "--raise-workers"],
        capture_output=True,
        text=True,
        preexec_fn=lambda: libc.prctl(PR_CAPBSET_DROP, CAP_SYS_NICE, 0, 0, 0),
    )
    assert ended.returncode == 1
    assert "root and CAP_SYS_NICE" in " ".join(ended.stderr.split())
    assert "Traceback" not in ended.stderr
    assert ended.stdout == ""


@capable
def test_a_second_device_finds_them_raised_and_the_first_one_leaves_them_so():
    with prompt_ptys():
        with prompt_ptys():
            assert os.SCHED_FIFO in workers().values()
        time.sleep(0.5)
        assert os.SCHED_FIFO in workers().values()
