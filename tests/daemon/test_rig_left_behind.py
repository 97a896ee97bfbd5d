"""What a killed run of tests has started ends with it."""

import signal
import subprocess
import sys
from pathlib import Path

import daemon_rig
from daemon_rig import alive, ended_with_the_tests, wait_until

TESTS = """
import subprocess, sys
from daemon_rig import {wrapper}
code = {wrapper}("print('up', flush=True); import time; time.sleep(1000)")
started = subprocess.Popen([sys.executable, "-c", code], start_new_session=True)
print(started.pid, flush=True)
started.wait()
"""
"""Stands for a run of tests with a daemon of theirs."""


def test_a_daemon_of_the_tests_ends_where_they_are_killed():
    support = Path(daemon_rig.__file__).parent
    tests = subprocess.Popen(
        [sys.executable, "-c", TESTS.format(wrapper=ended_with_the_tests.__name__)],
        stdout=subprocess.PIPE,
        text=True,
        env={"PYTHONPATH": str(support)},
    )
    assert tests.stdout is not None
    with tests:
        told = sorted(tests.stdout.readline() for _ in range(2))
        assert told[1] == "up\n"
        pid = int(told[0])
        assert alive(pid)
        tests.send_signal(signal.SIGKILL)
        tests.wait()
        wait_until(lambda: not alive(pid), 20.0)
