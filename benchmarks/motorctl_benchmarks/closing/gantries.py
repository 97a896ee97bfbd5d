"""The published gantry behind a bus with hidden effects that are drawn, and the same without it."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from motorctl.config import load
from motorctl.config.machine import Machine
from motorctl_benchmarks.buses.machines import CONFIG, device_file, machine_on
from motorctl_benchmarks.buses.transports import AXES, Transport, transports
from motorctl_benchmarks.diagnosis.draw import Draw
from motorctl_benchmarks.diagnosis.known_effects import KNOWN
from motorctl_benchmarks.diagnosis.plants import AxisPlant

Options = dict[str, Any]
Hidden = Mapping[str, Mapping[str, Options]]
"""By axis and effect, as the simulated gantry has them."""

RATES_HZ = {"modbus tcp": 2000.0, "serial poll": 1000.0}
"""The buses, each at the rate of its shipped configuration: half of what it can carry, so that a
computer with other work keeps up."""
CLEAN = "published_gantry_clean"
CONVERTER_BITS = 16
FORCE_NOISE_V = 0.5e-3
CYCLES_S = 20.0
"""The axes' own programs last longer than this: two cycles to learn, two that are judged."""
ENVELOPE: Options = {
    "travel_m": [-0.03, 0.43],
    "max_velocity_share": 0.5,
    "max_acceleration_share": 0.5,
    "max_minutes": 60.0,
}
"""What may be run with nobody there."""
PAUSE_S = 0.15
"""How long the computer may pause until an axis trips: the watchdog of the device, and the ticks
without a sample for which the model predicts. No machine of metal should be let off so long."""
SUPERVISOR_S = 5.0
"""How long the loop goes on without a sign of life from its supervisor: other programs of this
computer may keep that one from running for longer than the usual half second."""
SHOWN = (
    "cogging",
    "force_ripple",
    "stribeck",
    "asymmetric_friction",
    "position_dependent_friction",
    "position_force",
    "quadratic_drag",
    "cross_axis",
)
"""What is drawn from: what a recording at these rates can show and a controller compensate. A lag
or delay of half a millisecond is no longer than a period here."""


@dataclass(frozen=True)
class HiddenGantry:
    """A bus, and what the gantry behind it has that no configuration declares."""

    transport: Transport
    hidden: Hidden

    @property
    def words(self) -> str:
        """Name the effects."""
        return "; ".join(f"{axis}: {', '.join(names)}" for axis, names in self.hidden.items())

    def device(self) -> Options:
        """Return the file of the device at the other end of the bus."""
        file = device_file(self.transport)
        return {**file, "gantry": self._options(0.0), "watchdog_s": 2.0 * PAUSE_S}

    def on_bus(self, drivers: Options, delay_s: float) -> Machine:
        """Return the machine of the bus; its commands act `delay_s` late, which it declares."""
        if drivers["type"] == "serial":  # the others leave the device as it is
            drivers = {**drivers, "watchdog_s": 2.0 * PAUSE_S}
        return machine_on(self.transport, drivers, delay_s, CYCLES_S)

    def direct(self, delay_s: float) -> Machine:
        """Return the same without the bus, its commands as late as behind it."""
        drivers = {"type": "sim", **self._options(delay_s)}
        return machine_on(self.transport, drivers, delay_s, CYCLES_S)

    def _options(self, delay_s: float) -> Options:
        plants: Options = {}
        for k, axis in enumerate(AXES):
            plant: Options = {
                "amplifier": {"resolution_bits": CONVERTER_BITS},
                "force_noise_rms_v": FORCE_NOISE_V,
                **copy.deepcopy(dict(self.hidden.get(axis, {}))),
            }
            if "cross_axis" in plant:
                plant["cross_axis"]["channel"] = 1 - k
            if delay_s:
                plant["input_delay"] = {"time_s": delay_s}
            plants[str(k)] = plant
        return {"preset": CLEAN, "seed": 1, "plants": plants}


def document_of(machine: Machine) -> Options:
    """Return a machine's configuration with what may be run with nobody there."""
    document: Options = copy.deepcopy(dict(machine.resolved))
    document["loop"]["supervisor_timeout_s"] = SUPERVISOR_S
    for driver in document["drivers"].values():
        driver["late"]["hold_ticks"] = round(PAUSE_S * document["rate_hz"])
    for axis in document["axes"].values():
        axis["experiments"] = dict(ENVELOPE)
    return document


def hidden_gantries(seed: int, effects: int) -> tuple[HiddenGantry, ...]:
    """Draw as many hidden effects for each bus, on y and x in turn; no axis has one twice."""
    found = []
    for transport in transports():
        if transport.name not in RATES_HZ:
            continue
        draw = Draw(seed, "closing", transport.name)
        lists = {axis: draw.some(SHOWN, len(SHOWN)) for axis in AXES}
        hidden: dict[str, dict[str, Options]] = {axis: {} for axis in AXES}
        for k in range(effects):
            axis = AXES[1 - k % 2]
            name = lists[axis].pop()
            hidden[axis][name] = KNOWN[name](draw, _plant(axis))
        slower = replace(transport, rate_hz=RATES_HZ[transport.name])
        found.append(HiddenGantry(slower, {a: own for a, own in hidden.items() if own}))
    return tuple(found)


@cache
def _plant(axis: str) -> AxisPlant:
    """Return the published axis as what effects are drawn for."""
    machine = load(CONFIG)
    own = machine.drivers["gantry"].options.model_dump()["plants"][AXES.index(axis)]
    limits = machine.axes[axis].limits
    program = machine.programs[f"published_{axis}"].trajectories()[axis]
    return AxisPlant(
        inertia=own["inertia_v_s2_m"],
        viscous=own["viscous_friction_v_s_m"],
        coulomb=own["coulomb_friction_v"],
        offset=own["offset_v"],
        quadratic=own["em_quadratic_1_v"],
        cubic=own["em_cubic_1_v2"],
        low_m=limits.travel_m[0],
        high_m=limits.travel_m[1],
        max_velocity_m_s=program.peaks().max_velocity_m_s,
        resolution_m=machine.axes[axis].encoder.resolution_m,
        encoder_noise_m=0.0,
        force_noise_v=FORCE_NOISE_V,
        converter_bits=CONVERTER_BITS,
        declares_saturation=True,
    )
