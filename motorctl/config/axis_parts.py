"""One axis while it is being checked: whatever of it could be read, so that all can be told."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from motorctl.axis_units import AxisUnits, units_of
from motorctl.config.analysis import required_command, smallest_slope
from motorctl.config.axis_keys import (
    Adaptation,
    Encoder,
    Experiments,
    Gains,
    Homing,
    Limits,
)
from motorctl.config.axis_model import AxisModel, build_model
from motorctl.config.dual_drive_keys import DualDrive
from motorctl.config.dual_drive_rules import (
    check_dual_drive,
    check_skew_guard,
    check_skew_loop,
)
from motorctl.config.guard_keys import Guards
from motorctl.config.guard_rules import (
    check_guards,
    check_overspeed,
    check_ramps,
    check_reactions,
)
from motorctl.config.hardware import Wiring, wire
from motorctl.config.heat_rules import count_noise_v
from motorctl.config.keys import Keys
from motorctl.config.loop_rules import check_monotonicity, check_stability
from motorctl.config.machine import Estimate
from motorctl.config.rules import (
    check_adaptation,
    check_encoder,
    check_experiments,
    check_gains,
    check_homing,
    check_limits,
    check_other_axes,
    check_timing,
    out_of_order,
)
from motorctl.config.validation import Finding, read_keys
from motorctl.errors import Problem
from motorctl.located_yaml import Document
from motorctl.model import EffectList
from motorctl.motion import AxisLimits, RequiredVoltage

K = TypeVar("K", bound=Keys)


@dataclass(frozen=True)
class AxisParts:
    """The parts of an axis; None where a part is missing or wrong."""

    name: str
    encoder: Encoder | None
    limits: Limits | None
    gains: Gains | None
    adaptation: Adaptation | None
    homing: Homing | None
    guards: Guards | None
    dual: DualDrive | None
    """None also where there is none."""
    declared: AxisModel | None
    model: EffectList | None
    """What the axis runs."""
    units: AxisUnits

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """The estimates of `model`."""
        if self.declared is None or self.model is None:
            return ()
        return self.declared.estimates_of(self.model)

    def problems(self, document: Document, findings: Iterable[Finding]) -> list[Problem]:
        """Return findings of the axis with their lines, in its own units."""
        return [
            document.problem(("axes", self.name, *where), self.units.words(message))
            for where, message in findings
        ]

    def motion_limits(self) -> AxisLimits | None:
        """Return what a program may ask of the axis."""
        limits = self.limits
        if limits is None or not limits.travel_m[0] < limits.travel_m[1]:
            return None
        return limits.for_motion()

    def required_voltage(self) -> RequiredVoltage | None:
        """Return the command that motion needs at theta_hat(0), where its map can be inverted."""
        if self.model is None or self.limits is None:
            return None
        theta = np.array([estimate.initial for estimate in self.estimates])
        u_max = self.limits.max_voltage_v
        if not smallest_slope(self.model, theta, u_max, self.limits.travel_m)[0] > 0.0:
            return None
        return required_command(self.model, theta, u_max)

    def count_noise_v(self, rate_hz: float) -> float | None:
        """Return what the steps of the count add to the command [V rms], None without the keys."""
        if self.gains is None or self.encoder is None:
            return None
        return count_noise_v(self.gains, self.encoder, rate_hz, 1 if self.dual is None else 2)

    def fullest_acceleration_m_s2(self) -> float:
        """Return what the full voltage accelerates at theta_hat(0), or the limit if it is more."""
        if self.limits is None:
            return 0.0
        mass = self.model.index_of("acceleration") if self.model else None
        if mass is None:
            return self.limits.max_acceleration_m_s2
        fullest = self.limits.max_voltage_v / self.estimates[mass].initial
        return max(fullest, self.limits.max_acceleration_m_s2)

    def least_inertia_v_s2_m(self) -> float:
        """Return the lower bound of the inertia; 0 where there is none."""
        mass = self.model.index_of("acceleration") if self.model else None
        return 0.0 if mass is None else self.estimates[mass].lower

    def wirings(self, document: Document) -> tuple[Wiring, ...]:
        """Return what the axis says of its channels; nothing where one of them cannot be read."""
        axis = document.part(("axes", self.name))
        driver, channel = axis.get("driver"), axis.get("channel")
        if self.encoder is None or self.limits is None:
            return ()
        if not isinstance(driver, str) or not isinstance(channel, int):
            return ()
        if self.dual is None and axis.get("dual_drive") is not None:
            return ()
        return wire(self.name, driver, channel, self.dual, self.encoder, self.limits)


def read_axis(document: Document, name: str) -> tuple[AxisParts, list[Problem]]:
    """Return what can be read of an axis, and the problems of its effects.

    Problems of the other keys are told by whoever validates the whole document.
    """
    axis = document.at(("axes", name))
    keys = axis if isinstance(axis, dict) else {}

    def part(key: str, model: type[K]) -> K | None:
        return read_keys(model, keys.get(key))

    units = units_of(keys.get("kind"))
    declared, problems = build_model(document, ("axes", name, "model"))
    problems = [replace(problem, message=units.words(problem.message)) for problem in problems]
    runs = None
    if declared and isinstance(axis, dict):
        controller = axis.get("controller", "C2")
        runs = declared.declared
        if controller != "C2":
            runs = runs.without_electromagnetic() if controller == "C1" else None
    parts = AxisParts(
        name,
        part("encoder", Encoder),
        part("limits", Limits),
        part("gains", Gains),
        part("adaptation", Adaptation) if "adaptation" in keys else Adaptation(),
        part("homing", Homing),
        part("guards", Guards) if "guards" in keys else Guards(),
        part("dual_drive", DualDrive),
        declared,
        runs,
        units,
    )
    return parts, problems


def check_axis(document: Document, parts: AxisParts, rate_hz: float | None) -> list[Problem]:
    """Apply every rule whose parts could be read; the rate is the axis' own [Hz]."""
    return parts.problems(document, _findings(document, parts, rate_hz))


