"""The wheels built from here: their licence, and types for whoever uses their code."""

from __future__ import annotations

import subprocess
import sys
from email.parser import Parser
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parents[2]
BUILD = "import sys; from hatchling.build import build_wheel; print(build_wheel(sys.argv[1]))"


PACKAGES = {
    ".": {
        "motorctl",
        "motorctl_sim",
        "motorctl_can",
        "motorctl_canopen",
        "motorctl_serial",
        "motorctl_modbus",
    },
    "devices": {"motorctl_devices"},
    "benchmarks": {"motorctl_benchmarks"},
}


@pytest.fixture(scope="module", params=PACKAGES)
def source(request: pytest.FixtureRequest) -> str:
    """Return the folder that a wheel is built from."""
    return str(request.param)


@pytest.fixture(scope="module")
def wheel(source: str, tmp_path_factory: pytest.TempPathFactory) -> ZipFile:
    """Build a wheel from this checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-c", BUILD, str(folder)]
    built = subprocess.run(command, cwd=ROOT / source, check=True, capture_output=True, text=True)
    return ZipFile(folder / built.stdout.strip())


def test_every_package_of_the_wheel_is_typed(wheel: ZipFile, source: str) -> None:
    packages = {name.split("/")[0] for name in wheel.namelist() if name.endswith(".py")}
    assert packages == PACKAGES[source]
    untyped = [name for name in packages if f"{name}/py.typed" not in wheel.namelist()]
    assert not untyped


def test_the_wheel_carries_the_licence_that_it_names(wheel: ZipFile, source: str) -> None:
    (about,) = (name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
    told = Parser().parsestr(wheel.read(about).decode())
    of_others = {".": "Apache-2.0 AND MIT"}  # uPlot, in the scope's page
    assert told["License-Expression"] == of_others.get(source, "Apache-2.0")
    licence = wheel.read(about.replace("METADATA", "licenses/LICENSE"))
    assert licence == (ROOT / "LICENSE").read_bytes()
    assert licence.split(b"\n")[1:3] == [
        b"                                 Apache License",
        b"                           Version 2.0, January 2004",
    ]


def test_the_wheel_carries_the_page_of_the_scope_with_the_licence_of_what_is_in_it(
    wheel: ZipFile, source: str
) -> None:
    if source != ".":
        return
    page = "motorctl/scope/page/"
    there = {name.removeprefix(page) for name in wheel.namelist() if name.startswith(page)}
    folder = ROOT / page
    files = (path for path in folder.rglob("*") if path.is_file())
    assert there == {str(path.relative_to(folder)) for path in files}
    assert b"The MIT License" in wheel.read(f"{page}uplot/LICENSE")
