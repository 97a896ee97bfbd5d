"""What `motorctl check` says of a machine: its numbers, budgets, margins and motions, as data."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from motorctl.config.analysis import (
    command_peak,
    corner_slopes,
    gain_condition,
    required_command,
    smallest_slope,
)
from motorctl.config.axis_keys import Limits
from motorctl.config.dual_drive_rules import skew_margins
from motorctl.config.exchange import ask_exchange, is_one_exchange
from motorctl.config.filter_words import filter_words
from motorctl.config.groups import notes_on_groups
from motorctl.config.guard_notes import notes_on_guards
from motorctl.config.hardware import channels_of, wirings_of
from motorctl.config.keys import LoopSettings
from motorctl.config.learned_file import notes_on_learning
from motorctl.config.loop_cases import MarginsAt, loop_cases, remark_on_margins
from motorctl.config.loop_rules import parameter_range
from motorctl.config.machine import Axis, Machine
from motorctl.config.motion_notes import notes_on_motion
from motorctl.config.recording_summary import (
    notes_on_recording,
    recording_rate_of,
    recording_summary,
)
from motorctl.errors import MotorctlError
from motorctl.json_values import plain
from motorctl.log.units import unit_for
from motorctl.model import Effect, EffectList, known_effects
from motorctl.model.knowledge import Signal
from motorctl.motion import Program

LAW_SIGNALS: tuple[Signal, ...] = ("acceleration", "velocity", "direction")
"""Whose factors theta1 to theta3 the condition on ks1 is about."""
SAMPLES = 20_001
"""Instants of one cycle at which the command is computed."""


def summarise(machine: Machine) -> dict[str, Any]:
    """Return everything that `check` shows.

    Parameters
    ----------
    machine
        A checked machine.

    Returns
    -------
    dict
        The document of ``check --json``, with units in the keys; what is infinite becomes None.
    """
    drivers = dict(_drivers(machine))
    axes = {
        n: _axis(axis, machine.period_of(n), machine.loop, drivers[axis.driver])
        for n, axis in machine.axes.items()
    }
    summary = {
        "name": machine.name,
        "source": str(machine.source),
        "rate_hz": machine.rate_hz,
        "period_s": machine.period_s,
        "valid": True,
        "problems": [],
        "drivers": drivers,
        "axes": axes,
        "programs": {n: _program(machine, p) for n, p in machine.programs.items()},
        "stop_together": _groups(machine),
        "loop": machine.loop.model_dump(),
        "log_directory": str(machine.log_directory),
        "recording": recording_summary(machine.recording, recording_rate_of(machine)),
        "notes": [_in_own_units(machine, note) for note in _all_notes(machine, drivers, axes)],
        "resolved": dict(machine.resolved),
    }
    document: dict[str, Any] = plain(summary)
    return document


def _all_notes(
    machine: Machine, drivers: Mapping[str, Any], axes: Mapping[str, Any]
) -> Iterator[str]:
    watchdogs_s = {n: driver["watchdog_s"] for n, driver in drivers.items()}
    rate = recording_rate_of(machine)
    yield from notes_on_groups(machine)
    yield from notes_on_guards(machine, watchdogs_s)
    yield from notes_on_motion(machine)
    yield from notes_on_learning(machine)
    yield from notes_on_recording(machine.recording, rate)
    for name, driver in drivers.items():
        yield from (f"driver {name}: {said}" for said in driver["advice"])
    for name, axis in axes.items():
        yield from _notes(name, axis, machine.axes[name].model)
        yield from _exchange_notes(machine.axes[name], drivers[axis["driver"]]["delay_s"])


def _in_own_units(machine: Machine, note: str) -> str:
    """Return a note on an axis in that axis' units."""
    found = re.match(r"axis (\w+): ", note)
    axis = machine.axes.get(found[1]) if found else None
    return note if axis is None else axis.units.words(note)


def _groups(machine: Machine) -> list[list[str]] | None:
    return None if machine.stop_together is None else [list(g) for g in machine.stop_together]


def _drivers(machine: Machine) -> Iterator[tuple[str, dict[str, Any]]]:
    wirings = wirings_of(machine.axes.values())
    for name, setup in machine.drivers.items():
        channels = channels_of(name, wirings)
        period_s = machine.period_of_driver(name)
        told: dict[str, Any] = {
            "type": setup.type,
            "axes": [channel.axis for channel in channels],
            "supports_virtual_time": setup.cls.supports_virtual_time,
            "rate_hz": 1.0 / period_s,
            "late": setup.late.model_dump(),
        }
        try:
            exchange = ask_exchange(setup, channels, period_s)
            budget = exchange.budget
            assert budget is not None  # the configuration has been checked
        except MotorctlError as error:
            told |= {"max_rate_hz": None, "used": None, "arithmetic": str(error), "delay_s": 0.0}
            told |= {"advice": [], "watchdog_s": None}
        else:
            told |= {
                "delay_s": exchange.delay_s,
                "watchdog_s": exchange.watchdog_s,
                "max_rate_hz": budget.max_rate_hz,
                "used": 1.0 / period_s / budget.max_rate_hz,
                "arithmetic": budget.arithmetic,
                "advice": list(exchange.advice),
            }
        yield name, told


