"""What sources say is parsed once, and what is kept of it is used only as it was written."""

import ast
import os
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorctl.kernels.parsed_sources import Import, parsed_folder, said_by_source

SOURCE = b'''"""What pulls."""
from .friction import LEVEL as level
import numpy

def pull(v: float) -> float:
    """Sum up."""
    return numpy.abs(v) * level
'''


@pytest.fixture(autouse=True)
def own_cache(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("CACHE_DIRECTORY", raising=False)
    said_by_source.cache_clear()
    yield
    said_by_source.cache_clear()


def at_next_start(content=SOURCE, package="plant"):
    """Return what a source says to a process that has not read it before."""
    said_by_source.cache_clear()
    return said_by_source(content, package)


def test_a_source_is_parsed_at_the_first_start_alone(monkeypatch):
    first = at_next_start()
    assert first.imports == (
        Import("level", "plant.friction", "LEVEL"),
        Import("numpy", "numpy"),
    )
    assert {"numpy", "level", "v"} <= first.used
    monkeypatch.setattr(ast, "parse", None)
    assert at_next_start() == first


def test_what_is_used_does_not_grow_old():
    at_next_start()
    (kept,) = parsed_folder().iterdir()
    os.utime(kept, (1.0, 1.0))
    at_next_start()
    assert time.time() - kept.stat().st_mtime < 60.0


def test_another_package_or_one_more_character_is_another_source():
    first = at_next_start()
    assert at_next_start(package="other").imports[0].module == "other.friction"
    assert at_next_start(SOURCE.replace(b"abs", b"exp")).digest != first.digest


@given(st.integers(min_value=0), st.binary(max_size=3))
@settings(max_examples=60, deadline=None)
def test_what_is_not_as_it_was_written_is_parsed_anew_and_replaced(place, other):
    first = at_next_start()
    (kept,) = parsed_folder().iterdir()
    whole = kept.read_bytes()
    at = place % len(whole)
    kept.write_bytes(whole[:at] + other)
    assert at_next_start() == first
    assert kept.read_bytes() == whole


def test_a_folder_that_cannot_be_written_costs_nothing_but_time():
    parsed_folder().parent.mkdir(parents=True)
    parsed_folder().write_text("a file where the folder belongs")
    assert at_next_start().hands_on is False
