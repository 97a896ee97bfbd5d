"""Simulated gantries with any number of axes, made from the published one."""

from __future__ import annotations

import copy
from typing import Any

from motorctl.config import load, load_resolved
from motorctl.config.machine import Machine

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
