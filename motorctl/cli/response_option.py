"""The option `--response` of commands that a measured response serves."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the analysis takes long to import: the command does so when it runs
    from motorctl.response.measurement import Measurement


def response_from(
    logs: list[Path] | None, axis: str, progress: Callable[[str, float], None]
) -> Measurement | None:
    """Return the response that logs of `motorctl response` tell of an axis; None without any."""
    if not logs:
        return None
    from motorctl.response.measurement import measure_response

    progress("reading the response from its log", 0.0)
    return measure_response(logs, axis)
