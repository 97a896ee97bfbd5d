"""What installed packages register in a group of entry points, by name."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points


def registered(group: str) -> Mapping[str, EntryPoint]:
    """Return the entry points of a group by their names; looked up once for each `sys.path`."""
    return _registered(group, tuple(sys.path))


@cache
def _registered(group: str, _path: tuple[str, ...]) -> Mapping[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=group)}
