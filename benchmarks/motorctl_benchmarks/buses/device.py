"""The device's process, started and ended with a run."""

from __future__ import annotations

import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from motorctl.errors import RunError
from motorctl_devices.prompt_ptys import can_be_prompt

READY = "ready: "
START_S = 120.0
"""The first start compiles the physics."""
END_S = 10.0


@contextmanager
def device_running(file: dict[str, Any], folder: Path) -> Iterator[str]:
    """Serve a device from a process of its own; yield its endpoint. Raises RunError."""
    path = folder / "device.yaml"
    path.write_text(yaml.safe_dump(file))
    settings = ["--raise-workers"] if can_be_prompt() else []
    command = [sys.executable, "-P", "-c", "from motorctl.cli import main; main()"]
    process = subprocess.Popen(
        [*command, "gantry-device", str(path), *settings],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        heard, _, _ = select.select([process.stdout], [], [], START_S)
        line = process.stdout.readline() if heard else ""
        if not line.startswith(READY):
            process.kill()
            _, words = process.communicate()
            raise RunError(f"the device did not start: {words.strip() or line.strip() or 'silent'}")
        yield line.removeprefix(READY).strip()
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        try:
            process.communicate(timeout=END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
