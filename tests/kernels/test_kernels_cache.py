"""Compiled kernels are kept between starts, never used when stale, and not kept for ever."""

import os
import subprocess
import sys
import time
from textwrap import dedent

import numba
import numpy as np
import pytest

from motorctl.kernels import compiling_told, inner_kernel, load_generated, source_digest
from motorctl.kernels.cache import UNUSED_DAYS
from motorctl.kernels.digest import digest_of_file, digest_of_source

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
PLANT = {
    "plant/__init__.py": "from plant.force import force\n",
    "plant/force.py": '''
        """What pulls."""
        from motorctl.kernels import inner_kernel
        from plant.friction import friction

        @inner_kernel
        def force(v: float) -> float:
            """Sum up."""
            return friction(v) + 1.0
        ''',
    "plant/friction.py": """
        from motorctl.kernels import inner_kernel
        from plant.options import Options

        LEVEL = Options().level

        @inner_kernel
        def friction(v):
            return LEVEL * v
        """,
    "plant/options.py": """
        from dataclasses import dataclass

        @dataclass
        class Options:
            level: float = 2.0
        """,
    "plant/unused.py": "ANYTHING = 1\n",
    "plant/other.py": "from plant.friction import friction as force\n",
    "plant/kernels.py": """
        from numba import njit
        from plant import force

        @njit(cache=True)
        def pull(v):
            return force(v)
        """,
}
"""A package outside of motorctl whose kernel uses a constant four imports away."""
PULL = """
from motorctl.kernels import kernels_cached
with kernels_cached():
    from plant.kernels import pull
print(pull(3.0), sum(pull.stats.cache_hits.values()))
"""


def keep(folder) -> str:
    """Load SOURCE in a process whose cache is in this folder."""
    environment = {"XDG_CACHE_HOME": str(folder), "PATH": "/usr/bin"}
    done = subprocess.run(
        [sys.executable, "-c", KEEP],
        input=SOURCE, capture_output=True, text=True, check=True, env=environment,
    )  # fmt: skip
    return done.stdout.strip()


class Plant:
    """A package with a kernel, and a cache; `pull` calls it in a process of its own."""

    def __init__(self, folder):
        self._folder = folder
        for name, source in PLANT.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(dedent(source))

    def edit(self, name, old, new):
        path = self._folder / "plant" / name
        assert old in path.read_text()
        path.write_text(path.read_text().replace(old, new))

    def digest(self) -> str:
        """Return what its compiled code depends on."""
        digest, _ = digest_of_file("plant.kernels", self._folder / "plant" / "kernels.py")
        return digest

    def pull(self, folder=None) -> str:
        """Return the force at 3 m/s and how often the cache had the code."""
        environment = {
            "XDG_CACHE_HOME": str(self._folder),
            "PATH": "/usr/bin",
            "PYTHONPATH": str(folder or self._folder),
            # Python takes bytecode for current when a source of the same length was changed in
            # the same second: an edit here would run the code before it.
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        done = subprocess.run(
            [sys.executable, "-c", PULL], capture_output=True, text=True, check=True,
            env=environment,
        )  # fmt: skip
        return done.stdout.strip()


@pytest.fixture
def plant(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    yield Plant(tmp_path)
    for name in [name for name in sys.modules if name.partition(".")[0] == "plant"]:
        del sys.modules[name]


def test_a_compiled_kernel_is_there_at_the_next_start(tmp_path):
    assert keep(tmp_path) == "8.0 0"
    assert keep(tmp_path) == "8.0 1"


def test_a_cache_that_cannot_be_written_is_told_in_one_message(tmp_path):
    (tmp_path / "file").write_text("")
    said = keep(tmp_path / "file")
    assert said.startswith("RunError: compiled kernels cannot be kept in ")
    assert "XDG_CACHE_HOME" in said
    assert "\n" not in said


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        pytest.param("kernels.py", "force(v)", "force(v) + 1", id="the kernel"),
        pytest.param("force.py", "+ 1.0", "+ 2.0", id="a function it calls"),
        pytest.param("friction.py", "* v", "* v * v", id="a function two imports away"),
        pytest.param("friction.py", "Options()", "Options(3.0)", id="a constant"),
        pytest.param("options.py", "2.0", "3.0", id="an option's default"),
        pytest.param("__init__.py", ".force import", ".other import", id="where a name comes from"),
    ],
)
def test_a_change_of_what_a_kernel_uses_gives_it_another_digest(plant, name, old, new):
    before = plant.digest()
    plant.edit(name, old, new)
    assert plant.digest() != before


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        pytest.param("kernels.py", "@njit", "# how it pulls\n\n\n@njit", id="a comment"),
        pytest.param("friction.py", "LEVEL =", "\n\n\nLEVEL =  ", id="lines that move"),
        pytest.param("force.py", "Sum up.", "The sum of what pulls.", id="a docstring"),
        pytest.param("force.py", "What pulls.", "What pulls it.", id="a module's docstring"),
        pytest.param("force.py", "v: float", "v: 'speed'", id="an annotation"),
        pytest.param("unused.py", "1", "2", id="a module it does not use"),
    ],
)
def test_a_change_that_compiled_code_does_not_show_leaves_the_digest(plant, name, old, new):
    before = plant.digest()
    plant.edit(name, old, new)
    assert plant.digest() == before