def _axis(
    axis: Axis, period_s: float, loop: LoopSettings, driver: Mapping[str, Any]
) -> dict[str, Any]:
    return {
        "kind": axis.kind,
        "position_unit": axis.units.position,
        "driver": axis.driver,
        "channel": axis.channel,
        "dual_drive": _dual_drive(axis, period_s),
        "controller": axis.controller,
        "effects": list(axis.model.names),
        "effect_options": {e.name: e.options.model_dump(mode="json") for e in axis.model.effects},
        "encoder": axis.encoder.model_dump(),
        "limits": _limits(axis.limits),
        "guards": _guards(axis, period_s, loop, driver),
        "gains": axis.gains.model_dump(),
        "parameters": dict(_parameters(axis)),
        "adaptation": axis.adaptation.model_dump(),
        "homing": {k: 0.0 if v is None else v for k, v in axis.homing},
        "program": axis.program,
        "robust_gain": _robust_gain(axis),
        "margins": [asdict(case.margins) for case in loop_cases(axis, period_s)],
        "assumption_2": _assumption_2(axis),
    }


def _dual_drive(axis: Axis, period_s: float) -> dict[str, Any] | None:
    """The keys as they are, and the margins of the skew loop without and with one sample more."""
    dual = axis.dual_drive
    if dual is None:
        return None
    delays_s = (axis.adaptation.input_delay_s, axis.adaptation.input_delay_s + period_s)
    margins = [asdict(skew_margins(dual.skew, axis.model, d, period_s)) for d in delays_s]
    return {**dual.model_dump(), "skew_margins": margins}


def _limits(limits: Limits) -> dict[str, Any]:
    """The keys as they are, but those of the ramp beside the others."""
    told = limits.model_dump()
    return told | {f"stop_{key}": value for key, value in told.pop("stop").items()}


def _guards(
    axis: Axis, period_s: float, loop: LoopSettings, driver: Mapping[str, Any]
) -> dict[str, Any]:
    """The keys as they are, with the numbers that null stands for, and what the loop adds."""
    guards = axis.guards
    told = guards.model_dump()
    if guards.encoder_stuck:
        told["encoder_stuck"]["distance_m"] = guards.stuck_distance_m(
            axis.limits.following_error.minimum_m
        )
    # No time of a machine that waits for its computer is missing.
    held_s = math.inf
    if is_one_exchange(round(driver["delay_s"] / period_s, 6)):
        held_s = driver["late"]["hold_ticks"] * period_s
    frozen_s = math.inf if loop.waits else guards.frozen_s(period_s, driver["watchdog_s"], held_s)
    told["host_frozen"]["time_s"] = frozen_s
    told["supervisor_lost"]["time_s"] = loop.patience_s
    return told


def _parameters(axis: Axis) -> Iterator[tuple[str, dict[str, Any]]]:
    model = axis.model
    for name, parameter, estimate in zip(
        model.parameter_names, model.parameters, axis.estimates, strict=True
    ):
        yield (
            name,
            {
                "symbol": parameter.symbol,
                "unit": unit_for(parameter.unit, axis.units.position, "V"),
                **asdict(estimate),
            },
        )


def _robust_gain(axis: Axis) -> dict[str, Any]:
    """The sufficient condition on ks1 at theta_hat(0), and over the box of the bounds.

    Its proof knows of no filter of the command: behind one it does not apply.
    """
    slope_s_m = _coulomb_slope(axis.model.effects)
    ranges = [_range(axis, signal) for signal in LAW_SIGNALS]
    told = {}
    for key, box in (
        ("at_initial", [(initial, initial) for initial, _, _ in ranges]),
        ("over_bounds", [(lower, upper) for _, lower, upper in ranges]),
    ):
        theta1, theta2, theta3 = box
        condition = gain_condition(
            theta1, theta2, theta3, slope_s_m, axis.gains.k1_1_s, axis.gains.ks_v_s_m
        )
        told[key] = {**asdict(condition), "satisfied": condition.satisfied}
    applies = axis.gains.command_filter is None
    return {"ks_v_s_m": axis.gains.ks_v_s_m, "applies": applies, **told}


