"""A daemon in a process of its own, on a machine that is simulated in real time."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from motorctl.daemon.client import Client
from motorctl.errors import MotorctlError, RunError

START_S, END_S = 300.0, 120.0
"""How long a start and an end may take: minutes where a busy computer compiles everything. Longer
keeps who waits for one that hangs; shorter ends a slow one. By hand."""
LOOK_S = 0.05
"""Between two looks whether rows are recorded: the resolution of a measured start."""
MAIN = "from motorctl.cli import main; main()"


@contextmanager
def running_daemon(
    config: str, folder: Path, environment: Mapping[str, str] | None = None
) -> Iterator[tuple[subprocess.Popen[bytes], Client]]:
    """Run a daemon with logs, socket and learned parameters in a folder.

    Parameters
    ----------
    config
        A configuration, or a shipped one's name.
    folder
        Where everything goes that it leaves.
    environment
        Variables beside this process' own.

    Yields
    ------
    process, client
        The daemon, which records already, and a connection to it.

    Raises
    ------
    RunError
        Where it does not start.
    """
    socket = folder / "motorctl.sock"
    command = [sys.executable, "-P", "-c", MAIN, "run", config, "--log-dir", str(folder / "logs")]
    with ExitStack() as end:
        errors = end.enter_context((folder / "stderr.txt").open("wb"))
        own = {**os.environ, "XDG_STATE_HOME": str(folder / "state"), **(environment or {})}
        process = subprocess.Popen([*command, "--socket", str(socket)], stderr=errors, env=own)
        end.callback(_end, process)
        deadline = time.monotonic() + START_S
        while True:
            with suppress(MotorctlError):
                client = Client(socket)
                if client.ask("status")["recording"]["rows"] > 0:
                    break
                client.close()
            if process.poll() is not None or time.monotonic() > deadline:
                said = (folder / "stderr.txt").read_text().strip()
                raise RunError(f"the daemon did not start: {said.splitlines()[-1:] or 'silent'}")
            time.sleep(LOOK_S)
        end.callback(client.close)
        yield process, client


def _end(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
