"""Every function that a package exports says what it takes, returns and raises."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("motorctl", "drivers", "devices")
NOTHING = ("None", None, type(None))


def _exported() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Yield every function of the packages' ``__all__``, by the name that it is imported under."""
    for folder in FOLDERS:
        base = ROOT if folder == "motorctl" else ROOT / folder
        for path in sorted((ROOT / folder).rglob("__init__.py")):
            if "__all__" not in path.read_text(encoding="utf-8"):
                continue
            package = ".".join(path.parent.relative_to(base).parts)
            module = importlib.import_module(package)
            for name in module.__all__:
                if inspect.isfunction(function := getattr(module, name)):
                    yield f"{package}.{name}", function


def _section(text: str, title: str) -> str:
    """Return what stands under a heading of numpydoc's; nothing where there is none."""
    found = re.search(rf"^{title}\n-{{{len(title)}}}\n(.+?)(?=^\w+\n-+\n|\Z)", text, re.M | re.S)
    return found[1] if found else ""


def _missing(function: Callable[..., Any]) -> list[str]:
    """Return what the docstring of a function leaves out."""
    text = inspect.getdoc(function) or ""
    signature = inspect.signature(function)
    told = re.findall(r"^[*\w]+(?:, [*\w]+)*(?= :|$)", _section(text, "Parameters"), re.M)
    names = {name.lstrip("*") for line in told for name in line.split(", ")}
    missing = [name for name in signature.parameters if name not in names]
    missing += [f"{name}, which it does not take" for name in names - {*signature.parameters}]
    returns = _section(text, "Returns") or _section(text, "Yields")
    if signature.return_annotation not in NOTHING and not returns:
        missing.append("what it returns")
    source = textwrap.dedent(inspect.getsource(inspect.unwrap(function)))
    raised = {
        node.exc.func.id
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Raise)
        and isinstance(node.exc, ast.Call)
        and isinstance(node.exc.func, ast.Name)
    }
    return missing + [error for error in raised if error not in _section(text, "Raises")]


@pytest.mark.parametrize(
    "function", [pytest.param(function, id=name) for name, function in _exported()]
)
def test_an_exported_function_tells_parameters_results_and_errors(
    function: Callable[..., Any],
) -> None:
    assert not _missing(function), f"the docstring of {function.__qualname__} lacks these"


def test_what_a_docstring_leaves_out_is_found() -> None:
    def forgetful(speed_m_s: float, *, limit_m_s: float) -> float:
        """Return it.

        Parameters
        ----------
        speed_m_s
            The speed [m/s].
        length_m
            No more taken.
        """
        if speed_m_s > limit_m_s:
            raise ValueError("too fast")
        return speed_m_s

    assert _missing(forgetful) == [
        "limit_m_s",
        "length_m, which it does not take",
        "what it returns",
        "ValueError",
    ]
