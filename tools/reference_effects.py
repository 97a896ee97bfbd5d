"""The reference page of effects, from what each effect's own file says of it."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator

from curve_picture import picture
from effect_curves import curves_of, form_drawn
from formula_tex import formula_tex

from motorctl.model import Effect
from motorctl.model.catalog import basic_effects, built_in_effects
from motorctl.model.effect import EffectOptions

KINDS = {
    "state": "a force that depends on the motion: its formula is what it asks of the command",
    "input": "what becomes of the command on its way to a force, the map v(u)",
    "command": "what happens to the command before it acts",
    "measurement": "an error of the measured position",
}


PICTURES = "effects"
"""The folder of the pictures, beside the page."""
MOST_COLUMNS = 4
"""Columns of a log that are told one by one. Only looks depend on it. Chosen by hand."""


def effect_pictures() -> dict[str, str]:
    """Return the picture of each built-in effect, as SVG, by the name of its file."""
    return {
        f"{cls.name}.svg": picture(f"{cls.title}: {cls.formula}", curves_of(cls))
        for cls in ordered()
    }


def effects_page(made_by: str) -> str:
    """Return every built-in effect: a table of all, then each with its formula.

    Parameters
    ----------
    made_by
        The line that says what made the page.
    """
    lines = [
        "# Every effect",
        "",
        made_by,
        "",
        "An axis' model is a list of effects, in volts of command. x, v and a are position, "
        "velocity and acceleration, u the command, t the time; Sf is a smooth sign. Units are "
        "those of a linear axis; of a rotary one read rad for m.",
        "",
        *(f"- {_a(kind).capitalize()} effect: {words}." for kind, words in KINDS.items()),
        "",
        "The first six make the controllers' own models (C1: the first four); all others may be "
        "added to any axis. `motorctl check --all` tells whether the controller's conditions still "
        "hold, and which effects they leave out. [How to write one](../own_effect.md).",
        "",
        "The curves are drawn by the kernels that the loop runs. Of a *state* effect they show "
        "what it asks of the command, each parameter's to the same height, and say how high that "
        "is; of an *input* effect the command that acts, with a parameter that makes it plain to "
        "see.",
        "",
        "| effect | what it is | how it is compensated |",
        "|---|---|---|",
    ]
    lines += [
        f"| [`{cls.name}`](#{cls.name}) | {cls.title} | {cls.compensated} |" for cls in ordered()
    ]
    for cls in ordered():
        lines += ["", *_section(cls)]
    return "\n".join(lines) + "\n"


def ordered() -> list[type[Effect]]:
    """Return the built-in effects: the basic ones first, then magnetic saturation, then others."""
    every = [*built_in_effects().values()]
    basic = [*basic_effects().values()]
    electromagnetic = sorted((c for c in every if c.electromagnetic), key=lambda c: -len(c.name))
    named = sorted((c for c in every if c not in basic + electromagnetic), key=lambda c: c.name)
    return [*basic, *electromagnetic, *named]


def _section(cls: type[Effect]) -> Iterator[str]:
    yield from (f"## {cls.name}", "")
    yield f"{cls.title}, {_a(cls.kind)} effect."
    yield from ("", "$$", formula_tex(cls.formula), "$$", "")
    for paragraph in (inspect.getdoc(cls) or "").split("\n\n"):
        if _letters(paragraph) in _letters(cls.formula):
            continue  # said by the formula
        yield from (" ".join(paragraph.split()).replace("*", "\\*"), "")
    yield from (f"![{cls.title}]({PICTURES}/{cls.name}.svg)", "")
    yield from _drawn(cls)
    yield f"- Identified: {cls.identified}."
    yield f"- Compensated: {cls.compensated}."
    yield f"- Shows in: {cls.visible_in}."
    if options := _own_options(cls):
        names = ", ".join(f"`{name}`" for name in options)
        yield f"- Nonlinear: {names} ([keys](keys.md#axesnamemodel{cls.name}))."


def _drawn(cls: type[Effect]) -> Iterator[str]:
    """Yield the parameters of the form that is drawn, as a log has them, and its options."""
    form = form_drawn(cls)
    columns = [f"`theta_hat_{form.full_name(p)}`: {p.symbol} [{p.unit}]" for p in form.parameters]
    if len(columns) > MOST_COLUMNS:
        columns = [columns[0], "…", columns[-1]]
    if columns:
        yield f"- In a log: {', '.join(columns)}."
    options = form.options.model_dump(exclude_none=True)
    told = [f"`{name}` {_value(options[name])}" for name in _own_options(cls) if name in options]
    if told:
        yield f"- Drawn with {', '.join(told)}."


def _value(value: object) -> str:
    if isinstance(value, list | tuple):
        return f"({', '.join(map(_value, value))})"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _a(kind: str) -> str:
    return f"{'an' if kind[0] in 'aeiou' else 'a'} *{kind}*"


def _letters(text: str) -> str:
    return re.sub(r"[\s.*]", "", text)


def _own_options(cls: type[Effect]) -> list[str]:
    return [name for name in cls.Options.model_fields if name not in EffectOptions.model_fields]
