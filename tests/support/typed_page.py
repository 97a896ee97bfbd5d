"""Commands of the documentation, as a reader types them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
ENVIRONMENT = {
    **os.environ,
    "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    "COLUMNS": "80",
}


def blocks_of(text: str) -> list[tuple[str, str]]:
    """Return the language of each block of a page, empty for what is shown, and its lines."""
    return re.findall(r"^```(\w*)\n(.*?)^```$", text, re.M | re.S)


def typed(block: str, folder: Path) -> str:
    """Return what a shell prints for the lines of a block, which all succeed."""
    done = subprocess.run(
        ["bash", "-e", "-c", block],
        cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{block}{done.stdout}{done.stderr}"
    return done.stdout
