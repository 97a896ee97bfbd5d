"""Toy effects with one change to their source: what a beginner might get wrong."""

from __future__ import annotations

import importlib.util
import itertools
import sys
from pathlib import Path

from motorctl.model import Effect, effect_class, make_effect

TOYS = Path(__file__).parents[1] / "toy_effects"
OPTIONS = {
    "brake_zone": {"middle_m": 0.25, "half_length_m": 0.05},
    "cable_creep": {"relaxation_s": 0.15},
    "push_pull": {},
    "slow_core": {"rise_s": 0.1},
    "weak_magnet": {"place_m": 0.15, "width_m": 0.03},
    "current_loop": {"corner_hz": 400.0},
    "scale_joint": {"place_m": 0.18, "width_m": 3e-3, "shift_m": 2e-5},
    "iron_knee": {"knee_v": 2.5},
}
"""Options of one form of each."""
NUMBERS = itertools.count()


def class_of(name: str) -> str:
    """Return the name of a toy effect's class."""
    return "".join(word.capitalize() for word in name.split("_"))


def toy_effect(name: str, **options: object) -> Effect:
    """Make a toy effect as it is, known by the name of its own module."""
    folder = str(TOYS / name)
    if folder not in sys.path:
        sys.path.append(folder)
    return make_effect(effect_class(name, f"toy_{name}:{class_of(name)}"), options)


def changed(name: str, folder: Path, before: str = "", after: str = "") -> str:
    """Write a toy effect with one change, import it, and return it as package.module:Class."""
    source = (TOYS / name / f"toy_{name}.py").read_text()
    assert before in source, before
    path = folder / f"changed_{name}_{next(NUMBERS)}.py"
    path.write_text(source.replace(before, after) if before else source)
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[path.stem] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return f"{path.stem}:{class_of(name)}"
