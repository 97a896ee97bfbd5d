"""What is imported with the package: nothing that is not asked for."""

from __future__ import annotations

import subprocess
import sys

import pytest

import motorctl


def loaded(code: str) -> set[str]:
    """Return the modules that an interpreter has after some code."""
    command = [sys.executable, "-c", f"{code}\nimport sys; print(*sys.modules)"]
    return set(subprocess.run(command, check=True, capture_output=True, text=True).stdout.split())


def test_the_package_is_imported_without_a_library() -> None:
    modules = loaded("import motorctl")
    assert not {name for name in modules if name.startswith("motorctl.")}
    assert "numpy" not in modules


def test_help_is_shown_without_the_api() -> None:
    code = "import sys; sys.argv = ['motorctl', '--help']\nimport motorctl.cli as c, contextlib, io"
    code += "\nwith contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):"
    code += " c.main()"
    modules = loaded(code)
    assert "motorctl.cli.fit" in modules
    assert not {name for name in modules if name.startswith(("motorctl.api", "numpy", "numba"))}


def test_every_public_name_is_there_and_no_other() -> None:
    for name in motorctl.__all__:
        assert getattr(motorctl, name).__doc__
    assert set(motorctl.__all__) < set(dir(motorctl))
    assert motorctl.__version__
    with pytest.raises(AttributeError, match="no attribute 'diagnoze'"):
        motorctl.diagnoze  # type: ignore[attr-defined] # noqa: B018
