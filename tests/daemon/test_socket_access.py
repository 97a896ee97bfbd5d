"""The socket's file: its permissions, its peers, and one daemon a socket."""

from __future__ import annotations

import asyncio
import grp
import json
import os
import socket
import stat
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from served_socket import served

from motorctl.daemon import paths
from motorctl.daemon.access import ControlSocket, Peer, Role, peer_of
from motorctl.daemon.client import Client
from motorctl.daemon.paths import client_socket, daemon_socket, state_file
from motorctl.daemon.server import ControlServer
from motorctl.errors import RunError, UsageError

pytestmark = [pytest.mark.wall_clock(lanes=3), pytest.mark.bears_pauses]

ROOT_ONLY = pytest.mark.skipif(os.geteuid() != 0, reason="needs root to become somebody else")
NOBODY = 65534

# Connects as another user and prints what comes back.
ASK_AS_NOBODY = f"""
import os, socket, sys
own, *groups = map(int, sys.argv[3:])
os.setgroups(groups)
os.setgid(own)
os.setuid({NOBODY})
s = socket.socket(socket.AF_UNIX)
s.settimeout(20)
try:
    s.connect(sys.argv[1])
except PermissionError:
    sys.exit("PermissionError")
try:
    s.sendall(sys.argv[2].encode() + bytes([10]))
except OSError:
    pass  # the refusal is there already
sys.exit(s.recv(200).decode())
"""


def test_only_owner_and_group_may_open_the_socket(tmp_path: Path) -> None:
    control = ControlSocket(tmp_path / "s.sock")
    found = control.path.stat()
    assert stat.S_IMODE(found.st_mode) == 0o660
    assert found.st_gid == os.getegid()
    control.close()
    assert not control.path.exists()


@ROOT_ONLY
def test_the_socket_belongs_to_the_chosen_group(tmp_path: Path) -> None:
    group = grp.getgrgid(NOBODY).gr_name
    control = ControlSocket(tmp_path / "s.sock", group)
    assert control.path.stat().st_gid == NOBODY
    control.close()


def test_an_unknown_group_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no group 'no-such-group'"):
        ControlSocket(tmp_path / "s.sock", "no-such-group")


def test_the_kernel_tells_who_is_there(tmp_path: Path) -> None:
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
    with here, there:
        peer = peer_of(here)
    assert (peer.pid, peer.uid) == (os.getpid(), os.geteuid())
    assert peer.groups == {os.getegid(), *os.getgroups()}


def test_root_the_own_user_and_members_are_admitted(tmp_path: Path) -> None:
    control = ControlSocket(tmp_path / "s.sock")
    stranger = os.geteuid() + 1
    assert control.role_of(Peer(1, 0, frozenset())) is Role.CONFIGURE
    assert control.role_of(Peer(1, os.geteuid(), frozenset())) is Role.CONFIGURE
    assert control.role_of(Peer(1, stranger, frozenset({os.getegid(), 5}))) is Role.OPERATE
    assert control.role_of(Peer(1, stranger, frozenset({os.getegid() + 1}))) is None
    control.close()


def test_with_operators_named_the_other_members_may_only_look(tmp_path: Path) -> None:
    operators = grp.getgrgid(NOBODY)
    control = ControlSocket(tmp_path / "s.sock", operators=operators.gr_name)
    stranger, own = os.geteuid() + 1, os.getegid()
    assert control.role_of(Peer(1, stranger, frozenset({own}))) is Role.OBSERVE
    assert control.role_of(Peer(1, stranger, frozenset({own, NOBODY}))) is Role.OPERATE
    assert control.role_of(Peer(1, stranger, frozenset({NOBODY}))) is None  # not of the socket's
    assert control.role_of(Peer(1, 0, frozenset())) is Role.CONFIGURE
    control.close()


@pytest.mark.parametrize(
    ("mode", "role"),
    [
        (0o644, Role.OPERATE),
        (0o664, Role.CONFIGURE),
        (0o666, Role.CONFIGURE),
        (0o646, Role.OPERATE),
    ],
)
def test_of_the_operators_who_may_write_the_configuration_may_change_models(
    tmp_path: Path, mode: int, role: Role
) -> None:
    configuration = tmp_path / "left.yaml"
    configuration.touch()
    configuration.chmod(mode)
    control = ControlSocket(tmp_path / "s.sock", configuration=configuration)
    member = Peer(1, os.geteuid() + 1, frozenset({os.getegid()}))
    assert control.role_of(member) is role
    configuration.unlink()
    assert control.role_of(member) is Role.OPERATE
    control.close()


@pytest.mark.parametrize("do", ["apply", "revert"])
def test_an_operator_who_may_not_configure_changes_no_model(tmp_path: Path, do: str) -> None:
    asked: list[str] = []

    async def handle(request: Any) -> dict[str, Any]:
        asked.append(request.do)
        return {}

    arguments = {"config": {}, "source": "refined.yaml"} if do == "apply" else {}
    line = json.dumps({"id": 1, "do": do, **arguments}).encode() + b"\n"
    for role, answer in ((Role.OPERATE, "forbidden"), (Role.CONFIGURE, '"ok":true')):
        with (
            served(tmp_path / "s.sock", handle, partial(Role, role)) as path,
            socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client,
        ):
            client.connect(str(path))
            client.sendall(line)
            assert answer in client.recv(65536).decode()
    assert asked == [do]


