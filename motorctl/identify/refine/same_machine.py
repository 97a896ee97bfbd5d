"""Whether a configuration can be refined from a recording."""

from __future__ import annotations

from collections.abc import Iterable

from motorctl.config.machine import Machine
from motorctl.errors import DataError, UsageError
from motorctl.identify.columns.measured import measured
from motorctl.identify.same_axis import against
from motorctl.log import Recording


def require_same_machine(recording: Recording, machine: Machine, axes: Iterable[str]) -> None:
    """Raise where `recording` cannot be of this machine, with all that speaks against it.

    UsageError where an axis is in other units than a configuration, DataError for axes that the
    machine lacks, another encoder, positions beyond the travel, commands beyond the voltage.
    """
    problems = []
    for name in axes:
        if name not in machine.axes:
            known = ", ".join(machine.axes)
            problems.append(f"axis '{name}' is not in the configuration, which has: {known}")
            continue
        data = measured(recording, name)
        if (data.position_unit, data.command_unit) != ("m", "V"):
            raise UsageError(
                f"{data.place} is in {data.position_unit} and {data.command_unit}; a configuration "
                "is in m and V, so nothing of it can be refined from this recording"
            )
        problems += [f"axis {name}: {words}" for words in against(data, machine.axes[name])]
    if problems:
        listed = "".join(f"\n  {problem}" for problem in problems)
        raise DataError(
            f"{recording.source} is not a recording of the machine in {machine.source}:{listed}"
        )
