"""Docstrings of attributes as they are: napoleon takes what stands before a colon for a type."""

from __future__ import annotations

from typing import Any

from sphinx.application import Sphinx

BEFORE_NAPOLEON, AFTER_NAPOLEON = 499, 501


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    kept: dict[str, list[str]] = {}

    def keep(_: Sphinx, what: str, name: str, *rest: Any) -> None:
        if what in {"attribute", "property"}:
            kept[name] = list(rest[-1])

    def restore(_: Sphinx, what: str, name: str, *rest: Any) -> None:
        if name in kept:
            rest[-1][:] = kept.pop(name)

    app.connect("autodoc-process-docstring", keep, priority=BEFORE_NAPOLEON)
    app.connect("autodoc-process-docstring", restore, priority=AFTER_NAPOLEON)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
