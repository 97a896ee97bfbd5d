"""Write the README's table of effects from the effects themselves.

    python tools/effects_table.py           # writes the table between the two marks
    python tools/effects_table.py --check   # exits with 1 where the README is behind

The basic effects come first, then those of the electromagnetic nonlinearity, then all others.
"""

from __future__ import annotations

import sys
from pathlib import Path

from motorctl.model import Effect
from motorctl.model.catalog import basic_effects, built_in_effects

README = Path(__file__).parents[1] / "README.md"
BEGIN = "<!-- effects: made by tools/effects_table.py -->"
END = "<!-- end of effects -->"


def table() -> str:
    """Return the table as Markdown, a row an effect."""
    rows = ["| effect | what it is | how it is compensated |", "|---|---|---|"]
    rows += [f"| `{cls.name}` | {cls.title} | {cls.compensated} |" for cls in ordered()]
    return "\n".join(rows)


def ordered() -> list[type[Effect]]:
    """Return the built-in effects as the table has them."""
    every = [*built_in_effects().values()]
    basic = [*basic_effects().values()]
    electromagnetic = sorted((c for c in every if c.electromagnetic), key=lambda c: -len(c.name))
    named = sorted((c for c in every if c not in basic + electromagnetic), key=lambda c: c.name)
    return [*basic, *electromagnetic, *named]


def with_table(text: str) -> str:
    """Return a page with the table between its marks brought up to date."""
    head, _, rest = text.partition(BEGIN)
    _, found, tail = rest.partition(END)
    if not found:
        raise SystemExit(f"{README.name} has no lines '{BEGIN}' and '{END}' for the table")
    return f"{head}{BEGIN}\n{table()}\n{END}{tail}"


def main(arguments: list[str]) -> int:
    """Write the table, or check it; return the exit status."""
    old = README.read_text(encoding="utf-8")
    new = with_table(old)
    if old == new:
        return 0
    if "--check" in arguments:
        print(f"{README.name}: the table of effects is behind: python tools/effects_table.py")
        return 1
    README.write_text(new, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
