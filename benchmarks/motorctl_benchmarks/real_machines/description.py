"""The description that a user would write for a recorded axis, beside its columns as text."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from motorctl_benchmarks.real_machines.readers import Columns
from motorctl_benchmarks.real_machines.real_axis import RealAxis


def described(axis: RealAxis, columns: Columns, folder: Path) -> Path:
    """Write columns with the times that were recorded, and their description; return its path."""
    rows = np.column_stack(list(columns.values()))
    np.savetxt(folder / "r.csv", rows, delimiter=",", header=",".join(columns), comments="")
    text = "file: r.csv\ntime: {column: time_s}\naxes:\n  x:\n"
    if "position" in columns:
        text += f"    position: {{column: position, unit: {axis.position_unit}}}\n"
    else:
        text += f"    velocity: {{column: velocity, unit: {axis.position_unit}/s}}\n"
    text += f"    command: {{column: command, unit: '{axis.unit}', scale: {axis.scale}}}\n"
    if "reference" in columns:
        text += f"    reference: {{column: reference, unit: {axis.position_unit}}}\n"
    path = folder / "r.yaml"
    path.write_text(text)
    return path
