"""Keep what the adaptation has learned from one run of the daemon to the next."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Collection, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, FiniteFloat, ValidationError

from motorctl.config.analysis import smallest_slope
from motorctl.config.machine import Axis, Machine

_FORMAT = "motorctl-learned-1"


class _LearnedAxis(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    controller: str
    parameters: dict[str, FiniteFloat]
    meaning: str | None = None
    """Digest of what gives the parameters their meaning; files of earlier versions have none."""


class _LearnedFile(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    format: str
    machine: str
    saved: str
    axes: dict[str, _LearnedAxis]


def keeps_learned(machine: Machine) -> list[Axis]:
    """Return the axes whose estimates are kept."""
    return [a for a in machine.axes.values() if a.adaptation.enabled and a.adaptation.keep_learned]


def take_up(machine: Machine, path: Path) -> tuple[dict[str, list[float]], list[str]]:
    """Read the estimates that an earlier run ended with.

    Whatever of the file is damaged, foreign or outside the configured bounds is left alone.

    Returns
    -------
    learned
        theta (n,) by axis, of those axes whose estimates can be used.
    remarks
        A sentence for each axis or file: what was taken, or why not.
    """
    keepers = keeps_learned(machine)
    if not keepers:
        return {}, []
    try:
        file = _LearnedFile.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        return {}, []
    except (OSError, ValidationError) as error:
        return {}, [
            f"{path}: learned parameters ignored: {_short(error)}; axes that keep them start as "
            f"configured, and this file becomes {_aside(path).name} when new ones are saved"
        ]
    if file.format != _FORMAT or file.machine != machine.name:
        foreign = (
            f"the file is for machine '{file.machine}', format '{file.format}'; this is "
            f"'{machine.name}', '{_FORMAT}'"
        )
        return {}, [f"{path}: learned parameters ignored: {foreign}"]
    learned, remarks = {}, []
    for axis in keepers:
        if axis.name not in file.axes:
            continue
        kept = file.axes[axis.name]
        if problem := _problem(machine, axis, kept):
            message = f"{path}: axis {axis.name}: learned parameters ignored: {problem}"
            remarks.append(message)
            continue
        learned[axis.name] = [kept.parameters[name] for name in axis.model.parameter_names]
        remarks.append(f"axis {axis.name}: starts from the parameters learned until {file.saved}")
    return learned, remarks


def save(
    machine: Machine, theta: Mapping[str, np.ndarray], path: Path, leave: Collection[str] = ()
) -> None:
    """Write the estimates of the axes that keep them: the old file or the new one, never a part.

    A file that could not be read is put aside: somebody may mend it.

    Parameters
    ----------
    machine
        Whose axes they are.
    theta
        An array (n,) or longer for each axis.
    path
        The file.
    leave
        Axes of which what is in the file already stays: they ended with another model.

    Raises
    ------
    OSError
        Where it cannot be written.
    ValueError
        Where a number is not finite.
    """
    stays = _in_file(path, leave) if leave else {}
    learned = _LearnedFile(
        format=_FORMAT,
        machine=machine.name,
        saved=datetime.now(UTC).isoformat(timespec="seconds"),
        axes=stays
        | {
            axis.name: _LearnedAxis(
                controller=axis.controller,
                parameters=dict(
                    zip(axis.model.parameter_names, map(float, theta[axis.name]), strict=False)
                ),
                meaning=_meaning(machine, axis),
            )
            for axis in keeps_learned(machine)
            if axis.name not in leave
        },
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    if _is_damaged(path):
        path.replace(_aside(path))
    draft = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    try:
        with draft.open("w") as file:
            file.write(learned.model_dump_json(indent=2) + "\n")
            file.flush()
            os.fsync(file.fileno())
        draft.replace(path)
    finally:
        with contextlib.suppress(FileNotFoundError):
            draft.unlink()


def _in_file(path: Path, axes: Collection[str]) -> dict[str, _LearnedAxis]:
    try:
        file = _LearnedFile.model_validate_json(path.read_bytes())
    except (OSError, ValidationError):
        return {}
    return {name: axis for name, axis in file.axes.items() if name in axes}


def _is_damaged(path: Path) -> bool:
    try:
        _LearnedFile.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        return False
    except (OSError, ValidationError):
        return True
    return False


def _aside(path: Path) -> Path:
    return path.with_name(f"{path.name}.damaged")


def _meaning(machine: Machine, axis: Axis) -> str:
    """Return a digest of what a volt, a metre and an effect are to an axis.

    That is its driver's options, its encoder, and its effects with their options and the values
    that they were given: who gives others has another machine in mind. Bounds and covariances are
    none of it.
    """
    resolved: Any = machine.resolved
    own, driver = resolved["axes"][axis.name], resolved["drivers"][axis.driver]
    model = json.loads(json.dumps(own["model"]))
    for effect in model.values():
        _leave_out(effect, ("bounds", "covariance"))
    meaning = {
        "driver": {key: driver[key] for key in driver if key not in ("late", "rate_hz")},
        **{key: own[key] for key in ("channel", "dual_drive", "encoder")},
        "model": model,
    }
    return hashlib.sha256(json.dumps(meaning, sort_keys=True).encode()).hexdigest()


def _leave_out(value: Any, keys: Collection[str]) -> None:
    if isinstance(value, dict):
        for key in keys:
            value.pop(key, None)
        for inner in value.values():
            _leave_out(inner, keys)
    elif isinstance(value, list):
        for inner in value:
            _leave_out(inner, keys)


def _problem(machine: Machine, axis: Axis, kept: _LearnedAxis) -> str | None:
    names = axis.model.parameter_names
    if kept.controller != axis.controller or set(kept.parameters) != set(names):
        return "they belong to another model (controller or effects)"
    if kept.meaning is None:
        return "an earlier motorctl saved them without for which driver, encoder and model"
    if kept.meaning != _meaning(machine, axis):
        return (
            "since they were learned the configuration was given another driver (or options of "
            "it), channel, encoder or model, so they may mean something else"
        )
    for name, estimate in zip(names, axis.estimates, strict=True):
        value = kept.parameters[name]
        if not estimate.lower <= value <= estimate.upper:
            return f"{name} = {value:g} lies outside {estimate.lower:g} to {estimate.upper:g}"
    theta = np.array([kept.parameters[name] for name in names])
    reach = axis.limits.max_voltage_v
    slope, _ = smallest_slope(axis.model, theta, reach, axis.limits.travel_m)
    # Rounding may leave a projected estimate the last digits below the margin.
    if slope < 0.99 * axis.adaptation.monotonicity_margin:
        return f"the input map is not monotonic up to {reach:g} V (Assumption 2)"
    return None


def _short(error: Exception) -> str:
    if isinstance(error, ValidationError):
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        return f"{place}: {first['msg']}" if place else first["msg"]
    return error.strerror or str(error) if isinstance(error, OSError) else str(error)
