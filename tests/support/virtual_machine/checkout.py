"""This checkout as a job finds it: the sources of motorctl, found like an installed package."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[3]
FOLDERS = ("motorctl", "drivers", "devices", "configs", "docs/drivers")
PYTHON_PATH = "/job/motorctl:/job/motorctl/drivers:/job/motorctl/devices:/opt/packages"


def add_checkout(job: Path) -> None:
    """Copy the sources into `motorctl` of a job; `PYTHON_PATH` finds them inside."""
    to = job / "motorctl"
    skip = shutil.ignore_patterns("__pycache__", "*.pyc")
    for name in FOLDERS:
        shutil.copytree(ROOT / name, to / name, ignore=skip)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    about = to / "motorctl-0.dist-info"
    about.mkdir()
    version = f"Metadata-Version: 2.1\nName: motorctl\nVersion: {project['version']}\n"
    (about / "METADATA").write_text(version)
    points = [
        f"[{group}]\n" + "".join(f"{name} = {where}\n" for name, where in found.items())
        for group, found in project["entry-points"].items()
    ]
    (about / "entry_points.txt").write_text("\n".join(points))