@ROOT_ONLY
@pytest.mark.parametrize(
    ("do", "expected"),
    [("status", '"ok":true'), ("estop", '"ok":true'), ("start", "only members of the group")],
)
def test_an_observer_may_ask_and_stop_at_once_and_nothing_else(
    tmp_path: Path, do: str, expected: str
) -> None:
    request = {"do": do} | ({"axis": "x"} if do == "start" else {})
    name = grp.getgrgid(NOBODY).gr_name
    answered = ask_as_nobody(tmp_path, [12345], 0o660, request, operators=name, own_group=12346)
    assert expected in answered


@ROOT_ONLY
@pytest.mark.parametrize(
    ("groups", "mode", "expected"),
    [
        ([], 0o660, "PermissionError"),  # the file's mode keeps a stranger out
        ([], 0o666, "forbidden"),  # and so do the peer's credentials alone
        ([12345], 0o660, '"ok":true'),
    ],
)
def test_a_user_outside_the_group_is_kept_out(
    tmp_path: Path, groups: list[int], mode: int, expected: str
) -> None:
    assert expected in ask_as_nobody(tmp_path, groups, mode, {"do": "status"})


def ask_as_nobody(
    folder: Path,
    groups: list[int],
    mode: int,
    request: dict[str, str],
    *,
    operators: str | None = None,
    own_group: int = NOBODY,
) -> str:
    """Send a request to a server of group 12345 as another user, and return what comes back."""
    shared = Path(tempfile.gettempdir())
    for place in (folder, *folder.parents):
        if place == shared or shared not in place.parents:
            break
        place.chmod(0o755)

    async def ask() -> str:
        control = ControlSocket(folder / "s.sock", operators=operators)
        control.group_id = 12345
        os.chown(control.path, -1, control.group_id)
        control.path.chmod(mode)
        server = ControlServer(control, lambda _: asyncio.sleep(0, {}))
        await server.start()
        line = json.dumps(request)
        who = [str(own_group), *map(str, groups)]
        arguments = [sys.executable, "-c", ASK_AS_NOBODY, str(control.path), line, *who]
        asking = await asyncio.create_subprocess_exec(*arguments, stderr=subprocess.PIPE)
        _, out = await asking.communicate()
        await server.close()
        control.close()
        return out.decode()

    return asyncio.run(ask())


def test_a_dead_daemons_socket_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "s.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as dead:
        dead.bind(str(path))
    control = ControlSocket(path)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
        control.socket.listen()
        client.connect(str(path))
    control.close()


def test_a_living_daemon_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "s.sock"
    first = ControlSocket(path)
    with pytest.raises(UsageError, match=f"a daemon already serves {path}.*{os.getpid()}"):
        ControlSocket(path)
    assert path.exists()
    first.close()
    ControlSocket(path).close()


def test_a_foreign_server_on_the_socket_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "s.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as foreign:
        foreign.bind(str(path))
        foreign.listen()
        with pytest.raises(UsageError, match="already serves"):
            ControlSocket(path)


def test_the_lock_lasts_as_long_as_any_process_holds_it(tmp_path: Path) -> None:
    """An orphaned loop that is still stopping its axes keeps the machine taken."""
    control = ControlSocket(tmp_path / "s.sock")
    loop = subprocess.Popen(["sleep", "60"], pass_fds=[control.lock_fd])
    control.close()
    try:
        with pytest.raises(UsageError, match="already serves"):
            ControlSocket(tmp_path / "s.sock")
    finally:
        loop.kill()
        loop.wait()
    ControlSocket(tmp_path / "s.sock").close()


def test_a_file_that_is_no_socket_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("mine")
    with pytest.raises(UsageError, match="a file that is no socket is there; remove it"):
        ControlSocket(path)
    assert path.read_text() == "mine"


def test_an_impossible_place_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="control socket"):
        ControlSocket(tmp_path / "file" / "s.sock")
    with pytest.raises(UsageError, match="too long"):
        ControlSocket(tmp_path / ("s" * 120))


def test_a_socket_that_somebody_else_made_since_is_left_alone(tmp_path: Path) -> None:
    control = ControlSocket(tmp_path / "s.sock")
    control.path.unlink()
    control.path.write_text("somebody else's")
    control.close()
    assert control.path.exists()


def test_a_client_without_a_daemon_is_told_how_to_start_one(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"no daemon answers on .*motorctl run"):
        Client(tmp_path / "s.sock")


def test_systemds_directories_come_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RUNTIME_DIRECTORY", f"{tmp_path}/run:{tmp_path}/other")
    monkeypatch.setenv("STATE_DIRECTORY", f"{tmp_path}/state")
    assert daemon_socket() == tmp_path / "run" / "motorctl.sock"
    assert client_socket() == daemon_socket()
    assert state_file("gantry") == tmp_path / "state" / "gantry.json"


def test_the_only_service_is_found_and_of_several_one_has_to_be_chosen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    monkeypatch.setattr(paths, "SYSTEM_FOLDER", tmp_path / "run")
    monkeypatch.setattr(paths, "SYSTEM_SOCKET", tmp_path / "run" / "motorctl.sock")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "user"))
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    own = tmp_path / "user" / "motorctl.sock"
    assert client_socket() == own
    for name in ("left", "right"):
        (tmp_path / "run" / name).mkdir(parents=True)
    left, right = (tmp_path / "run" / name / "motorctl.sock" for name in ("left", "right"))
    left.touch()
    assert client_socket() == left
    right.touch()
    with pytest.raises(UsageError, match=r"choose one with --socket: .*left/.*, .*right/"):
        client_socket()
    own.parent.mkdir()
    own.touch()
    assert client_socket() == own


def test_a_users_own_places_are_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert daemon_socket() == tmp_path / "motorctl.sock"
    assert state_file("gantry") == tmp_path / "state" / "motorctl" / "gantry.json"
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    assert daemon_socket() == Path("/run/motorctl/motorctl.sock")
