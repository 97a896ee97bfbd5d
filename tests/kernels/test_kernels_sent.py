"""A compiled kernel is sent to another process, and runs there without its module."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from motorctl.errors import RunError
from motorctl.kernels import load_generated, packed, source_digest, unpacked

RECORD = np.dtype([("gain", "f8"), ("count", "i8")], align=True)

SOURCE = '''"""A kernel that is sent. Generated; do not edit."""

from numba import njit


@njit(cache=True, error_model='numpy')
def weighed(records, numbers, factor):
    total = 0.0
    for k in range(numbers.size):
        total += numbers[k] * records[k].gain
        records[k].count += 1
    if factor < 0:
        raise ValueError("a factor is below zero")
    return factor * total
'''

THERE = """
import pickle, sys
import numpy as np
from motorctl.kernels import unpacked
sent, *given = pickle.load(sys.stdin.buffer)
called = unpacked(sent, *given)
result = called(*given)
assert unpacked(sent, *given) is called
assert not any("weighed" in name for name in sys.modules), "its module was imported"
try:
    called(*given[:2], -1.0)
    told = ""
except ValueError as error:
    told = str(error)
sys.stdout.buffer.write(pickle.dumps((result, given[0]["count"].tolist(), told)))
"""


AGAIN = """
import pickle, sys
from pathlib import Path
from motorctl.kernels import load_generated, packed
name, source, *given = pickle.load(sys.stdin.buffer)
kernel = load_generated(name, source).weighed
sent = packed(kernel, *given)
assert kernel.stats.cache_hits, "it was not loaded"
for file in Path(kernel.stats.cache_path).iterdir():
    file.unlink()
sys.stdout.buffer.write(pickle.dumps((sent, packed(kernel, *given))))
"""


def kernel() -> Any:
    return load_generated(f"weighed_{source_digest(SOURCE)}", SOURCE).weighed


def arguments() -> tuple[Any, ...]:
    records = np.zeros(3, RECORD)
    records["gain"] = 1.0, 10.0, 100.0
    return records, np.array([1.0, 2.0, 3.0]), 2.0


def test_it_gives_the_same_there_and_nothing_of_its_module_is_needed(tmp_path: Path) -> None:
    sent = packed(kernel(), *arguments())
    done = subprocess.run(
        [sys.executable, "-c", THERE],
        input=pickle.dumps((sent, *arguments())),
        capture_output=True,
        check=False,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr.decode()
    assert pickle.loads(done.stdout) == (642.0, [2, 2, 2], "a factor is below zero")


def test_it_is_sent_from_the_cache_as_well_as_when_it_was_just_compiled() -> None:
    first = packed(kernel(), *arguments())
    assert packed(kernel(), *arguments()) == first


def test_it_is_sent_also_when_another_process_has_removed_it_from_the_cache(tmp_path: Path) -> None:
    source = SOURCE.replace("below zero", "below nought")
    name = f"weighed_{source_digest(source)}"
    packed(load_generated(name, source).weighed, *arguments())
    done = subprocess.run(
        [sys.executable, "-c", AGAIN],
        input=pickle.dumps((name, source, *arguments())),
        capture_output=True,
        check=False,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr.decode()
    for sent in pickle.loads(done.stdout):
        assert unpacked(sent, *arguments())(*arguments()) == 642.0


def test_where_it_was_compiled_it_is_what_runs_already() -> None:
    sent = packed(kernel(), *arguments())
    assert unpacked(sent, *arguments())(*arguments()) == 642.0


@pytest.mark.parametrize(
    "other",
    [
        np.zeros(3, np.dtype([("count", "i8"), ("gain", "f8")], align=True)),
        np.zeros((3, 1), RECORD),
        np.zeros(3),
    ],
    ids=["fields", "dimensions", "numbers"],
)
def test_other_records_are_refused(other: Any) -> None:
    sent = packed(kernel(), *arguments())
    with pytest.raises(RunError, match=r"other records than these: .* restart it"):
        unpacked(sent, other, *arguments()[1:])
