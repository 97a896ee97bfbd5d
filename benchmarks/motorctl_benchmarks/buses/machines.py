"""The published gantry with gains and motion for a rate, on a bus or simulated directly."""

from __future__ import annotations

import copy
import math
from typing import Any

from motorctl.config import load, load_resolved
from motorctl.config.machine import Machine
from motorctl_benchmarks.buses.transports import AXES, Transport, counter_bits, merged

CONFIG = "published_gantry"
PUBLISHED_RAD_S = 500.0
"""ks over theta1(0) of X, with the published gains."""
PLANT_DELAY_S = 0.5e-3
"""Lag and delay of the published plants."""
PHASE = 0.45
"""Crossover times delay: 26 degrees."""
LEAST_SHARE = 0.2
HOLD_S = 0.05
"""How long the loop may go without a sample: this is no real-time machine."""
SEED = 1


def slowed(rate_hz: float, delay_s: float) -> float:
    """Return the share of the published crossover that a rate and a delay allow."""
    total_s = 1.5 / rate_hz + delay_s + PLANT_DELAY_S
    return min(1.0, PHASE / total_s / PUBLISHED_RAD_S)


def machine_on(
    transport: Transport, drivers: dict[str, Any], delay_s: float, cycles_s: float
) -> Machine:
    """Return the machine of a transport with these drivers.

    Parameters
    ----------
    transport
        The bus, with its rate.
    drivers
        Type and options of the driver.
    delay_s
        How much later commands act than in a direct exchange [s]; the model declares it.
    cycles_s
        The programs last longer than this [s].
    """
    share = slowed(transport.rate_hz, delay_s)
    motion = max(share, LEAST_SHARE)
    data: dict[str, Any] = copy.deepcopy(dict(load(CONFIG).resolved))
    data["name"] = f"gantry-{transport.name.replace(' ', '-')}"
    data["rate_hz"] = transport.rate_hz
    data["loop"]["without_realtime"] = "degrade"  # a bus waits for no computer
    hold = {"hold_ticks": round(HOLD_S * transport.rate_hz) + 1, "predict": True}
    data["drivers"] = {"gantry": {**drivers, "late": hold}}
    data["programs"].pop("ring", None)
    for name in AXES:
        axis = data["axes"][name]
        gains, adaptation = axis["gains"], axis["adaptation"]
        changes: dict[str, Any] = {
            "encoder": {"counter_bits": counter_bits(transport)},
            "gains": {
                "k1_1_s": gains["k1_1_s"] * share,
                "ks_v_s_m": gains["ks_v_s_m"] * share,
                "gamma_d": gains["gamma_d"] * share**2,
            },
            "adaptation": {"filter_rad_s": adaptation["filter_rad_s"] * share},
            "limits": {"following_error": {"minimum_m": 0.05, "filter_time_s": 0.05}},
        }
        data["axes"][name] = merged(axis, changes)
        if delay_s:
            data["axes"][name]["model"]["input_delay"] = {"time_s": delay_s}
        program = data["programs"][f"published_{name}"]
        period_s = program["period_s"] / motion
        data["programs"][f"published_{name}"] = program | {
            "max_velocity_m_s": program["max_velocity_m_s"] * motion,
            "max_acceleration_m_s2": program["max_acceleration_m_s2"] * motion**2,
            "jerk_time_s": program["jerk_time_s"] / motion,
            "period_s": period_s,
            "cycles": math.ceil(cycles_s / period_s) + 1,
        }
    return load_resolved(data, data["name"], hardware=True)


def direct(transport: Transport, delay_s: float, cycles_s: float) -> Machine:
    """Return the same machine simulated directly, its commands as late as behind the bus."""
    return machine_on(transport, {"type": "sim", **gantry_options(delay_s)}, delay_s, cycles_s)


def gantry_options(delay_s: float = 0.0) -> dict[str, Any]:
    """Return the options of the simulated gantry; delay_s is added to its plants' own."""
    options: dict[str, Any] = {"preset": CONFIG, "seed": SEED}
    if delay_s:
        plants = load(CONFIG).drivers["gantry"].options.model_dump()["plants"]
        options["plants"] = {
            str(k): {"input_delay": {"time_s": plants[k]["input_delay"]["time_s"] + delay_s}}
            for k in range(len(AXES))
        }
    return options


def device_file(transport: Transport) -> dict[str, Any]:
    """Return the file of the device at the other end."""
    channel = {"resolution_m": 0.5e-6, "counter_bits": counter_bits(transport)}
    return {
        "gantry": gantry_options(),
        "channels": [{"axis": axis, **channel, "max_voltage_v": 10.0} for axis in AXES],
        "rate_hz": transport.rate_hz,
        "watchdog_s": max(0.1, 4.0 / transport.rate_hz),
        "serve": transport.serve,
    }
