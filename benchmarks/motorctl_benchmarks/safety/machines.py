"""The machines of the campaign: shipped configurations, on a gantry that breaks to order."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from motorctl.config import load, load_resolved
from motorctl.config.machine import Machine
from motorctl_benchmarks.buses.transports import merged
from motorctl_benchmarks.safety.faulty_gantry import FaultyGantry

Data = dict[str, Any]

DRIVER_TYPE = f"{FaultyGantry.__module__}:{FaultyGantry.__name__}"


@dataclass(frozen=True)
class Kind:
    """A machine by its key: which configuration, on which plant."""

    config: str
    plant: str
    """Preset of the simulated gantry, with all that real axes have."""
    clean: str | None
    """Preset of the same plant without cogging, lag, delay and noise; None: there is none."""
    homes: bool = False

    @property
    def words(self) -> str:
        """What it is, for the table's legend."""
        machine = load(self.config)
        axes = "one axis, homed" if self.homes else f"{len(machine.axes)} axes"
        return f"`{self.config}`, {axes}, {machine.rate_hz:g} Hz"


KINDS: Mapping[str, Kind] = {
    "gantry": Kind("published_gantry", "published_gantry", "published_gantry_clean"),
    "serial": Kind("serial_gantry", "published_gantry", "published_gantry_clean"),
    "modbus": Kind("modbus_gantry", "published_gantry", "published_gantry_clean"),
    "stage": Kind("small_stage", "small_stage", None, homes=True),
}
"""`serial` and `modbus` are the configurations for these buses with their slower rates, and with
the model standing in for samples that do not come; here the simulated gantry is at the other end.
"""


@cache
def resolved(config: str, controller: str) -> Mapping[str, Any]:
    """Return a shipped configuration as plain data."""
    return load(config, controller).resolved  # type: ignore[arg-type]


def machine_of(
    kind: str,
    controller: str,
    *,
    seed: int,
    sim: Mapping[str, Any],
    axes: Mapping[str, Mapping[str, Any]],
    top: Mapping[str, Any],
    programs: Sequence[str] = (),
    clean: bool = False,
) -> Machine:
    """Return a machine of the campaign, checked as any configuration is.

    Parameters
    ----------
    kind
        A key of KINDS.
    controller
        C1 or C2.
    seed
        Of the simulated gantry's noise.
    sim
        Further options of the simulated gantry.
    axes
        Changes of axes' keys, by axis.
    top
        Changes of the other keys.
    programs
        Those of the configuration that are kept; the campaign mostly orders motions of its own.
    clean
        Take the plant without cogging, lag, delay and noise.
    """
    of = KINDS[kind]
    data: Data = copy.deepcopy(dict(resolved(of.config, controller)))
    data["name"] = f"campaign-{kind}"
    preset = of.clean if clean and of.clean else of.plant
    (name,) = data["drivers"]
    options = {"type": DRIVER_TYPE, "preset": preset, "seed": seed, **sim}
    late = data["drivers"][name].get("late")
    data["drivers"] = {name: options | ({"late": late} if late else {})}
    data["loop"]["without_realtime"] = "degrade"  # a machine of metal waits for no computer
    data = merged(data, top)
    data["programs"] = {name: data["programs"][name] for name in programs}
    for keys in data["axes"].values():
        keys["program"] = None
    for axis, change in axes.items():
        data["axes"][axis] = merged(data["axes"][axis], change)
    return load_resolved(data, data["name"], hardware=True)
