"""Commands that packages beside motorctl bring: found, imported late, and nobody else's trouble."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

MAIN = "from motorctl.cli import main; main()"
OURS = ("motorctl_benchmarks", "motorctl_devices")


def motorctl(*words: str, path: Path | None = None, before: str = "") -> tuple[int, str, str]:
    """Run the command line in a process of its own; return its exit status, stdout and stderr."""
    environment = dict(os.environ, COLUMNS="200")
    if path is not None:
        environment["PYTHONPATH"] = str(path)
    code = f"import sys; {before}\n{MAIN}"
    done = subprocess.run(
        [sys.executable, "-c", code, *words],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    return done.returncode, done.stdout, done.stderr


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Write a package as a third party would, with commands that work, fail, and take a name."""
    (tmp_path / "greeting.py").write_text(
        "import typer\n\n\n"
        "def greet(name: str, times: int = 1) -> None:\n"
        '    """Greet somebody."""\n'
        '    typer.echo(f"hello {name} " * times)\n'
    )
    (tmp_path / "greeting_broken.py").write_text("raise OSError('no such board')\n")
    about = tmp_path / "greeting-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: greeting\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(
        "[motorctl.commands]\n"
        "greet = greeting:greet\n"
        "broken = greeting_broken:greet\n"
        "absent = greeting:nothing\n"
        "check = greeting:greet\n"
    )
    return tmp_path


def test_help_lists_the_commands_of_packages_without_importing_them(package: Path) -> None:
    told = "import atexit; atexit.register(lambda: print('imported:', *sys.modules))"
    status, out, _ = motorctl("--help", path=package, before=told)
    assert status == 0
    for command in ("bench", "gantry-device", "greet", "broken", "absent"):
        assert f"\n  {command} " in out
    assert "A command of the package greeting" in out
    imported = out.partition("imported:")[2].split()
    assert not {*OURS, "greeting", "greeting_broken"} & set(imported)


@pytest.mark.slow
def test_a_command_of_a_package_takes_its_own_arguments(package: Path) -> None:
    assert motorctl("greet", "axis", "--times", "2", path=package)[:2] == (
        0,
        "hello axis hello axis \n",
    )
    assert "Greet somebody." in motorctl("greet", "--help", path=package)[1]
    assert motorctl("greet", "--tims", "2", path=package)[0] == 2


@pytest.mark.parametrize(
    ("command", "words"), [("broken", "OSError: no such board"), ("absent", "AttributeError")]
)
def test_a_package_that_fails_to_load_is_told_in_one_message(
    package: Path, command: str, words: str
) -> None:
    status, out, told = motorctl(command, path=package)
    assert (status, out) == (2, "")
    assert len(told.splitlines()) == 1
    assert told.startswith(f"motorctl: {command} (greeting")
    assert words in told


@pytest.mark.slow
def test_a_package_that_fails_to_load_hurts_no_other_command(package: Path) -> None:
    assert motorctl("drivers", "--json", path=package)[0] == 0


def test_a_package_cannot_take_the_name_of_a_command_of_motorctl(package: Path) -> None:
    _, out, _ = motorctl("check", "--help", path=package)
    assert "configuration" in out
    assert "Greet" not in out


@pytest.mark.parametrize(
    ("command", "module", "remedy"),
    [
        ("bench", "motorctl_benchmarks", "pip install ./devices ./benchmarks"),
        ("gantry-device", "motorctl_devices", "pip install ./devices"),
    ],
)
def test_where_a_package_is_not_installed_its_command_says_what_to_install(
    command: str, module: str, remedy: str
) -> None:
    gone = f"sys.modules['{module}'] = None"
    status, out, told = motorctl(command, before=gone)
    assert (status, out) == (2, "")
    assert told.splitlines() == [
        f"motorctl: {command} is a command of {module}, which is not installed: "
        f"{remedy}, in a checkout of motorctl"
    ]
