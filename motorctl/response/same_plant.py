"""Whether a measured response can be that of the axis whose loop is to be chosen by it."""

from __future__ import annotations

from motorctl.config.machine import Machine
from motorctl.errors import DataError
from motorctl.response.measurement import Measurement


def require_same_plant(measured: Measurement, machine: Machine, name: str) -> None:
    """Insist that a response was measured on this machine, with this encoder.

    Gains, model, limits and adaptation may be others: the plant is the same.

    Parameters
    ----------
    measured
        The response.
    machine
        The configuration for which it is to tell the plant.
    name
        Its axis.

    Raises
    ------
    DataError
        Where it is the response of another machine.
    """
    logged, before, axis = measured.machine, measured.machine.axes[name], machine.axes[name]
    pairs = {
        "name": (logged.name, machine.name),
        f"axes.{name}.encoder.resolution_m": (
            before.encoder.resolution_m,
            axis.encoder.resolution_m,
        ),
        f"axes.{name}.dual_drive": tuple(
            "none" if each.dual_drive is None else "two motors" for each in (before, axis)
        ),
    }
    problems = [f"  {key}: {was}, here {now}" for key, (was, now) in pairs.items() if was != now]
    if problems:
        raise DataError(
            f"{measured.response.source} is not a response of the machine in {machine.source}:\n"
            + "\n".join(problems)
            + "\nmeasure it on this machine"
        )
