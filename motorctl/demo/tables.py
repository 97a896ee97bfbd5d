"""The published tables beside ours."""

from __future__ import annotations

from motorctl.insight.compare import Comparison, ratios
from motorctl.insight.measures import table_cells
from motorctl.insight.published import TABLES


def published_beside_ours(comparison: Comparison, axis: str) -> list[tuple[str, list[str]]]:
    """Give the rows of one axis' table: name and cells, in µm and V."""
    ours = {run.label: run.axes[axis].measures for run in comparison.runs}
    rows = []
    for whose, table in (("published", TABLES[axis]), ("simulated", ours)):
        rows += [(f"{whose} {name}", table_cells(measures)) for name, measures in table.items()]
        ratio = ratios(table["C1"], table["C2"])
        rows.append((f"{whose} C1 / C2", [f"{value:.2f}" for value in ratio.values()]))
    return rows


def verdict(comparison: Comparison) -> str:
    """Put the outcome into one sentence."""
    parts = []
    for axis in comparison.axes:
        first, second = (run.axes[axis].measures for run in comparison.runs)
        parts.append(f"{ratios(first, second)['eF']:.2f} times smaller on {axis}")
    return (
        "Compensating the motor's electromagnetic nonlinearity (C2) makes the final tracking "
        f"error {' and '.join(parts)} than without (C1)."
    )
