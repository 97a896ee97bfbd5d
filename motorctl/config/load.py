"""The doors: a file, or the plain data in a log, becomes a machine, or all problems at once."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from motorctl.config.axis_keys import ConfigurationKeys, Controller
from motorctl.config.axis_model import read_further_effects
from motorctl.config.axis_parts import AxisParts, check_axis, read_axis
from motorctl.config.chosen_code import MayRun, remember
from motorctl.config.following_rules import check_following
from motorctl.config.freeze import decode, freeze
from motorctl.config.groups import check_groups
from motorctl.config.hardware import build_drivers, check_claims, check_rates
from motorctl.config.heat_rules import check_heat
from motorctl.config.keys import LoopSettings
from motorctl.config.learning_rules import check_learning_files
from motorctl.config.machine import DriverSetup, Machine
from motorctl.config.machine_guard_rules import check_machine_guards
from motorctl.config.named_code import AllowedCode, named_code, refused_code
from motorctl.config.programs import build_programs, check_followed, check_programs
from motorctl.config.rates import axis_rate, loop_rate, read_divisors
from motorctl.config.recording_rules import RecordingRate, check_recording, recording_rate
from motorctl.config.shipped import locate
from motorctl.config.slow_motion_rules import check_slow_motion
from motorctl.config.validation import read_keys, validate
from motorctl.config.way_rules import check_way, simulated_ways
from motorctl.errors import Problem
from motorctl.located_yaml import Document, read_document


def load(
    path: str | Path,
    controller: Controller | None = None,
    *,
    hardware: bool = True,
    allowed_code: AllowedCode | None = None,
) -> Machine:
    """Load a configuration, or a shipped one by its bare name.

    Parameters
    ----------
    path
        The file, or the name of a shipped configuration.
    controller
        Takes the place of what every axis says.
    hardware
        Without it the drivers are left out, so that they need not be installed: for analysis.
    allowed_code
        What of the code that the file names may be imported; None: all of it, and it is kept in
        mind as the user's choice, so that logs that name it may be read (`chosen_code`).

    Returns
    -------
    Machine
        The checked machine, which never changes.

    Raises
    ------
    ConfigError
        With every problem of the file, each with its line and key.
    """
    source = locate(path)
    document = read_document(source)
    if allowed_code is not None:
        document.refuse(refused_code(document, allowed_code))
    named = named_code(document)
    machine = _build(document, source, source.parent.resolve(), controller, hardware=hardware)
    if allowed_code is None:
        remember(named)
    return machine


def load_resolved(
    resolved: Mapping[str, Any],
    source: str | Path = "resolved",
    *,
    hardware: bool = False,
    may_run: MayRun | None = None,
) -> Machine:
    """Build the machine again from its plain data `Machine.resolved`, as logs hold it.

    Parameters
    ----------
    resolved
        The plain data.
    source
        Names the data in messages.
    hardware
        Without it the drivers are left out, so that they need not be installed, and so are programs
        whose files of points are gone; whether an axis can follow the others is not asked again.
    may_run
        Asked of all code that the data name whether it may be imported; None: all may. Further
        effects that may not are left out, any other is a problem.

    Returns
    -------
    Machine
        The checked machine, which never changes.

    Raises
    ------
    ConfigError
        With every problem of the data, each with its key.
    """
    document = Document(str(source), decode(resolved))
    if not hardware:
        _drop_lost_points(document)
    if may_run is not None:
        _refuse_code(document, may_run, hardware)
    return _build(document, Path(source), Path.cwd(), None, hardware=hardware)


def _refuse_code(document: Document, may_run: MayRun, hardware: bool) -> None:
    """Raise where data name code that may not be imported; leave out what is not needed of it."""
    problems = []
    for code in named_code(document):
        if (code.kind == "driver" and not hardware) or may_run(code):
            continue
        if code.key[0] == "further_effects":
            del document.data["further_effects"][code.key[1]]
            continue
        place = f" ({code.file})" if code.file else ""
        problems.append(
            document.problem(
                code.key,
                f"'{code.target}'{place} is code that is not run because a log names it: whoever "
                f"trusts it says so with --allow-code {code.module}, or names a configuration of "
                "their own with --model",
            )
        )
    document.refuse(problems)


def _build(
    document: Document, source: Path, directory: Path, controller: Controller | None, hardware: bool
) -> Machine:
    """Check everything that can be read, and raise all problems or build the machine."""
    _fill_in(document.data, controller)
    keys, problems = validate(document, (), ConfigurationKeys, document.data)
    rate_hz = loop_rate(document)
    divisors, refused = read_divisors(document, rate_hz)
    problems += refused
    parts: dict[str, AxisParts] = {}
    for name in document.part(("axes",)):
        parts[name], refused = read_axis(document, name)
        problems += refused
        problems += check_axis(document, parts[name], axis_rate(document, name, rate_hz, divisors))
    problems += _check_spin(document, rate_hz)
    problems += check_claims(document)
    problems += check_groups(document)
    problems += check_learning_files(document, directory)
    problems += check_machine_guards(document, rate_hz, divisors)
    problems += check_recording(document, _recording_rate(document, parts, rate_hz))
    drivers: dict[str, DriverSetup] = {}
    if hardware:
        drivers, refused = build_drivers(document, directory)
        problems += refused
        wirings = [wiring for part in parts.values() for wiring in part.wirings(document)]
        problems += check_rates(document, drivers, wirings, rate_hz, divisors)
        problems += _check_waiting(document, drivers)
    programs, refused = build_programs(document, directory)
    problems += refused
    limits = {n: known for n, part in parts.items() if (known := part.motion_limits())}
    voltages = {n: need for n, part in parts.items() if (need := part.required_voltage())}
    if hardware:  # else nothing will move: what a log holds was checked before it was recorded
        problems += check_programs(document, programs, limits, voltages)
        thermals = {n: p.guards.thermal for n, p in parts.items() if p.guards and p.guards.thermal}
        rates = {n: own for n in parts if (own := axis_rate(document, n, rate_hz, divisors))}
        noises = {n: v for n, hz in rates.items() if (v := parts[n].count_noise_v(hz))}
        problems += check_heat(document, programs, thermals, limits, voltages, rates, noises)
        ways = simulated_ways(drivers, wirings, rates)
        for name, part in parts.items():
            problems += check_way(document, part, ways.get(name, ()), programs)
            problems += check_slow_motion(document, part, rates.get(name))
            if not any(p.key == "rate_hz" or p.key.startswith(f"axes.{name}.") for p in problems):
                problems += check_following(document, part, programs, rates.get(name))
            problems += check_followed(document, name, programs)
    further, refused = read_further_effects(document)
    problems += refused if hardware else []  # a log may be read where they are not installed
    document.refuse(problems)
    assert keys is not None  # else there were problems
    models = {name: part.declared for name, part in parts.items() if part.declared}
    return freeze(keys, source, drivers, models, programs, divisors, further)


def _fill_in(data: dict[str, Any], controller: Controller | None) -> None:
    """Put the chosen controller in; an effect with nothing behind its name has its defaults."""
    axes = data.get("axes")
    for axis in (axes if isinstance(axes, dict) else {}).values():
        if not isinstance(axis, dict):
            continue
        if controller is not None:
            axis["controller"] = controller
        model = axis.get("model")
        if isinstance(model, dict):
            axis["model"] = {name: {} if e is None else e for name, e in model.items()}


def _check_spin(document: Document, rate_hz: float | None) -> list[Problem]:
    loop = read_keys(LoopSettings, document.part(("loop",)))
    if rate_hz and loop and loop.spin_s >= 1.0 / rate_hz:
        message = f"found {loop.spin_s:g}, should be below the period of {1.0 / rate_hz:g} s"
        return [document.problem(("loop", "spin_s"), message)]
    return []


def _check_waiting(document: Document, drivers: Mapping[str, DriverSetup]) -> list[Problem]:
    loop = read_keys(LoopSettings, document.part(("loop",)))
    moving = [name for name, setup in drivers.items() if not setup.cls.supports_virtual_time]
    if loop is None or not loop.waits or not moving:
        return []
    message = (
        f"found 'wait', should be degrade or refuse: driver '{moving[0]}' "
        f"({drivers[moving[0]].type}) moves a machine whose time waits for no computer"
    )
    return [document.problem(("loop", "without_realtime"), message)]


def _recording_rate(
    document: Document, parts: Mapping[str, AxisParts], rate_hz: float | None
) -> RecordingRate | None:
    axes = [
        (
            len(part.model),
            part.dual is not None,
            document.at(("axes", name, "learning")) is not None,
        )
        for name, part in parts.items()
        if part.model
    ]
    if rate_hz is None or len(axes) < len(parts):
        return None
    return recording_rate(axes, rate_hz)


def _drop_lost_points(document: Document) -> None:
    programs = document.at(("programs",))
    for name, part in list(programs.items()) if isinstance(programs, dict) else []:
        file = part.get("file") if isinstance(part, dict) else None
        if isinstance(file, str) and not Path(file).exists():
            del programs[name]
