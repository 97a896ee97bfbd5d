"""Formulas as MathML, which browsers set themselves: a page needs no script and no font for it."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx

BAR = '<mo stretchy="false">&#x0007C;</mo>'
TIGHT_BAR = '<mo stretchy="false" lspace="0" rspace="0">&#x0007C;</mo>'


def mathml(tex: str, display: str) -> str:
    """Return a formula as MathML; bars stand at what they enclose.

    Parameters
    ----------
    tex
        The formula.
    display
        "inline" or "block".
    """
    return str(convert(tex, display=display)).replace(BAR, TIGHT_BAR)


def inline(translator: Any, node: nodes.math) -> None:
    """Write a formula within a line."""
    translator.body.append(mathml(node.astext(), "inline"))
    raise nodes.SkipNode


def block(translator: Any, node: nodes.math_block) -> None:
    """Write a formula of its own."""
    formula = mathml(node.astext(), "block")
    translator.body.append(f'<div class="formula">{formula}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