def _findings(document: Document, parts: AxisParts, rate_hz: float | None) -> Iterator[Finding]:
    path = ("axes", parts.name)
    limits, encoder, adaptation = parts.limits, parts.encoder, parts.adaptation
    # As it is written, so that it is told beside whatever else is wrong with the limits.
    if message := out_of_order(document.at((*path, "limits", "travel_m"))):
        yield ("limits", "travel_m"), message
    if parts.units.kind == "rotary" and document.at((*path, "dual_drive")) is not None:
        yield ("dual_drive",), "is of a linear axis: the two ends of a beam; remove it"
    if parts.guards:
        yield from check_reactions(parts.guards)
    if limits:
        yield from check_limits(limits)
        if parts.dual:
            yield from check_dual_drive(parts.dual, limits, parts.homing, parts.guards)
        whole = parts.dual or document.at((*path, "dual_drive")) is None
        if parts.guards and whole:
            yield from check_skew_guard(parts.dual, parts.guards, limits, encoder)
        experiments = read_keys(Experiments, document.at((*path, "experiments")))
        if experiments:
            yield from check_experiments(experiments, limits)
        if parts.homing:
            yield from check_homing(parts.homing, limits, encoder)
        if encoder and rate_hz:
            yield from check_encoder(encoder, limits, rate_hz)
        if encoder and rate_hz and parts.guards:
            fullest_m_s2 = parts.fullest_acceleration_m_s2()
            yield from check_guards(parts.guards, limits, encoder, rate_hz, fullest_m_s2)
        yield from check_ramps(limits, parts.least_inertia_v_s2_m())
        if encoder and rate_hz:
            least_inertia = parts.least_inertia_v_s2_m()
            yield from check_overspeed(limits, encoder, rate_hz, least_inertia)
        if parts.model and adaptation:
            yield from check_monotonicity(
                parts.model,
                parts.estimates,
                limits.max_voltage_v,
                adaptation.monotonicity_margin,
                limits.travel_m,
            )
    if parts.declared:
        keys, axes = document.part((*path, "model")), document.part(("axes",))
        yield from check_other_axes(parts.name, parts.declared.declared, keys, axes)
    if rate_hz and adaptation:
        yield from _sampling_findings(parts, adaptation, rate_hz)


def _sampling_findings(
    parts: AxisParts, adaptation: Adaptation, rate_hz: float
) -> Iterator[Finding]:
    """Apply the rules of the sampling; margins are computed where these leave nothing to say."""
    found = list(check_adaptation(adaptation, rate_hz))
    if parts.model:
        found += check_timing(parts.model, adaptation.input_delay_s, rate_hz)
    if parts.dual and parts.model and not found:
        yield from check_skew_loop(parts.dual.skew, parts.model, adaptation.input_delay_s, rate_hz)
    if parts.gains and parts.model:
        found += check_gains(parts.gains, rate_hz)
        if not found:
            yield from check_stability(
                parts.model,
                parts.estimates,
                parts.gains,
                1.0 / rate_hz,
                adaptation.input_delay_s,
            )
    yield from found
