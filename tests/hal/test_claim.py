"""Two programs never drive one output, and whoever is refused learns by whom."""

from __future__ import annotations

import os
import pwd
import socket
import subprocess
import sys

import pytest

from motorctl.errors import RunError
from motorctl.hal import Claim

OTHER = (
    "import os, sys; from motorctl.hal import Claim; os.setuid(int(sys.argv[2]));"
    "held = Claim(sys.argv[1], ['output 1']);"
    "print('held', flush=True); sys.stdin.read()"
)


@pytest.fixture
def device() -> str:
    """Name a device that no other run of this test claims."""
    return f"a device of process {os.getpid()}"


def other_program(device: str, uid: int) -> subprocess.Popen[str]:
    """Start a program that claims the device's output, and wait until it has it."""
    other = subprocess.Popen(
        [sys.executable, "-c", OTHER, device, str(uid)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert other.stdout is not None
    assert other.stdout.readline() == "held\n"
    return other


def ended(other: subprocess.Popen[str]) -> None:
    other.kill()
    other.communicate()


def test_who_is_refused_learns_which_program_of_which_user_has_it(device: str) -> None:
    other = other_program(device, os.getuid())
    try:
        with pytest.raises(RunError, match=rf": process {other.pid} \(.+\) of user {os.getuid()}"):
            Claim(device, ["output 0", "output 1"])
        Claim(device, ["output 0"]).release()  # what a refused claim had begun with is free
    finally:
        ended(other)


@pytest.mark.skipif(os.getuid() != 0, reason="only root may start a program of another user")
def test_programs_of_two_users_exclude_each_other_and_are_named(device: str) -> None:
    nobody = pwd.getpwnam("nobody").pw_uid
    other = other_program(device, nobody)
    try:
        with pytest.raises(RunError, match=rf"of user {nobody} \(nobody\)"):
            Claim(device, ["output 1"])
    finally:
        ended(other)


def test_the_kernel_releases_what_a_program_held_that_was_killed(device: str) -> None:
    ended(other_program(device, os.getuid()))
    Claim(device, ["output 1"]).release()


def test_a_holder_that_shows_nothing_of_itself_is_told_how_to_find(device: str) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as squatter:
        squatter.bind(f"\0motorctl {device} output 1")
        with pytest.raises(RunError, match="does not show which; as root, `ss -xap"):
            Claim(device, ["output 1"])


def test_a_claim_names_itself_to_hundreds_that_it_refuses(device: str) -> None:
    held = Claim(device, ["output 1"])
    try:
        for _ in range(300):
            with pytest.raises(RunError, match=f"process {os.getpid()} "):
                Claim(device, ["output 1"])
    finally:
        held.release()
