"""Generated kernels are kept between runs, and what cannot be kept is said."""

import subprocess
import sys

import pytest

from motorctl.kernels import kernel_folder, load_generated, source_digest

SOURCE = '''"""A generated module."""

from numba import njit


@njit(cache=True)
def twice(x):
    return 2.0 * x
'''
KEEP = """
import sys
from motorctl.errors import RunError
from motorctl.kernels import load_generated
try:
    module = load_generated("keep_test", sys.stdin.read())
except RunError as error:
    print("RunError:", error)
else:
    print(module.twice(4.0), sum(module.twice.stats.cache_hits.values()))
"""


def keep(folder) -> str:
    """Load SOURCE in a process whose cache is in this folder."""
    environment = {"XDG_CACHE_HOME": str(folder), "PATH": "/usr/bin"}
    done = subprocess.run(
        [sys.executable, "-c", KEEP],
        input=SOURCE, capture_output=True, text=True, check=True, env=environment,
    )  # fmt: skip
    return done.stdout.strip()


def test_a_compiled_kernel_is_there_at_the_next_start(tmp_path):
    assert keep(tmp_path) == "8.0 0"
    assert keep(tmp_path) == "8.0 1"


def test_a_cache_that_cannot_be_written_is_told_in_one_message(tmp_path):
    (tmp_path / "file").write_text("")
    said = keep(tmp_path / "file")
    assert said.startswith("RunError: compiled kernels cannot be kept in ")
    assert "XDG_CACHE_HOME" in said
    assert "\n" not in said


def test_a_module_with_another_source_has_another_name():
    assert source_digest(SOURCE) != source_digest(SOURCE + "\n")


def test_kernels_of_other_sources_are_kept_apart(tmp_path):
    (tmp_path / "physics.py").write_text("A = 1\n")
    assert kernel_folder(tmp_path) != kernel_folder()


def test_a_module_that_fails_is_tried_afresh():
    name = "fails_test"
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            load_generated(name, "1 / 0\n")
    (kernel_folder() / f"motorctl_generated_{name}.py").unlink()
