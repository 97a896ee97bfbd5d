"""can-utils as the peer on vcan0: the only code here that speaks CAN beside the driver."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

INTERFACE = "vcan0"
ARRIVAL_S = 0.1
RECEIVE_BUFFER = 8_000_000  # bytes; a flood is to be seen whole


def shell(command: str) -> str:
    """Run a command. Raises RuntimeError with what it said where it fails."""
    done = subprocess.run(
        ["/bin/bash", "-c", command], capture_output=True, text=True, check=False, timeout=60
    )
    if done.returncode:
        raise RuntimeError(f"{command}: {done.returncode}: {done.stdout}{done.stderr}")
    return done.stdout


def cansend(*frames: str) -> None:
    """Send frames as can-utils write them, and let them arrive."""
    for frame in frames:
        subprocess.run(["cansend", INTERFACE, frame], check=True, timeout=30)
    time.sleep(ARRIVAL_S)


@contextmanager
def started(command: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run a shell command beside, with all that it starts, and end it."""
    with subprocess.Popen(["/bin/bash", "-c", command], start_new_session=True) as process:
        try:
            yield process
        finally:
            os.killpg(process.pid, signal.SIGTERM)


@contextmanager
def candump(file: Path, interface: str = INTERFACE) -> Iterator[None]:
    """Write every frame on the bus to a file, in candump's log format."""
    with started(f"exec candump -r {RECEIVE_BUFFER} -D -L {interface} > {file}"):
        wait_for_listener(interface)
        yield
        time.sleep(5 * ARRIVAL_S)


def wait_for_listener(interface: str) -> None:
    """Wait until a program that was just started is on the bus."""
    deadline = time.monotonic() + 20
    everything = Path("/proc/net/can/rcvlist_all")
    while time.monotonic() < deadline:
        if f" {interface} " in everything.read_text():
            return
        time.sleep(0.02)
    raise TimeoutError("candump does not listen")


def up() -> None:
    """Bring the interface up, made anew where it is gone."""
    if not Path(f"/sys/class/net/{INTERFACE}").exists():
        shell(f"ip link add dev {INTERFACE} type vcan")
    shell(f"ip link set {INTERFACE} mtu 72 up")
