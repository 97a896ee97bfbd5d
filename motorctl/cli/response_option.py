"""The option `--response` of commands that a measured response serves."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the analysis takes long to import: the command does so when it runs
    from motorctl.config import Machine
    from motorctl.response.measurement import Measurement


def response_from(
    logs: list[Path] | None, machine: Machine, axis: str, progress: Callable[[str, float], None]
) -> Measurement | None:
    """Return the response that logs of `motorctl response` tell of an axis; None without any.

    Raises DataError where it is that of another machine.
    """
    if not logs:
        return None
    from motorctl.response.measurement import measure_response
    from motorctl.response.same_plant import require_same_plant

    progress("reading the response from its log", 0.0)
    measured = measure_response(logs, axis)
    require_same_plant(measured, machine, axis)
    return measured