def test_a_change_behind_an_import_of_everything_gives_another_digest(plant):
    plant.edit("__init__.py", ".force import force", ".force import *")
    before = plant.digest()
    plant.edit("friction.py", "* v", "* v * v")
    assert plant.digest() != before


def test_a_package_that_changes_without_its_version_gives_another_digest(plant):
    plant.edit("__init__.py", "from", "__version__ = '1.0'\nfrom")
    source = "from plant.kernels import pull\n"
    before = digest_of_source(source)
    plant.edit("friction.py", "* v", "* v * v")
    assert digest_of_source(source) != before


@pytest.mark.slow
def test_a_fresh_copy_of_the_same_sources_is_not_compiled(plant, tmp_path):
    assert plant.pull() == "7.0 0"
    copy = tmp_path / "elsewhere"
    copy.mkdir()
    (tmp_path / "plant").rename(copy / "plant")
    for path in copy.rglob("*.py"):
        os.utime(path, (0, 0))
    assert plant.pull(copy) == "7.0 1"


def test_a_generated_module_has_another_name_where_it_does_something_else():
    assert source_digest(SOURCE) != source_digest(SOURCE.replace("2.0", "3.0"))
    assert source_digest(SOURCE) == source_digest(SOURCE.replace("A generated", "Another"))


@pytest.mark.slow
def test_a_changed_option_is_compiled_and_what_nobody_used_for_a_month_removed(plant, tmp_path):
    assert plant.pull() == "7.0 0"
    (used,) = (tmp_path / "motorctl" / "compiled").glob("plant.kernels-*")
    parsed = tmp_path / "motorctl" / "parsed"
    ages_days = {"recent": UNUSED_DAYS - 1.0, "old": UNUSED_DAYS + 1.0}
    for name, days in ages_days.items():
        (used.parent / name).mkdir()
        (parsed / name).touch()
        then = time.time() - days * 86400.0
        for unused in (used.parent / name, parsed / name):
            os.utime(unused, (then, then))
    plant.edit("options.py", "2.0", "3.0")
    assert plant.pull() == "10.0 0"
    for folder, kept in ((used.parent, {used.name, "recent"}), (parsed, {"recent"})):
        left = {entry.name for entry in folder.iterdir()}
        assert kept < left
        assert "old" not in left


def test_a_module_that_fails_is_tried_afresh():
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            load_generated("fails_test", "1 / 0\n")


@inner_kernel
def shifted(values, by):
    values[0] += by
    return values[0]


def test_a_kernel_for_other_kernels_can_be_called_from_python():
    values = np.zeros(1)
    assert shifted(values, 2) == 2.0
    assert shifted(values, 0.5) == 2.5


def test_one_line_tells_that_something_is_compiled_and_none_that_it_is_there(capsys):
    @numba.njit
    def more(x):
        return x + 1

    for expected in ("compiling\n", ""):
        with compiling_told("compiling"):
            more(1.0)
            more(1)
        assert capsys.readouterr().err == expected
