"""What was analysed of inner kernels serves other processes and callers, and is never mixed."""

import json
import subprocess
import sys
from textwrap import dedent

import pytest
from numba.core import caching

from motorctl.kernels.checked_files import files_checked

PACKAGE = {
    "inner.py": """
        from motorctl.kernels import inner_kernel

        LEVEL = 1.0

        @inner_kernel
        def add(x):
            return x + LEVEL

        @inner_kernel
        def double(x):
            return 2.0 * x

        @inner_kernel
        def twice(function, x):
            return function(function(x))

        def make(factor):
            @inner_kernel
            def scale(x):
                return factor * x
            return scale
        """,
    "added.py": """
        from numba import njit
        from beam.inner import add, twice

        @njit(cache=True)
        def go(x):
            return twice(add, x)
        """,
    "doubled.py": """
        from numba import njit
        from beam.inner import double, twice

        @njit(cache=True)
        def go(x):
            return twice(double, x)
        """,
    "both.py": """
        from numba import njit
        from beam.inner import add, double, twice

        @njit(cache=True)
        def go(x):
            return twice(add, x) + 100.0 * twice(double, x)
        """,
    "scaled_by_3.py": """
        from numba import njit
        from beam.inner import make, twice
        by_3 = make(3.0)

        @njit(cache=True)
        def go(x):
            return twice(by_3, x)
        """,
    "scaled_by_5.py": """
        from numba import njit
        from beam.inner import make, twice
        by_5 = make(5.0)

        @njit(cache=True)
        def go(x):
            return twice(by_5, x)
        """,
    "scaled_by_both.py": """
        from numba import njit
        from beam.inner import make, twice
        by_3, by_5 = make(3.0), make(5.0)

        @njit(cache=True)
        def go(x):
            return twice(by_3, x) + 100.0 * twice(by_5, x)
        """,
}
"""A package outside of motorctl: inner kernels, one of which is handed others, and callers."""
GO = """
import importlib, json, sys
from numba.core import event
from motorctl.kernels import kernels_cached

analysed = []

class Listener(event.Listener):
    def on_start(self, event):
        analysed.append(event.data["dispatcher"].py_func.__name__)
    def on_end(self, event):
        pass

with event.install_listener("numba:compile", Listener()), kernels_cached():
    value = importlib.import_module("beam." + sys.argv[1]).go(7.0)
print(json.dumps([value, sorted(analysed)]))
"""


@pytest.fixture
def go(tmp_path):
    """Call one module's kernel at 7 in a new process; return its value and what was analysed."""
    package = tmp_path / "beam"
    package.mkdir()
    for name, source in {"__init__.py": "", **PACKAGE}.items():
        (package / name).write_text(dedent(source))

    def go(module):
        environment = {
            "XDG_CACHE_HOME": str(tmp_path / "cache"),
            "PATH": "/usr/bin",
            "PYTHONPATH": str(tmp_path),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        done = subprocess.run(
            [sys.executable, "-c", GO, module], capture_output=True, text=True, check=True,
            env=environment,
        )  # fmt: skip
        return tuple(json.loads(done.stdout))

    go.folder = package
    return go


def test_another_caller_in_another_process_analyses_only_itself(go, tmp_path):
    assert go("added") == (9.0, ["add", "go", "twice"])
    (go.folder / "other.py").write_text((go.folder / "added.py").read_text())
    assert go("other") == (9.0, ["go"])


def test_a_kernel_that_is_handed_another_is_analysed_for_it(go):
    assert go("added") == (9.0, ["add", "go", "twice"])
    assert go("doubled") == (28.0, ["double", "go", "twice"])


@pytest.mark.slow
def test_what_two_processes_analysed_is_linked_without_mixing_it_up(go):
    go("added")
    go("doubled")
    assert go("both") == (9.0 + 2800.0, ["go"])


@pytest.mark.slow
def test_two_kernels_of_one_name_from_two_processes_stay_two(go):
    assert go("scaled_by_3")[0] == 63.0
    assert go("scaled_by_5")[0] == 175.0
    assert go("scaled_by_both") == (63.0 + 17500.0, ["go"])


@pytest.mark.slow
def test_a_changed_constant_is_analysed_anew(go):
    go("added")
    inner = go.folder / "inner.py"
    inner.write_text(inner.read_text().replace("LEVEL = 1.0", "LEVEL = 2.0"))
    assert go("added") == (11.0, ["add", "go", "twice"])


def test_a_file_that_another_process_wrote_for_other_types_counts_as_not_there(tmp_path):
    with files_checked():
        files = caching.IndexDataCacheFile(str(tmp_path), "kernel", "stamp")
        files.save("of floats", "code of floats")
        (index,) = tmp_path.glob("*.nbi")
        of_floats = index.read_bytes()
        index.unlink()
        files.save("of integers", "code of integers")
        index.write_bytes(of_floats)  # as where both wrote at once, and this index came last
        assert files.load("of floats") is None
