"""What was analysed of inner kernels serves other processes and callers, and is never mixed."""

import json
import subprocess
import sys
from textwrap import dedent

import numba
import pytest
from numba.core import caching

from motorctl.kernels import inner_kernel
from motorctl.kernels.checked_files import files_checked

LONG = pytest.mark.long

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
    "forms.py": """
        import numpy as np
        from motorctl.kernels import inner_kernel

        def said(value):
            @inner_kernel
            def say(x):
                return value
            return say

        def scaled(factor):
            @inner_kernel
            def scale(x):
                return factor * x
            return scale

        def scaled_as_second(*factors):
            factors = np.array(factors)

            @inner_kernel
            def scale(x):
                return factors[1] * x
            return scale

        def usual(level):
            @inner_kernel
            def more(x, by=level):
                return x + by
            return more

        def over(model):
            @inner_kernel(error_model=model)
            def divide(x):
                return 1.0 / (x - 7.0)
            return divide

        def through(factor):
            inside = scaled(factor)

            @inner_kernel
            def outside(x):
                return inside(x) + 1.0
            return outside

        @inner_kernel
        def divided(x, y):
            return x / y
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
CALLED = """
from numba import njit
from beam.forms import over, said, scaled, scaled_as_second, through, usual

made = {made}

@njit(cache=True)
def inside(x):
    return made(x)

def go(x):
    try:
        return str(inside(x))
    except ZeroDivisionError:
        return "raises"
"""
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


@inner_kernel
def one_more(x):
    return x + 1.0


@inner_kernel
def one_less(x):
    return x - 1.0


@pytest.fixture
def go(tmp_path):
    """Call one module's kernel at 7 in a new process; return its value and what was analysed."""
    package = tmp_path / "beam"
    package.mkdir()
    for name, source in {"__init__.py": "", **PACKAGE}.items():
        (package / name).write_text(dedent(source))

    def go(module, fresh=False):
        environment = {
            "XDG_CACHE_HOME": str(tmp_path / ("fresh" if fresh else "cache")),
            "PATH": "/usr/bin",
            "PYTHONPATH": str(tmp_path),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        done = subprocess.run(
            [sys.executable, "-c", GO, module], capture_output=True, text=True, check=True,
            env=environment,
        )  # fmt: skip
        return tuple(json.loads(done.stdout))

    go.folder, go.cache = package, tmp_path / "cache"
    return go


@pytest.mark.slow
def test_another_caller_in_another_process_analyses_only_itself(go, tmp_path):
    assert go("added") == (9.0, ["add", "go", "twice"])
    (go.folder / "other.py").write_text((go.folder / "added.py").read_text())
    assert go("other") == (9.0, ["go"])


@pytest.mark.slow
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
@pytest.mark.parametrize(
    ("first", "then"),
    [
        pytest.param("said(2)", "said(2.0)", id="an integer and a float", marks=LONG),
        pytest.param("scaled(0.0)", "scaled(-0.0)", id="zero and its negative"),
        pytest.param("scaled_as_second(1, 2)", "scaled_as_second(1, 3)", id="arrays"),
        pytest.param("usual(3.0)", "usual(5.0)", id="defaults", marks=LONG),
        pytest.param("over('numpy')", "over('python')", id="error models", marks=LONG),
        pytest.param("through(3.0)", "through(5.0)", id="kernels within kernels"),
    ],
)
def test_what_differs_in_anything_but_its_source_is_not_taken_for_the_other(go, first, then):
    def called(made, fresh=False):
        (go.folder / "called.py").write_text(CALLED.format(made=made))
        return go("called", fresh)[0]

    alone = called(then, fresh=True)
    assert called(first) != alone
    assert called(then) == alone


def test_the_same_kernel_in_a_kernel_is_found_again_and_not_kept_twice(go):
    (go.folder / "called.py").write_text(CALLED.format(made="through(3.0)"))
    assert "outside" in go("called")[1]
    kept = list(go.cache.rglob("forms.*.nbc"))
    (go.folder / "again.py").write_text((go.folder / "called.py").read_text())
    assert go("again") == ("22.0", ["inside"])
    assert list(go.cache.rglob("forms.*.nbc")) == kept


@pytest.mark.slow
def test_an_error_model_is_not_inherited_from_whoever_compiles_first(go):
    """A kernel that divides without a word gives inf under any caller."""
    for name, options in (("plain", ""), ("numpy", ', error_model="numpy"')):
        (go.folder / f"{name}.py").write_text(
            dedent(f"""
            from numba import njit
            from beam.forms import divided

            @njit(cache=True{options})
            def go(x):
                return divided(x, x - 7.0)
            """)
        )
    assert go("plain")[0] == float("inf")
    assert go("numpy")[0] == float("inf")


@pytest.mark.slow
def test_a_source_that_changes_while_it_is_in_use_is_not_kept_as_the_new_one(go):
    (go.folder / "edited.py").write_text(
        dedent(f"""
        from pathlib import Path
        from numba import njit
        from beam.inner import add
        file = Path({str(go.folder / "inner.py")!r})
        file.write_text(file.read_text().replace("LEVEL = 1.0", "LEVEL = 2.0"))

        @njit(cache=True)
        def go(x):
            return add(x)
        """)
    )
    assert go("edited")[0] == 8.0  # what it had imported
    edited = go.folder / "edited.py"
    edited.write_text(edited.read_text().replace("file.write_text", "str"))
    assert go("added")[0] == 11.0
    assert go("edited")[0] == 9.0


def test_a_kernel_without_a_file_is_compiled_and_not_kept():
    space = {"inner_kernel": inner_kernel, "njit": numba.njit}
    exec("@inner_kernel\ndef add(x):\n    return x + 1.0\n", space)
    exec("@njit\ndef go(x):\n    return add(x)\n", space)
    assert space["go"](1.0) == 2.0


@pytest.mark.filterwarnings("ignore::numba.core.errors.NumbaExperimentalFeatureWarning")
def test_a_kernel_that_a_condition_chooses_is_called():
    @numba.njit
    def go(x, first):
        chosen = one_more if first else one_less
        return chosen(x)

    assert (go(3.0, True), go(3.0, False)) == (4.0, 2.0)


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
