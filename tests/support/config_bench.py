"""A small machine to write configurations for: its drivers, its effect, its YAML."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import yaml
from numba import njit

from motorctl.config import load
from motorctl.errors import ConfigError, Problem, UsageError
from motorctl.hal import Driver, DriverOptions, Inputs, Outputs, RateBudget
from motorctl.model import Effect, EffectOptions, Parameter


class BenchDriver(Driver):
    """A bench supply whose line has a baud rate."""

    class Options(DriverOptions):
        port: str = "/dev/null"
        baud: int = 1_000_000
        refuse: bool = False

    def rate_budget(self) -> RateBudget:
        if self.options.refuse:
            raise UsageError("port is in use by another axis")
        bits = 120 * len(self.channels)
        return RateBudget(self.options.baud / bits, f"{bits} bits at {self.options.baud} baud")

    def open(self) -> None:
        """Nothing to connect."""

    def close(self) -> None:
        """Nothing to release."""

    def read(self, inputs: Inputs) -> None:
        """Counts stay where they are."""

    def write(self, outputs: Outputs) -> None:
        """Volts go nowhere."""

    def safe(self) -> None:
        """Always is."""


class BrokenDriver(BenchDriver):
    """Fails while its budget is computed."""

    def rate_budget(self) -> RateBudget:
        return RateBudget(1.0 / (len(self.channels) - len(self.channels)), "never")


class SpringOptions(EffectOptions):
    centre_m: float = 0.0


class Spring(Effect):
    """An effect of the user's own, with two named parameters."""

    name = "spring"
    kind = "state"
    title = "Spring"
    formula = "k (x - c) + h (x - c)^3"
    compensated = "feedforward"
    identified = "linear"
    visible_in = "travel"
    Options = SpringOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("linear", "k", "V/m", -10.0, 10.0, 0.0, 1.0),
            Parameter("cubic", "h", "V/m^3", -10.0, 10.0, 0.0, 1.0),
        )

    @property
    def constants(self) -> tuple[float, ...]:
        return (self.options.centre_m,)


@njit
def column(j: int, x: float, v: float, a: float, vs: float, t: float, c: Any) -> float:
    return (x - c[0]) ** 3 if j else x - c[0]


MACHINE: dict[str, Any] = {
    "name": "bench",
    "rate_hz": 2000,
    "drivers": {"line": {"type": "config_bench:BenchDriver", "port": "/dev/ttyX"}},
    "axes": {
        "x": {
            "driver": "line",
            "channel": 0,
            "controller": "C2",
            "encoder": {"resolution_m": 1e-6, "counter_bits": 24},
            "limits": {
                "travel_m": [-0.1, 0.3],
                "max_velocity_m_s": 1.0,
                "max_acceleration_m_s2": 20.0,
                "max_jerk_m_s3": 2000.0,
                "max_voltage_v": 10.0,
                "following_error": {"minimum_m": 0.001, "filter_time_s": 0.002},
                "stop": {"acceleration_m_s2": 10.0, "jerk_m_s3": 1000.0},
            },
            "gains": {"k1_1_s": 100.0, "ks_v_s_m": 40.0, "gamma_d": 100.0, "d_hat_max_v": 1.0},
            "model": {
                "inertia": {"initial": 0.2, "bounds": [0.1, 0.4], "covariance": 2.0},
                "viscous_friction": {"initial": 0.2, "bounds": [0.0, 1.0]},
                "coulomb_friction": {"initial": 0.1, "bounds": [0.0, 0.5], "slope_s_m": 900},
                "em_quadratic": {"initial": -0.01, "bounds": [-0.02, 0.0]},
                "em_cubic": {"initial": -0.0005, "bounds": [-0.001, 0.0]},
            },
            "adaptation": {"forgetting_1_s": 0.5, "filter_rad_s": 200.0},
            "homing": {
                "method": "switch_index",
                "search_velocity_m_s": -0.05,
                "latch_velocity_m_s": 0.01,
                "home_position_m": -0.05,
                "timeout_s": 30.0,
            },
            "program": "there",
        }
    },
    "programs": {
        "there": {
            "kind": "point_to_point",
            "axis": "x",
            "start_m": 0.0,
            "target_m": 0.2,
            "max_velocity_m_s": 0.5,
            "max_acceleration_m_s2": 10.0,
            "max_jerk_m_s3": 500.0,
        }
    },
    "recording": {"directory": "logs"},
    "loop": {"cpu": None, "priority": 80, "spin_s": 6e-5},
}


def machine(**changes: Any) -> dict[str, Any]:
    """Return the machine with values put at dotted paths, such as ``axes__x__channel=1``."""
    data = copy.deepcopy(MACHINE)
    for path, value in changes.items():
        put(data, path.split("__"), value)
    return data


def put(data: dict[str, Any], path: list[str], value: Any) -> None:
    for key in path[:-1]:
        data = data[key]
    data[path[-1]] = value


def drop(data: dict[str, Any], path: str) -> dict[str, Any]:
    *keys, last = path.split(".")
    for key in keys:
        data = data[key]
    return data.pop(last)


def write(folder: Path, data: Any) -> Path:
    """Write YAML, one key a line."""
    path = folder / "machine.yaml"
    path.write_text(data if isinstance(data, str) else yaml.safe_dump(data, sort_keys=False))
    return path


def problems(folder: Path, data: Any) -> tuple[Problem, ...]:
    """Return the problems of a configuration, none where it is valid."""
    try:
        load(write(folder, data))
    except ConfigError as error:
        return error.problems
    return ()


def line_of(path: Path, key: str) -> int:
    """Return the first line that starts with this key."""
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if line.strip().startswith(f"{key}:"):
            return number
    raise AssertionError(f"no line has the key {key}")
