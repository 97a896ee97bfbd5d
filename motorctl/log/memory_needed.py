"""Whether a recording fits into memory, asked before it is read rather than found out."""

from __future__ import annotations

from pathlib import Path

from motorctl.errors import DataError

_MEMINFO = Path("/proc/meminfo")
_GIGABYTE = 1e9


def require_memory(path: Path, rows: int, columns: int) -> None:
    """Raise DataError where columns of float64 do not fit into the memory that is free."""
    needed, free = 8 * rows * columns, _available_bytes()
    if free is not None and needed > free:
        raise DataError(
            f"{path}: {rows} rows of {columns} columns take {needed / _GIGABYTE:.1f} GB of memory, "
            f"of which {free / _GIGABYTE:.1f} GB are free: give fewer parts of the run; minutes "
            "are enough for an analysis"
        )


def _available_bytes() -> int | None:
    """Return how much memory the kernel says could be had; None where it does not tell."""
    try:
        for line in _MEMINFO.read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return 1024 * int(line.split()[1])
    except (OSError, ValueError, IndexError):
        pass
    return None
