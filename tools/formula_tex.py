"""An effect's formula, which its file has as plain text, as TeX for a page.

Nothing is known of single effects here: names of Greek letters, indices, functions and derivatives
are set as mathematics does, and words stay words.
"""

from __future__ import annotations

import re

GREEK = {"delta", "mu", "omega", "pi", "sigma", "tau", "theta", "zeta"}
FUNCTIONS = {"arctan", "cos", "exp", "max", "min", "sin"}
OTHER_FUNCTIONS = {"asinh", "clip", "sign"}
RELATIONS = {"*": r"\,", ">=": r"\ge ", "<=": r"\le "}
TOKEN = re.compile(
    r"d[a-z]/d[a-z]\b"  # a derivative
    r"|,  |>=|<=|\d+|[A-Za-z]{2,}'s"
    r"|[A-Za-z]+(?:_[A-Za-z0-9]+|\d+)?"  # with its index
    r"|\s+|."
)


def formula_tex(formula: str) -> str:
    """Return a formula as TeX.

    Parameters
    ----------
    formula
        As an effect's `formula` has it: `F_s * exp(-(|v|/v_s)^d) * Sf(v)`.
    """
    formula = formula.replace("sum over other axes of", "sum_OTHERAXES").replace("sum of ", "sum ")
    tokens = TOKEN.findall(formula)
    told = [_is_word(tokens, i) for i in range(len(tokens))]
    out = ""
    for i, token in enumerate(tokens):
        if told[i]:
            before = " " if i and tokens[i - 1].isspace() else ""
            after = " " if i + 1 < len(tokens) and tokens[i + 1].isspace() else ""
            out += rf"\text{{{before}{token}{after}}}"
        elif token == ",  ":
            out += r",\quad "
        else:
            out += RELATIONS.get(token) or (" " if token.isspace() else _symbol(token))
    out = re.sub(r" \}\s*\\text\{ ?", " ", out)  # words that follow each other
    return re.sub(r" +", " ", out).strip()


def _is_word(tokens: list[str], i: int) -> bool:
    """Return whether a token is English; a single a between words is an article."""
    token = tokens[i]
    if token == "a":
        beside = (*tokens[max(i - 2, 0) : i], *tokens[i + 1 : i + 3])
        around = [t for t in beside if not t.isspace()]
        return len(around) == 2 and all(_is_english(t) for t in around)
    return _is_english(token)


def _is_english(token: str) -> bool:
    known = GREEK | FUNCTIONS | OTHER_FUNCTIONS | {"Sf", "sum"}
    if token.endswith("'s"):
        return True
    differential = len(token) == 2 and token[0] == "d"
    return token.isalpha() and len(token) > 1 and not differential and token not in known


def _symbol(token: str) -> str:
    """Return one symbol, function or derivative."""
    if re.fullmatch(r"d[a-z]/d[a-z]", token):
        above, below = token.split("/")
        return rf"\frac{{d{above[1]}}}{{d{below[1]}}}"
    if token == "sum_OTHERAXES":
        return r"\sum_{\text{other axes}} "
    if not (named := re.fullmatch(r"([A-Za-z]+?)_?([0-9]+|(?<=_)[A-Za-z0-9]+)?", token)):
        return token
    base, index = named[1], named[2] or ""
    if base == "sum":
        return rf"\sum_{index} " if index else r"\sum "
    if base in GREEK or base in FUNCTIONS:
        base = f"\\{base} "
    elif base in OTHER_FUNCTIONS:
        base = rf"\operatorname{{{base}}}"
    elif base == "Sf":
        base = r"\mathrm{Sf}"
    if len(index) > 2:
        index = rf"\mathrm{{{index}}}"
    return f"{base.strip()}_{{{index}}}" if index else base
