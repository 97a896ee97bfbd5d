"""From what is known to a configuration on disk that `check` accepts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from motorctl.config import load
from motorctl.config.dual_drive_keys import SECOND_END
from motorctl.errors import ConfigError, UsageError
from motorctl.hal import FirstAxis
from motorctl.identify.refine.written_beside import put_in_place, written_beside
from motorctl.init import yaml_text
from motorctl.init.axis_numbers import (
    AxisNumbers,
    axis_numbers,
    friction_slope_s_m,
    mechanics,
)
from motorctl.init.axis_text import axis_keys, home_position_m, program, program_name
from motorctl.init.known import AxisKnown, MachineKnown, driver_key
from motorctl.init.rates import FirstDriver, first_drivers
from motorctl.replacing import refuse_what_is_there

SIMULATION = "sim"
"""Type of the driver that stands in for a machine that is not there."""


@dataclass(frozen=True)
class Written:
    """A configuration that was written."""

    path: Path
    rate_hz: float
    axes: Mapping[str, AxisNumbers]
    to_be_set: tuple[str, ...]
    """What was guessed of the devices, a sentence each that begins with the key."""


def write_configuration(
    known: MachineKnown, path: Path, *, replace_file: bool, delays_s: Mapping[str, float] | None
) -> Written:
    """Write the configuration of a machine.

    Parameters
    ----------
    known
        What is known of it.
    path
        The file.
    replace_file
        Whether a file that is there may be replaced.
    delays_s
        Of a simulated machine that stands in for a real one: by how much commands of each axis are
        late there [s]. None: the machine as it is.

    Returns
    -------
    Written
        What was written; `motorctl check` accepts it.

    Raises
    ------
    UsageError
        Where the file is there, or what was told does not fit together.
    """
    if path.suffix.lower() not in (".yaml", ".yml"):
        raise UsageError(f"{path}: a configuration is a .yaml file")
    if not path.parent.is_dir():
        raise UsageError(f"{path}: there is no folder {path.parent}")
    refuse_what_is_there(path, replace=replace_file)
    drivers = first_drivers(
        _served(known, delays_s), known.driver_options, known.rate_hz, known.found_options
    )
    numbers = {}
    for axis in known.axes:
        driver = drivers[axis.driver]
        delay_s = driver.exchange.delay_s if delays_s is None else delays_s[axis.name]
        numbers[axis.name] = axis_numbers(axis, 1.0 / driver.rate_hz, delay_s)
    to_be_set = tuple(_open_questions(known, drivers))
    text = _text(known, drivers, numbers, to_be_set, stands_in=delays_s is not None)
    written = written_beside(path, text)
    try:
        machine = load(written)
    except ConfigError as error:
        written.unlink(missing_ok=True)
        raise UsageError(_in_words(path, error)) from error
    except BaseException:
        written.unlink(missing_ok=True)
        raise
    return Written(put_in_place(written, path), machine.rate_hz, numbers, to_be_set)


def stand_in(known: MachineKnown, written: Written) -> tuple[MachineKnown, dict[str, float]]:
    """Return the same machine simulated, and by how much commands of each axis are late.

    Parameters
    ----------
    known
        The real one.
    written
        What was written of it.
    """
    axes, free = [], 0
    for axis in known.axes:
        second = axis.second and replace(axis.second, channel=free + 1)
        axes.append(replace(axis, driver=SIMULATION, channel=free, second=second))
        free += 2 if second else 1
    slowest_hz = min(1.0 / numbers.period_s for numbers in written.axes.values())
    delays_s = {name: numbers.delay_s for name, numbers in written.axes.items()}
    simulated = MachineKnown(f"{known.name}-simulated", tuple(axes), slowest_hz)
    return simulated, delays_s


def _in_words(path: Path, error: ConfigError) -> str:
    """Return what `check` would refuse, with the keys, for the lines are nowhere to be seen."""
    words = "\n".join(f"  {problem.key}: {problem.message}" for problem in error.problems)
    return f"{path}: what was told does not fit together; nothing was written\n{words}"


def _served(
    known: MachineKnown, delays_s: Mapping[str, float] | None
) -> dict[str, tuple[FirstAxis, ...]]:
    return {
        driver: tuple(
            end
            for axis in known.axes_of(driver)
            for end in _ends(axis, 0.0 if delays_s is None else delays_s[axis.name])
        )
        for driver in known.drivers
    }


def _ends(axis: AxisKnown, delay_s: float) -> list[FirstAxis]:
    """Return what a driver serves of an axis: two ends where it has two motors."""
    first = _first(axis, delay_s)
    if axis.second is None:
        return [first]
    first = replace(first, end_of=axis.name)
    behind_m = axis.second.square_offset_m or 0.0
    second = replace(
        first,
        name=axis.name + SECOND_END,
        channel=axis.second.channel,
        home_position_m=first.home_position_m - 0.5 * behind_m,
    )
    return [replace(first, home_position_m=first.home_position_m + 0.5 * behind_m), second]


def _first(axis: AxisKnown, delay_s: float) -> FirstAxis:
    inertia, friction, viscous = mechanics(axis)
    return FirstAxis(
        name=axis.name,
        channel=axis.channel,
        resolution_m=axis.resolution_m,
        counter_bits=axis.counter_bits,
        absolute=axis.homing == "absolute",
        max_voltage_v=axis.max_voltage_v,
        travel_m=axis.travel_m,
        inertia_v_s2_m=inertia,
        viscous_friction_v_s_m=viscous,
        coulomb_friction_v=friction,
        homing=axis.homing,
        home_position_m=home_position_m(axis),
        delay_s=delay_s,
        friction_slope_s_m=friction_slope_s_m(axis),
    )


def _open_questions(known: MachineKnown, drivers: Mapping[str, FirstDriver]) -> list[str]:
    """Return what was guessed and nobody told."""
    questions = []
    for name, driver in drivers.items():
        given = known.driver_options.get(name, {})
        for words in driver.first.to_be_set:
            path = words.partition(":")[0].split(".")
            if not _holds(given, path):
                questions.append(f"drivers.{driver_key(name)}.{words}")
    questions += [
        f"axes.{axis.name}.encoder.direction: 1 where its counts rise with positive volts, -1 "
        "where they fall: with the wrong one it runs away"
        for axis in known.axes
        if not drivers[axis.driver].cls.simulated
    ]
    questions += [
        f"axes.{axis.name}.homing.home_position_m: where the switch or mark is"
        for axis in known.axes
        if axis.homing != "absolute" and axis.home_position_m is None
    ]
    for axis in known.axes:
        if axis.second is not None:
            questions += _of_second_end(axis, simulated=drivers[axis.driver].cls.simulated)
    return questions


def _of_second_end(axis: AxisKnown, *, simulated: bool) -> list[str]:
    assert axis.second is not None
    dual = f"axes.{axis.name}.dual_drive"
    questions = [
        f"{dual}.skew.inertia_v_s2_m: what resists skew, of carriages, beam and load "
        "(docs/dual_drive.md); the skew loop's gains follow from it"
    ]
    if not simulated:
        questions.append(
            f"{dual}.encoder_direction, motor_direction: -1 where the second end's counts or force "
            "go the other way: with the wrong one the ends pull against each other"
        )
    if axis.homing != "absolute" and axis.second.square_offset_m is None:
        questions.append(
            f"{dual}.square_offset_m: how far the first end's switch or mark is ahead of the "
            "second's, with the beam square"
        )
    return questions


def _holds(given: Mapping[str, Any], path: list[str]) -> bool:
    part: Any = given
    for key in path:
        if not isinstance(part, Mapping) or key not in part:
            return False
        part = part[key]
    return True


def _text(
    known: MachineKnown,
    drivers: Mapping[str, FirstDriver],
    numbers: Mapping[str, AxisNumbers],
    to_be_set: tuple[str, ...],
    *,
    stands_in: bool,
) -> str:
    loop_hz = max(driver.rate_hz for driver in drivers.values())
    told: dict[yaml_text.Path, str] = {("rate_hz",): _rate_words(known, loop_hz)}
    data: dict[str, Any] = {"name": known.name, "rate_hz": _plain(loop_hz), "drivers": {}}
    for key, driver in ((driver_key(name), driver) for name, driver in drivers.items()):
        own: dict[str, Any] = {"type": driver.name}
        if driver.rate_hz < loop_hz:
            own["rate_hz"] = _plain(driver.rate_hz)
            told["drivers", key, "rate_hz"] = (
                f"it carries {driver.exchange.budget.max_rate_hz:.4g} Hz at most"
                if driver.exchange.budget
                else "as much as it carries"
            )
        data["drivers"][key] = own | dict(driver.options)
        for path, words in driver.first.told.items():
            if _holds(driver.options, [*path]):  # type: ignore[list-item]
                told["drivers", key, *path] = words
    data["axes"], data["programs"] = {}, {}
    for name, axis in numbers.items():
        data["axes"][name], comments = axis_keys(axis)
        told |= {("axes", name, *path): words for path, words in comments.items()}
        told["axes", name] = "; ".join(axis.known.said) if axis.known.said else ""
        data["programs"][program_name(axis.known)] = program(axis)
    simulated = all(driver.cls.simulated for driver in drivers.values())
    data["recording"] = {"directory": "logs"}
    data["loop"] = {"without_realtime": "wait" if simulated else "degrade"}
    told["programs",] = "60 % of travel and of the limits, at three speeds: enough to identify from"
    told["recording",] = "relative to the directory that motorctl is started in"
    told["loop", "without_realtime"] = (
        "while this computer pauses the simulated machine waits"
        if simulated
        else "or refuse: do not run where real time is not to be had"
    )
    told = {path: words for path, words in told.items() if words}
    head = _head(known, to_be_set, stands_in=stands_in)
    return head + yaml_text.yaml_text(data, told).rstrip("\n") + "\n"


def _head(known: MachineKnown, to_be_set: tuple[str, ...], *, stands_in: bool) -> str:
    begin = (
        f"{known.name}, in the place of the real machine: to simulate and to diagnose."
        if stands_in
        else f"{known.name}, begun by `motorctl init`."
    )
    lines = [
        *yaml_text.comment_lines(
            f"{begin} Numbers that were told stand as they are; the others follow from them, each "
            "as its comment says. Every key: `motorctl check --schema`, docs/reference/keys.md."
        )
    ]
    if to_be_set:
        lines += ["#", "# To be set from the devices, which nobody has told of:"]
        lines += [line for words in to_be_set for line in yaml_text.comment_lines(f"- {words}")]
    return "\n".join([*lines, "", ""])


def _rate_words(known: MachineKnown, loop_hz: float) -> str:
    if known.rate_hz is not None:
        return f"a period of {1e3 / loop_hz:.4g} ms"
    return f"a period of {1e3 / loop_hz:.4g} ms: the highest usual rate that the drivers carry"


def _plain(value: float) -> float | int:
    return int(value) if value == int(value) else value
