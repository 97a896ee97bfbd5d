"""Between which bounds each estimate of a log may lie, as its configuration says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from motorctl.log.columns import THETA


def estimate_bounds(config: Mapping[str, Any]) -> dict[str, list[float]]:
    """Return lower and upper bound by the column of the estimate.

    Parameters
    ----------
    config
        The configuration as the log's metadata has it; what cannot be read is left out.
    """
    found: dict[str, list[float]] = {}
    for name, axis in _mapping(config.get("axes")).items():
        keys = _mapping(axis)
        for effect, part in _mapping(keys.get("model")).items():
            own = _mapping(part)
            named = _mapping(own.get("parameters"))
            for parameter, values in named.items():
                _add(found, f"{name}.{THETA}_{effect}_{parameter}", _mapping(values).get("bounds"))
            _add(found, f"{name}.{THETA}_{effect}", own.get("bounds"))
        most_v = _mapping(keys.get("gains")).get("d_hat_max_v")
        if isinstance(most_v, int | float):
            _add(found, f"{name}.d0_hat_v", [-most_v, most_v])
    return found


def _add(found: dict[str, list[float]], column: str, bounds: object) -> None:
    if isinstance(bounds, list) and len(bounds) == 2:
        low, high = bounds
        if isinstance(low, int | float) and isinstance(high, int | float):
            found[column] = [float(low), float(high)]


def _mapping(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}
