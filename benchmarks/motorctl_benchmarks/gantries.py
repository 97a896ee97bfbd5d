"""Simulated gantries made from the published one: with any number of axes, or a full model."""

from __future__ import annotations

import copy
from typing import Any

from motorctl.config import load, load_resolved
from motorctl.config.machine import MOST_PARAMETERS, Machine

CONFIG = "published_gantry"


def gantry_with(axes: int) -> Machine:
    """Return a machine whose axes are the published X and Y in turn, each with its program."""
    published: dict[str, Any] = copy.deepcopy(dict(load(CONFIG).resolved))
    published["loop"]["without_realtime"] = "degrade"  # a tick as that of a machine of metal
    kinds = list(published["axes"].values())
    programs = published["programs"]
    many: dict[str, Any] = {**published, "name": f"gantry-of-{axes}", "axes": {}, "programs": {}}
    for k in range(axes):
        kind = copy.deepcopy(kinds[k % len(kinds)])
        program = copy.deepcopy(programs[kind["program"]])
        name = f"a{k}"
        many["axes"][name] = kind | {"channel": k, "program": f"move_{name}"}
        many["programs"][f"move_{name}"] = program | {"axis": name}
    return load_resolved(many, many["name"], hardware=True)


def gantry_with_full_models() -> Machine:
    """Return the published gantry whose axes have as many parameters as a model may have."""
    data: dict[str, Any] = copy.deepcopy(dict(load(CONFIG).resolved))
    data["loop"]["without_realtime"] = "degrade"
    for axis in data["axes"].values():
        low_m, high_m = axis["limits"]["travel_m"]
        left = MOST_PARAMETERS - len(axis["model"])
        # All splines together are the offset, or Coulomb's friction: one is no parameter.
        parts = {"position_force": left // 2, "position_dependent_friction": left - left // 2}
        for effect, count in parts.items():
            axis["model"][effect] = {"knots": [low_m, high_m, count + 1]}
    return load_resolved(data, "full models", hardware=True)
