"""A whole configuration: two axes with their plants, gains, declared models and programs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from motorctl_benchmarks.diagnosis.draw import Draw
from motorctl_benchmarks.diagnosis.motions import Motion, Reach, draw_programs
from motorctl_benchmarks.diagnosis.plants import (
    MAX_VOLTAGE_V,
    SHORTEST_JERK_TIME_S,
    AxisPlant,
    Options,
)
from motorctl_benchmarks.diagnosis.strength import Claim

DRIVER = "gantry"
CHANNELS = {"x": 0, "y": 1}


def configure(
    seed: int, axes: Mapping[str, AxisPlant], claims: Mapping[str, Claim], motion: Motion
) -> Options:
    """Write the machine without any effect, with its motion, as a configuration.

    The rate is 5 kHz, in one case of five 4 or 8 kHz.

    Parameters
    ----------
    seed
        Decides the rate, the controllers and the motion.
    axes
        The plant of each axis.
    claims
        What the effects, which are added later, will take from each axis' motor.
    motion
        Kind of the motion.
    """
    rate_hz = Draw(seed, "rate").pick((5000.0, 4000.0, 8000.0), (8, 1, 1))
    config: Options = {
        "name": "gantry",
        "rate_hz": rate_hz,
        "drivers": {
            DRIVER: {
                "type": "sim",
                "preset": "published_gantry_clean",
                "seed": seed,
                "plants": {str(CHANNELS[name]): plant.options() for name, plant in axes.items()},
            }
        },
        "axes": {
            name: _axis(Draw(seed, "controller", name), name, plant, claims[name])
            for name, plant in axes.items()
        },
    }
    return with_motion(config, seed, motion)


def with_motion(config: Options, seed: int, motion: Motion) -> Options:
    """Return the configuration with another motion, and the plants at rest at its start."""
    reaches = {name: Reach.of(axis["limits"]) for name, axis in config["axes"].items()}
    programs = draw_programs(seed, motion, reaches)
    sim = config["drivers"][DRIVER]
    plants = dict(sim["plants"])
    for name, program in programs.items():
        key = str(CHANNELS[name])
        plants[key] = plants[key] | {"initial_position_m": program["start_m"]}
    return config | {
        "drivers": {DRIVER: sim | {"plants": plants}},
        "programs": {f"motion_{name}": program for name, program in programs.items()},
    }


def with_effects(config: Options, axis: str, effects: Mapping[str, Options]) -> Options:
    """Put effects into the plant of an axis."""
    sim = config["drivers"][DRIVER]
    channel = CHANNELS[axis]
    plant = dict(sim["plants"][str(channel)])
    faults: list[Options] = []
    for name, options in effects.items():
        if name == "force_steps":
            faults += [
                {"kind": "force_step", "channel": channel, **step} for step in options["steps"]
            ]
        elif name == "cable_hysteresis":
            plant["position_force"] = plant.get("position_force", {}) | {"cable": options}
        elif name == "cross_axis":
            plant[name] = {"channel": 1 - channel, **options}
        else:
            plant[name] = {**plant.get(name, {}), **options}
    changed = sim | {"plants": sim["plants"] | {str(channel): plant}}
    if faults:
        changed["faults"] = faults
    return config | {"drivers": {DRIVER: changed}}


def _axis(draw: Draw, name: str, plant: AxisPlant, claim: Claim) -> Options:
    """Write one axis: its fastest motion stays within the voltage, its loop is well damped.

    Drawn: k1 200 to 260 1/s, ks 420 to 500 theta1, gamma_d 4 to 6 ks; adaptation on in 85 of 100,
    with forgetting 0.2 to 1.1 1/s, normalisation 0.001 to 0.06, filter 150 to 600 rad/s.
    """
    acceleration = plant.acceleration_within(claim.force_v, claim.inertia, claim.gain)
    jerk = acceleration / SHORTEST_JERK_TIME_S
    stop = min(0.7 * acceleration, 12.0)
    ks = draw.uniform(420.0, 500.0) * plant.inertia
    return {
        "driver": DRIVER,
        "channel": CHANNELS[name],
        "controller": "C2" if plant.declares_saturation else "C1",
        "encoder": {"resolution_m": plant.resolution_m, "counter_bits": 32},
        "limits": {
            "travel_m": [plant.low_m, plant.high_m],
            "max_velocity_m_s": plant.max_velocity_m_s,
            "max_acceleration_m_s2": acceleration,
            "max_jerk_m_s3": jerk,
            "max_voltage_v": MAX_VOLTAGE_V,
            "following_error": {
                "minimum_m": 0.003,
                "per_velocity_s": 0.005,
                "filter_time_s": 0.005,
            },
            "stop": {"acceleration_m_s2": stop, "jerk_m_s3": min(jerk, 1500.0)},
        },
        "gains": {
            "k1_1_s": draw.uniform(200.0, 260.0),
            "ks_v_s_m": ks,
            "gamma_d": draw.uniform(4.0, 6.0) * ks,
            "d_hat_max_v": 1.0,
        },
        "model": _model(draw, plant),
        "adaptation": {
            "enabled": draw.chance(0.85),
            "forgetting_1_s": draw.log_uniform(0.2, 1.1),
            "normalisation": draw.log_uniform(0.001, 0.06),
            "filter_rad_s": draw.log_uniform(150.0, 600.0),
        },
        "homing": {"method": "absolute"},
        "program": f"motion_{name}",
    }


def _model(draw: Draw, plant: AxisPlant) -> dict[str, Any]:
    """Declare the effects that the axis has, each near its value but not at it."""

    def near(value: float, low: float, high: float) -> float:
        return draw.uniform(low, high) * value

    inertia = near(plant.inertia, 0.88, 1.06)
    model = {
        "inertia": _estimate(inertia, (0.4 * plant.inertia, 2.2 * plant.inertia), 2.0),
        "viscous_friction": _estimate(near(plant.viscous, 0.7, 1.3), (0.01, 1.0), 50.0),
        "coulomb_friction": _estimate(near(plant.coulomb, 0.6, 1.3), (0.01, 0.8), 100.0),
        "offset": _estimate(0.0, (-0.5, 0.5), 500.0),
    }
    if plant.declares_saturation:
        quadratic, cubic = near(plant.quadratic, 0.4, 0.9), near(plant.cubic, 0.4, 0.9)
        model["em_quadratic"] = _estimate(quadratic, (-0.025, 0.0), 0.05)
        model["em_cubic"] = _estimate(cubic, (-0.002, 0.0), 0.005)
    return model


def _estimate(initial: float, bounds: tuple[float, float], covariance: float) -> Options:
    return {"initial": initial, "bounds": list(bounds), "covariance": covariance}
