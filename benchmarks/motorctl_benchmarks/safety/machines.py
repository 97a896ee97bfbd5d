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
    number: int
    """Which draws its hours without a fault have; it stays as it is when a machine comes."""
    plant: str | None
    """Preset of the simulated gantry, with all that real axes have; None: the configuration's own
    plants and beams."""
    clean: str | None
    """Preset of the same plant without cogging, lag, delay and noise; None: there is none, or the
    configuration's own without them."""
    near_home_m: Mapping[int, float] | None = None
    """Where the carriages stand at power-on so that homing is short, by channel; None: the axes
    need no homing."""

    @property
    def homes(self) -> bool:
        """Whether the axes have to be homed."""
        return self.near_home_m is not None

    @property
    def words(self) -> str:
        """What it is, for the table's legend."""
        machine = load(self.config)
        ends = ", two motors on a beam" if self.plant is None else ""
        axes = f"one axis, homed{ends}" if self.homes else f"{len(machine.axes)} axes"
        return f"`{self.config}`, {axes}, {machine.rate_hz:g} Hz"


KINDS: Mapping[str, Kind] = {
    "gantry": Kind("published_gantry", 0, "published_gantry", "published_gantry_clean"),
    "serial": Kind("serial_gantry", 2, "published_gantry", "published_gantry_clean"),
    "modbus": Kind("modbus_gantry", 1, "published_gantry", "published_gantry_clean"),
    "can": Kind("can_gantry", 5, "published_gantry", "published_gantry_clean"),
    "stage": Kind("small_stage", 3, "small_stage", None, {0: -0.07}),
    "dual": Kind("dual_gantry", 4, None, None, {0: -0.075, 1: -0.0753}),
}
"""`serial`, `modbus` and `can` are the configurations for these buses with their slower rates, and
with the model standing in for samples that do not come; here the simulated gantry is at the other
end. The counters of `can` have 24 bits."""

IDEAL: Data = {
    "cogging": None,
    "presliding": None,
    "input_lag": None,
    "input_delay": None,
    "force_noise_rms_v": 0.0,
    "amplifier": {"resolution_bits": None},
}
"""Of a plant whose acceleration is known by its masses, its friction and its forces."""


@cache
def resolved(config: str, controller: str) -> Mapping[str, Any]:
    """Return a shipped configuration as plain data."""
    return load(config, controller).resolved  # type: ignore[arg-type]


def plant_options(kind: str, *, clean: bool) -> Data:
    """Return the simulated gantry's options for a machine, without noise and faults.

    clean takes the plant without cogging, lag, delay and noise, where there is one.
    """
    of = KINDS[kind]
    if of.plant is not None:
        return {"preset": of.clean if clean and of.clean else of.plant}
    (driver,) = resolved(of.config, "C2")["drivers"].values()
    plants = {int(channel): dict(plant) for channel, plant in driver["plants"].items()}
    if clean:
        plants = {channel: merged(plant, IDEAL) for channel, plant in plants.items()}
    return {"preset": driver["preset"], "plants": plants, "beams": driver["beams"]}


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
    (name,) = data["drivers"]
    plant = merged(plant_options(kind, clean=clean), sim)
    options = {"type": DRIVER_TYPE, "seed": seed, **plant}
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
