"""Pictures of the parameter estimates over time."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from motorctl.identify.compare.runs import ComparedRun, Comparison
from motorctl.log import AxisRecording
from motorctl.model import known_effects, make_effect
from motorctl.picture_style import colour, draw_curve, panels_in_file

SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")


def plot_estimates(comparison: Comparison, axis: str, path: Path) -> Path:
    """Draw every parameter's estimate over time, with its bounds where the log tells them."""
    names = list(
        dict.fromkeys(n for run in comparison.runs for n in run.recording.axes[axis].theta_hat)
    )
    columns = 2 if len(names) > 1 else 1
    rows = -(-len(names) // columns)
    with panels_in_file(rows, path, height=1.6, columns=columns) as (figure, panels):
        for panel, name in zip(panels, names, strict=False):
            for k, run in enumerate(comparison.runs):
                estimate = run.recording.axes[axis].theta_hat.get(name)
                if estimate is not None:
                    taken = run.axes[axis].rows
                    time_s = run.recording.time_s[taken] - run.recording.time_s[taken.start]
                    draw_curve(panel, time_s, estimate[taken], colour(k))
            for bound in sorted({b for run in comparison.runs for b in _bounds(run, axis, name)}):
                panel.axhline(bound, color="black", lw=0.8, ls=(0, (4, 3)))
            panel.set_title(_title(comparison.runs, axis, name), loc="left", fontsize=9)
        for panel in panels[len(names) :]:
            panel.set_visible(False)
        for panel in panels[max(len(names) - columns, 0) : len(names)]:
            panel.set_xlabel("time [s]")
            panel.tick_params(labelbottom=True)
        handles = [
            panels[0].plot([], [], color=colour(k), lw=1.5, label=run.label)[0]
            for k, run in enumerate(comparison.runs)
        ]
        figure.legend(handles=handles, loc="outside upper right", ncols=len(handles), frameon=False)
        figure.suptitle(f"Parameter estimates, axis {axis} (dashed: bounds)", x=0.01, ha="left")
    return path


def _model(run: ComparedRun, axis: str) -> Mapping[str, Any]:
    """Return the model of an axis as the log's configuration has it."""
    try:
        model = run.recording.metadata["config"]["axes"][axis]["model"]
    except (KeyError, TypeError):
        return {}
    return model if isinstance(model, Mapping) else {}


def _bounds(run: ComparedRun, axis: str, name: str) -> list[float]:
    for effect, described in _model(run, axis).items():
        if not isinstance(described, Mapping):
            continue
        part = described
        if name != effect and name.startswith(f"{effect}_"):
            part = (described.get("parameters") or {}).get(name.removeprefix(f"{effect}_"), {})
        elif name != effect:
            continue
        bounds = part.get("bounds") if isinstance(part, Mapping) else None
        if isinstance(bounds, list):
            return [float(bound) for bound in bounds if np.isfinite(float(bound))]
    return []


def _title(runs: tuple[ComparedRun, ...], axis: str, name: str) -> str:
    """Name a parameter by its effect's own words, with symbol and unit; else by its column."""
    record = runs[0].recording.axes[axis]
    for run in runs:
        for effect_name, cls in known_effects().items():
            if name != effect_name and not name.startswith(f"{effect_name}_"):
                continue
            described = _model(run, axis).get(effect_name) or {}
            options = {k: v for k, v in described.items() if k in cls.Options.model_fields}
            try:
                effect = make_effect(cls, options)
            except ValidationError:
                continue
            for parameter in effect.parameters:
                if effect.full_name(parameter) == name:
                    words = f"{effect.title} {parameter.name}".strip()
                    return f"{_symbol(parameter.symbol)}{words} [{_unit(record, parameter.unit)}]"
    return name.replace("_", " ")


def _symbol(symbol: str) -> str:
    found = re.fullmatch(r"theta(\d+)", symbol)
    return f"θ\N{COMBINING CIRCUMFLEX ACCENT}{found[1].translate(SUBSCRIPTS)}  " if found else ""


def _unit(record: AxisRecording, unit: str) -> str:
    return record.unit(unit).replace("^2", "²").replace("^3", "³").replace("*", " ")
