"""The shipped gantry, the models that x gets in turn, and which model a log says it has."""

from __future__ import annotations

import copy
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import yaml

from motorctl.config import load, shipped_config
from motorctl.config.axis_keys import Gains
from motorctl.config.machine import Machine
from motorctl.config.metadata import log_axes
from motorctl.config.model_keys import MODEL_KEYS, model_of, with_models_of
from motorctl.daemon.client import Client, DaemonRefusedError
from motorctl.errors import RunError
from motorctl.json_values import plain
from motorctl.log.columns import log_columns
from motorctl.log.convert import load_metadata

SHIPPED = "published_gantry"
AXIS, BESIDE = "x", "y"
"""The one whose models change, and one that holds with its own."""
HOLDS_S = 60.0
"""So long an axis may take until it holds. By hand: a start takes a second."""
RATE_HZ = 2000.0
"""Of the loop: less than as shipped, so that a computer with other work keeps up. By hand."""
PULL_V = 0.4
"""A weight that pulls at AXIS, so that it holds with a command of as much. By hand: enough to tell
the input maps of C1 and C2 apart, and within what the fast adaptation may take."""
OWN = "its own"
"""The model that the daemon's file has."""
OTHERS: Mapping[str, Mapping[str, Any]] = {
    "C1": {"controller": "C1"},
    "other gains": {"gains": {"k1_1_s": 300, "ks_v_s_m": 70, "gamma_d": 900}},
    "an effect more": {
        "model": {
            "cogging": {
                "pitch_m": 0.05,
                "orders": [1, 2],
                "parameters": {"sin_1": {"initial": 0.2}, "cos_2": {"initial": -0.1}},
            }
        }
    },
    "a filter": {"gains": {"command_filter": {"kind": "notch", "frequency_hz": 300.0}}},
    "a lag": {"model": {"input_lag": {"time_s": 0.39e-3}}},
}
"""What differs from the shipped file on AXIS, by name."""


@dataclass(frozen=True)
class Models:
    """The machine with its own models and with each of the others."""

    config: Path
    machines: Mapping[str, Machine]
    """By name; OWN is the daemon's."""

    def gains(self, name: str) -> Gains:
        """Return the gains of AXIS with a model; with its own where there is no such model."""
        return self.machines.get(name, self.machines[OWN]).axes[AXIS].gains

    def model(self, log: Path) -> str | None:
        """Return which model a log says AXIS has; None: none of these, or one but in part."""
        schema = pq.read_schema(log)
        axes = load_metadata(schema)["config"]["axes"]
        for name, machine in self.machines.items():
            same = all(
                {key: axes[axis][key] for key in MODEL_KEYS} == plain(model_of(machine, axis))
                for axis in machine.axes
            )
            columns = [column.name for column in log_columns(log_axes(machine))]
            if same and schema.names == columns:
                return name
        return None


def written_models(folder: Path) -> Models:
    """Write the shipped gantry, at RATE_HZ, into a folder, and load it with each model."""
    document = yaml.safe_load(shipped_config(SHIPPED).read_text(encoding="utf-8"))
    document["rate_hz"] = RATE_HZ
    document["drivers"]["gantry"]["plants"] = {"0": {"offset_v": PULL_V}}
    config = folder / "gantry.yaml"
    config.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
    own = load(config)
    machines = {OWN: own}
    for name, changes in OTHERS.items():
        axis = copy.deepcopy(document["axes"][AXIS])
        for key, value in changes.items():
            axis[key] = {**axis[key], **value} if isinstance(value, Mapping) else value
        path = folder / f"{name.replace(' ', '_')}.yaml"
        path.write_text(
            yaml.safe_dump(document | {"axes": document["axes"] | {AXIS: axis}}, sort_keys=False),
            encoding="utf-8",
        )
        machines[name] = load(path)
        # effects that run already keep their place, as in the daemon
        assert with_models_of(own, machines[name].resolved) == machines[name].resolved
    return Models(config, machines)


def hold(client: Client) -> None:
    """Enable axes that are off, and wait until all hold. Raises RunError where they do not."""
    deadline = time.monotonic() + HOLDS_S
    while time.monotonic() < deadline:
        axes = client.ask("status")["axes"]
        if all(axis["state"] == "idle" for axis in axes.values()):
            return
        for name, axis in axes.items():
            if axis["state"] == "off":
                try:
                    client.ask("start", axis=name, hold=True)
                except DaemonRefusedError as no:
                    if no.code not in ("still_moving", "not_ready"):
                        raise
        time.sleep(0.02)
    states = {name: axis["state"] for name, axis in axes.items()}
    raise RunError(f"the axes do not hold after {HOLDS_S:g} s: {states}")


def apply(client: Client, machine: Machine) -> dict[str, Any]:
    """Ask for other models as the command does; return the answer."""
    return client.ask("apply", config=machine.resolved, source=str(machine.source.absolute()))
