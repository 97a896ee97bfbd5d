"""Whatever became of the compiled code on the disk, it is compiled anew, told once, never run."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from tiers import few_of

SOURCE = '''"""A generated module."""

from numba import njit


@njit(cache=True)
def twice(x):
    return 2.0 * x


@njit(cache=True)
def thrice(x):
    return 3.0 * x
'''
USE = """
import sys
from motorctl.errors import RunError
from motorctl.kernels import load_generated
try:
    module = load_generated("damage_test", sys.stdin.read())
except RunError as error:
    sys.exit(f"RunError: {error}")
print(module.twice(4.0), module.thrice(4.0), end=" ")
print(sum(sum(kernel.stats.cache_hits.values()) for kernel in (module.twice, module.thrice)))
"""
ROOT = os.geteuid() == 0


def use(cache: Path) -> subprocess.CompletedProcess[str]:
    """Call both kernels in a process of its own; it prints them and how many came from the disk."""
    environment = {"XDG_CACHE_HOME": str(cache), "PATH": "/usr/bin"}
    return subprocess.run(
        [sys.executable, "-c", USE],
        input=SOURCE,
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )


def files(cache: Path, suffix: str) -> list[Path]:
    found = sorted((cache / "motorctl" / "compiled").rglob(f"*{suffix}"))
    assert found
    return found


def cut_index(cache: Path) -> None:
    for path in files(cache, ".nbi"):
        path.write_bytes(path.read_bytes()[:-20])


def empty_index(cache: Path) -> None:
    for path in files(cache, ".nbi"):
        path.write_bytes(b"")


def cut_code(cache: Path) -> None:
    for path in files(cache, ".nbc"):
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def flip_a_bit_of_the_code(cache: Path) -> None:
    for path in files(cache, ".nbc"):
        whole = bytearray(path.read_bytes())
        whole[len(whole) // 2] ^= 1
        path.write_bytes(bytes(whole))


def garbage(cache: Path) -> None:
    for path in files(cache, ".nbi") + files(cache, ".nbc"):
        path.write_bytes(os.urandom(5000))


def what_numba_itself_would_write(cache: Path) -> None:
    import pickle

    for path in files(cache, ".nbi"):
        path.write_bytes(pickle.dumps("0.0") + pickle.dumps(("stamp", {})))


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache that a first start filled."""
    cache = tmp_path_factory.mktemp("whole")
    assert use(cache).stdout == "8.0 12.0 0\n"
    return cache


@pytest.mark.slow
@pytest.mark.parametrize(
    "damage",
    few_of(
        [
            cut_index,
            empty_index,
            flip_a_bit_of_the_code,
            cut_code,
            garbage,
            what_numba_itself_would_write,
        ],
        3,
    ),
)
def test_damaged_code_is_compiled_anew_told_in_one_message_and_whole_at_the_next_start(
    whole: Path, tmp_path: Path, damage: Callable[[Path], None]
) -> None:
    cache = tmp_path / "cache"
    shutil.copytree(whole, cache)
    damage(cache)
    done = use(cache)
    assert (done.returncode, done.stdout) == (0, "8.0 12.0 0\n"), done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"compiled code in {cache}")
    assert "is damaged: " in line
    assert "compiled anew" in line
    again = use(cache)
    assert (again.stdout, again.stderr) == ("8.0 12.0 2\n", "")


@pytest.mark.slow
def test_whole_code_is_taken_without_a_word(whole: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    shutil.copytree(whole, cache)
    done = use(cache)
    assert (done.stdout, done.stderr) == ("8.0 12.0 2\n", "")


@pytest.mark.slow
def test_a_folder_that_cannot_be_used_costs_the_time_to_compile_and_is_told(
    whole: Path, tmp_path: Path
) -> None:
    """Something that is no folder stands where a module's code was: neither read nor kept."""
    cache = tmp_path / "cache"
    shutil.copytree(whole, cache)
    for path in list((cache / "motorctl" / "compiled").iterdir()):
        shutil.rmtree(path)
        path.write_text("")
    done = use(cache)
    assert (done.returncode, done.stdout) == (0, "8.0 12.0 0\n"), done.stderr
    assert "cannot be read" in done.stderr
    assert "cannot be kept in" in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == 2


@pytest.mark.skipif(ROOT, reason="root reads everything")
def test_code_of_another_user_that_cannot_be_read_is_told(whole: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    shutil.copytree(whole, cache)
    for path in files(cache, ".nbc"):
        path.chmod(0)
    done = use(cache)
    assert (done.returncode, done.stdout) == (0, "8.0 12.0 0\n"), done.stderr
    assert "cannot be read" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("content", [b"", b"\x00\xff" * 200, None])
def test_a_generated_module_that_is_not_as_it_was_written_is_written_anew(
    whole: Path, tmp_path: Path, content: bytes | None
) -> None:
    cache = tmp_path / "cache"
    shutil.copytree(whole, cache)
    (module,) = (cache / "motorctl" / "generated").glob("*damage_test.py")
    edited = module.read_bytes().replace(b"2.0 * x", b"9.0 * x")
    module.write_bytes(edited if content is None else content)
    done = use(cache)
    assert (done.stdout, done.stderr) == ("8.0 12.0 2\n", "")
    assert module.read_text() == SOURCE


@pytest.mark.slow
def test_a_folder_in_the_place_of_a_generated_module_is_told(whole: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    shutil.copytree(whole, cache)
    (module,) = (cache / "motorctl" / "generated").glob("*damage_test.py")
    module.unlink()
    module.mkdir()
    done = use(cache)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"RunError: a generated module cannot be kept as {module}: ")
    assert "remove it" in line
