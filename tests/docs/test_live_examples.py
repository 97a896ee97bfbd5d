"""What pages show of a running machine happens: their commands are typed beside the daemon."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from daemon_rig import wait_until

from motorctl.daemon.client import Client
from motorctl.errors import MotorctlError

PAGES = Path(__file__).parents[2] / "docs"
SHOWN_SOCKET = "/tmp/m.sock"
INTERACTIVE = ("motorctl jog", "motorctl status --watch")
"""Commands that wait for keys."""

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock(lanes=3)]


def shown(page: str) -> tuple[str, list[str]]:
    """Return how a page starts the daemon, and what it types beside it."""
    text = (PAGES / f"{page}.md").read_text()
    blocks = re.findall(r"^```sh\n(.*?)^```", text, re.M | re.S)
    lines = [re.sub(r"\s+#.*", "", line) for line in "".join(blocks).splitlines()]
    (start,) = (line for line in lines if line.startswith("motorctl run "))
    after = lines[lines.index(start) + 1 :]
    asked = [
        line for line in after if re.match(r"motorctl (start|home|move|stop|status|estop)", line)
    ]
    return start, [line for line in asked if not line.startswith(INTERACTIVE)]


@contextmanager
def running(start: str, folder: Path) -> Iterator[dict[str, str]]:
    """Run a daemon as a page starts it; yield the environment in which commands find it."""
    socket = folder / "motorctl.sock"
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "COLUMNS": "80", "RUNTIME_DIRECTORY": str(folder)}
    daemon = subprocess.Popen(
        start.replace(SHOWN_SOCKET, str(socket)).split(),
        cwd=folder,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        wait_until(lambda: answers(socket), 240.0)
        yield environment
    finally:
        daemon.terminate()  # as a service manager does: SIGINT may be ignored here, and inherited
        try:
            daemon.wait(60.0)
        finally:
            daemon.kill()


def answers(socket: Path) -> bool:
    try:
        with Client(socket) as client:
            return bool(client.ask("status"))
    except MotorctlError:
        return False


@pytest.mark.parametrize(
    ("page", "count", "told"),
    [
        ("tutorial", 4, ["axis y: to 100.0000 mm", "axis y: off"]),
        ("homing", 2, ["axis x: homed, at -", "axis x: to 10.0000 mm"]),
        ("running", 5, ["axis y: to 100.0000 mm", "axis x: off"]),
    ],
)
def test_the_commands_that_a_page_types_beside_the_daemon_do_what_it_tells(
    page: str, count: int, told: list[str], tmp_path: Path
) -> None:
    start, commands = shown(page)
    # What the tutorial has found before changes the model, not what these commands do.
    start = start.replace("refined.yaml", "published_gantry")
    assert len(commands) == count
    said = ""
    with running(start, tmp_path) as environment:
        for command in commands:
            done = subprocess.run(
                command.replace(SHOWN_SOCKET, str(tmp_path / "motorctl.sock")).split(),
                env=environment,
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == 0, f"{command}: {done.stderr}"
            said += done.stdout
    for words in told:
        assert words in said
    assert [*(tmp_path / "logs").glob("*.parquet")]