def _assumption_2(axis: Axis) -> dict[str, Any]:
    theta = axis.theta_initial
    u_max, margin = axis.limits.max_voltage_v, axis.adaptation.monotonicity_margin
    travel_m = axis.limits.travel_m
    slope, at_u = smallest_slope(axis.model, theta, u_max, travel_m)
    lower = [estimate.lower for estimate in axis.estimates]
    upper = [estimate.upper for estimate in axis.estimates]
    corners = corner_slopes(axis.model, lower, upper, u_max, travel_m)
    return {
        "margin": margin,
        "u_max_v": u_max,
        "initial": {"slope": slope, "at_u_v": at_u},
        "corners": [{**asdict(c), "satisfied": c.slope >= margin} for c in corners],
    }


def _program(machine: Machine, program: Program) -> dict[str, Any]:
    axes = {}
    duration_s = 0.0
    for name, trajectory in program.trajectories().items():
        axis = machine.axes[name]
        t = np.linspace(0.0, trajectory.duration_s / program.cycles, SAMPLES)
        need = required_command(axis.model, axis.theta_initial, axis.limits.max_voltage_v)
        peak = command_peak(t, need(*trajectory.sample(t)))
        duration_s = trajectory.duration_s
        axes[name] = {**asdict(trajectory.peaks()), **asdict(peak)}
    return {
        "kind": getattr(program, "kind", type(program).__name__),
        "cycles": program.cycles,
        "duration_s": duration_s,
        "axes": axes,
    }


def _notes(name: str, axis: Mapping[str, Any], model: EffectList) -> Iterator[str]:
    condition = axis["robust_gain"]["at_initial"]
    ks = axis["robust_gain"]["ks_v_s_m"]
    if not axis["robust_gain"]["applies"]:
        own = axis["gains"]["command_filter"]
        yield (
            f"axis {name}: the sufficient condition on ks1 does not apply behind the filter of the "
            f"command, {filter_words(**own)}; the margins are those with it"
        )
    elif not condition["satisfied"]:
        yield (
            f"axis {name}: ks {ks:g} is below the sufficient condition, ks1 > "
            f"{condition['required_ks1_v_s_m']:.4g} V*s/m at theta(0): the loop is stable, but the "
            "guaranteed decay does not hold"
        )
    elif not axis["robust_gain"]["over_bounds"]["satisfied"]:
        required = axis["robust_gain"]["over_bounds"]["required_ks1_v_s_m"]
        yield (
            f"axis {name}: ks {ks:g} meets the sufficient condition at theta(0), not in every "
            f"corner of the bounds (ks1 > {required:.4g} V*s/m)"
        )
    rows = [MarginsAt(**row) for row in axis["margins"]]
    if remark := remark_on_margins(rows):
        yield f"axis {name}: {remark}; `motorctl tune {name}` finds gains at margins"
    for row in rows:
        if not row.stable:
            yield (
                f"axis {name}: unstable with inertia at its {row.inertia_at} "
                f"({row.inertia:g} V*s^2/m) and {row.delay_s * 1e3:g} ms of delay"
            )
    dual = axis["dual_drive"]
    for row in dual["skew_margins"] if dual else ():
        if not row["stable"]:
            yield f"axis {name}: skew loop unstable with {row['delay_s'] * 1e3:g} ms of delay"
    corners = axis["assumption_2"]["corners"]
    failing = [corner for corner in corners if not corner["satisfied"]]
    if failing:
        yield (
            f"axis {name}: Assumption 2 fails in {len(failing)} of {len(corners)} corners of the "
            f"bounds (worst dv/du {failing[0]['slope']:.3g}); the projection keeps the estimate "
            "out of them"
        )
    beyond = [
        effect.name
        for effect in model.effects
        if effect.kind in ("state", "input")
        and not effect.electromagnetic
        and effect.proportional_to is None
    ]
    if beyond:
        yield f"axis {name}: condition and margins leave out {', '.join(beyond)}"


def _exchange_notes(axis: Axis, delay_s: float) -> Iterator[str]:
    declared_s = axis.model.delay_s + axis.adaptation.input_delay_s
    if declared_s < delay_s * (1.0 - 1e-9):
        yield (
            f"axis {axis.name}: driver '{axis.driver}' brings a sample with the command, so "
            f"a command acts {delay_s * 1e3:g} ms late, and the model declares "
            f"{declared_s * 1e3:g} ms: add {_delay_words(delay_s)} to it"
        )


def _delay_words(delay_s: float) -> str:
    """Return the effect that delays the command as a configuration has it."""
    forms = (cls.delaying(delay_s) for cls in known_effects().values())
    effect = next(form for form in forms if form is not None)
    options = ", ".join(f"{key}: {value:g}" for key, value in effect.options.model_dump().items())
    return f"{effect.name}: {{{options}}}"


def _range(axis: Axis, signal: Signal) -> tuple[float, float, float]:
    return parameter_range(axis.model, axis.estimates, signal)


def _coulomb_slope(effects: tuple[Effect, ...]) -> float:
    for effect in effects:
        if effect.proportional_to == "direction":
            return float(effect.constants[0])
    return 0.0
