"""The socket's folder and its lock: nobody else can put a daemon of their own in the place."""

from __future__ import annotations

import os
import pwd
import socket
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from motorctl.daemon.access import ControlSocket
from motorctl.daemon.client import Client
from motorctl.errors import UsageError

ROOT_ONLY = pytest.mark.skipif(os.geteuid() != 0, reason="needs root to become somebody else")
NOBODY = 65534

# Serves a socket as another user until its standard input ends.
SERVE_AS_NOBODY = f"""
import os, socket, sys
os.setgid({NOBODY})
os.setuid({NOBODY})
s = socket.socket(socket.AF_UNIX)
s.bind(sys.argv[1])
s.listen()
print("listens", flush=True)
sys.stdin.read()
"""


@ROOT_ONLY
def test_a_folder_that_somebody_else_made_first_is_not_taken(tmp_path: Path) -> None:
    folder = tmp_path / "motorctl-1000"
    folder.mkdir()
    os.chown(folder, NOBODY, NOBODY)
    name = pwd.getpwuid(NOBODY).pw_name
    with pytest.raises(UsageError, match=rf"the folder {folder} belongs to user {name}"):
        ControlSocket(folder / "s.sock")
    assert not list(folder.iterdir())


@ROOT_ONLY
def test_a_link_of_somebody_else_is_no_way_to_an_own_folder(tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    link = tmp_path / "motorctl-1000"
    link.symlink_to(tmp_path / "own")
    ControlSocket(link / "s.sock").close()
    os.lchown(link, NOBODY, NOBODY)
    with pytest.raises(UsageError, match=f"the folder {link} belongs to user"):
        ControlSocket(link / "s.sock")


def test_a_folder_that_everybody_may_write_to_is_taken_only_where_each_keeps_their_own(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "open"
    folder.mkdir()
    folder.chmod(0o777)
    with pytest.raises(UsageError, match=f"everybody may write .*: chmod o-w {folder}"):
        ControlSocket(folder / "s.sock")
    assert not list(folder.iterdir())
    folder.chmod(0o1777)  # as /tmp
    ControlSocket(folder / "s.sock").close()


def test_a_folder_that_is_made_is_the_daemons_to_write_to_and_the_groups_to_pass(
    tmp_path: Path,
) -> None:
    before = os.umask(0)
    try:
        control = ControlSocket(tmp_path / "new" / "s.sock")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o755
    control.close()


@pytest.mark.parametrize("made", [Path.symlink_to, Path.hardlink_to])
def test_a_lock_that_leads_to_another_file_leaves_it_alone(tmp_path: Path, made) -> None:
    notes = tmp_path / "notes.txt"
    notes.write_text("mine")
    made(tmp_path / "s.sock.lock", notes)
    with pytest.raises(UsageError, match=r"the lock .*s\.sock\.lock .*left alone; remove it"):
        ControlSocket(tmp_path / "s.sock")
    assert notes.read_text() == "mine"
    assert not (tmp_path / "s.sock").exists()


@pytest.fixture
def foreign_daemon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Let somebody else serve the socket that a command asks where none is named."""
    folder = tmp_path / "run"
    folder.mkdir()
    os.chown(folder, NOBODY, NOBODY)
    for place in (tmp_path, *tmp_path.parents):
        if place.stat().st_mode & stat.S_IXOTH:
            break
        place.chmod(0o711)
    path = folder / "motorctl.sock"
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(folder))
    command = [sys.executable, "-c", SERVE_AS_NOBODY, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as serving:
        assert serving.stdout is not None
        assert serving.stdout.readline() == b"listens\n"
        yield path
        serving.communicate()


@ROOT_ONLY
def test_a_command_obeys_no_daemon_of_another_user_unless_its_socket_is_named(
    foreign_daemon: Path,
) -> None:
    name = pwd.getpwuid(NOBODY).pw_name
    with pytest.raises(UsageError, match=f"the daemon on {foreign_daemon} is user {name}'s"):
        Client()
    Client(foreign_daemon).close()


def test_a_command_finds_the_own_daemon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path))
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as serving:
        serving.bind(str(tmp_path / "motorctl.sock"))
        serving.listen()
        Client().close()
