"""What systemd itself says of a unit file."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest


def analyze(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run `systemd-analyze`; skip where there is none."""
    program = shutil.which("systemd-analyze")
    if program is None:
        pytest.skip("systemd-analyze is not installed (Debian: systemd)")
    return subprocess.run(
        [program, *arguments],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "SYSTEMD_LOG_LEVEL": "info"},
    )


def exposure(unit: Path) -> float:
    """Return how exposed a service is, from 0 (locked up) to 10."""
    done = analyze("security", "--offline=true", "--no-pager", str(unit))
    if "offline" in done.stderr:
        pytest.skip("this systemd-analyze is too old for --offline")
    found = re.search(r"exposure level for \S+: ([\d.]+)", done.stdout)
    assert found, done.stderr
    print(f"systemd-analyze security: {found[1]}")
    return float(found[1])
