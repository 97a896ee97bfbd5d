"""What devices tell of themselves, for a configuration that begins with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from motorctl.errors import RunError, UsageError
from motorctl.hal import FoundAxis, driver_class
from motorctl.init.known import driver_key
from motorctl.init.told import USUAL_NAMES, AxisTold


@dataclass(frozen=True)
class Looked:
    """What a driver's devices told."""

    axes: Mapping[str, FoundAxis]
    """By a name: the device's own, or a usual one."""
    options: Mapping[str, Any] | None
    """Those that describe what was found; None: those that every configuration begins with."""

    @property
    def names(self) -> list[str]:
        """Return a name for each axis that was found."""
        return list(self.axes)

    @property
    def lines(self) -> Iterator[str]:
        """Yield what was found of each channel, a line each."""
        for name, axis in self.axes.items():
            told = [f"channel {axis.channel}, axis {name}"]
            if axis.inertia_v_s2_m is not None:
                told.append(f"inertia {axis.inertia_v_s2_m:g} V*s^2/m")
            if axis.travel_m is not None:
                told.append(f"travel {axis.travel_m[0]:g}..{axis.travel_m[1]:g} m")
            if axis.homing is not None:
                told.append(f"homing {axis.homing}")
            yield ", ".join([*told, *axis.remarks])

    def tell(self, axes: Sequence[AxisTold]) -> None:
        """Let a driver's axes know what their devices told: those of their names, else in order.

        Raises UsageError where there are too few, or one would be two axes.
        """
        owners: dict[int, str] = {}
        for axis in axes:
            found = self._of(axis)
            owner = owners.setdefault(found.channel, axis.name)
            if owner != axis.name:
                there = ", ".join(f"{name} on {each.channel}" for name, each in self.axes.items())
                raise UsageError(
                    f"axes {owner} and {axis.name}: both would be channel {found.channel} of "
                    f"driver {axis.driver}, one by its name and one by its place; found: {there}: "
                    "name all axes as they were found, or none of them"
                )
            axis.take(found)

    def _of(self, axis: AxisTold) -> FoundAxis:
        found = self.axes.get(axis.name)
        if found is not None:
            return found
        left = list(self.axes.values())
        if axis.channel >= len(left):
            raise UsageError(
                f"axis {axis.name}: driver {axis.driver} found {len(left)} channels, and this "
                f"is its {axis.channel + 1}th axis"
            )
        return left[axis.channel]


def look(driver: str, options: Mapping[str, Any]) -> Looked:
    """Ask a driver what is there.

    Parameters
    ----------
    driver
        Its type.
    options
        What was told of it, such as the bus to look at.

    Raises
    ------
    UsageError
        Where it has no way to tell.
    RunError
        Where nothing answers.
    """
    cls = driver_class(driver)
    try:
        found = cls.look(options)
    except NotImplementedError as error:
        raise UsageError(
            f"--from devices: devices of driver {driver} have no way to tell what they are; leave "
            "it out, and tell as options what is known"
        ) from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, (driver_key(driver), *first["loc"])))
        raise UsageError(f"--driver-option {where}: {first['msg']}") from error
    if not found.axes:
        raise RunError(f"--from devices: driver {driver} found nothing")
    names = [*USUAL_NAMES, *(f"axis{number}" for number in range(len(found.axes)))]
    axes = {axis.name or name: axis for axis, name in zip(found.axes, names, strict=False)}
    return Looked(axes, found.options)
