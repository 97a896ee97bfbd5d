"""Toy effects as packages that are installed beside motorctl, and what a plant has of each."""

from __future__ import annotations

import shutil
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import toy_plant
import yaml
from fit_plant import Run
from toy_plant import CORE, CREEP, CURRENT, HALVES, JOINT, KNEE, MAGNET, ZONE

HERE = Path(__file__).parent
SHIPPED = HERE.parents[1] / "configs" / "published_gantry.yaml"


@dataclass(frozen=True)
class Toy:
    """One effect from outside, and a plant that has it."""

    name: str
    plant: int
    numbers: tuple[float, ...]
    options: dict[str, Any]
    theta: dict[str, float] = field(default_factory=dict)
    """Linear parameters by their full names."""
    bounds: tuple[float, float] | None = None
    rel: float = 0.1
    """How near a fit comes."""

    def declared(self) -> dict[str, Any]:
        """Return what a configuration says of it."""
        return dict(self.options)


TOYS = {
    toy.name: toy
    for toy in (
        Toy("brake_zone", ZONE, (0.4, 0.25, 0.05), {"middle_m": 0.25, "half_length_m": 0.05},
            {"brake_zone": 0.4}),
        Toy("cable_creep", CREEP, (6.0, 0.15), {"relaxation_s": 0.15},
            {"cable_creep_stiffness": 6.0}),
        Toy("push_pull", HALVES, (0.08,), {}, {"push_pull": 0.08}),
        Toy("slow_core", CORE, (0.25, 0.1), {"rise_s": 0.1},
            {"slow_core_share": 0.25}),
        Toy("weak_magnet", MAGNET, (0.25, 0.15, 0.03), {"place_m": 0.15, "width_m": 0.03},
            {"weak_magnet": 0.25}),
        Toy("current_loop", CURRENT, (400.0, 0.3), {"corner_hz": 400.0}),
        Toy("scale_joint", JOINT, (20e-6, 0.18, 3e-3),
            {"place_m": 0.18, "width_m": 3e-3, "shift_m": 20e-6}),
        Toy("iron_knee", KNEE, (0.03, 0.012, 2.5), {"knee_v": 2.5},
            {"iron_knee_push": 0.03, "iron_knee_pull": 0.012}),
    )
}  # fmt: skip
"""One of each kind: state, with memory, input, with memory, that varies, command, measurement,
electromagnetic."""


def install(folder: Path) -> None:
    """Put every toy package into a folder as an installer would: modules and their metadata."""
    for path in sorted(HERE.glob("*/pyproject.toml")):
        project = tomllib.loads(path.read_text())["project"]
        for module in path.parent.glob("*.py"):
            shutil.copy(module, folder)
        info = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
        info.mkdir()
        name, version = project["name"], project["version"]
        info.joinpath("METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
        )
        lines = [
            f"[{group}]\n" + "".join(f"{key} = {value}\n" for key, value in entries.items())
            for group, entries in project["entry-points"].items()
        ]
        info.joinpath("entry_points.txt").write_text("\n".join(lines))


def configuration(path: Path, toy: Toy | None = None) -> Path:
    """Write the configuration of one published axis, with a toy effect declared or without."""
    data = yaml.safe_load(SHIPPED.read_text())
    del data["axes"]["y"]
    axis = data["axes"]["x"]
    for name in ("em_quadratic", "em_cubic"):
        del axis["model"][name]
    if toy is not None:
        axis["model"][toy.name] = toy.declared()
    data["programs"] = {axis["program"]: data["programs"][axis["program"]]}
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    return path


def record(path: Path, toy: Toy | None, *, duration_s: float = 16.0, seed: int = 1) -> Path:
    """Write a foreign recording of a plant that has a toy effect, or of one that has none."""
    if toy is None:
        run = toy_plant.run(toy_plant.NOTHING, duration_s=duration_s, seed=seed)
    else:
        run = toy_plant.run(toy.plant, toy.numbers, duration_s=duration_s, seed=seed)
    return save(path, run)


def save(path: Path, run: Run) -> Path:
    """Write a run as the columns of a recording."""
    names = "time_s,x.position_m,x.command_v,x.reference_m,x.reference_velocity_m_s"
    columns = (run.time_s, run.position, run.command, run.reference, run.reference_velocity)
    np.savetxt(path, np.column_stack(columns), "%.9g", ",", header=names, comments="")
    return path
