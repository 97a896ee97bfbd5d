"""What a picture of a diagnosis is made of: signals of one axis in units for people."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from motorctl.identify.columns.measured import Array
from motorctl.identify.diagnose.report.parameter_text import pretty
from motorctl.identify.diagnose.result import AxisDiagnosis, FoundEffect, Traces
from motorctl.model import Effect, EffectList
from motorctl.model.columns import input_columns, state_columns
from motorctl.model.knowledge import Signal

MOST_NAMES = 2
"""Names of effects in a legend: more do not fit and are summed up in words. Chosen by hand."""


@dataclass(frozen=True)
class AxisSignals:
    """One axis with its signals; arrays of shape (m,) as in `Traces`."""

    name: str
    diagnosis: AxisDiagnosis
    traces: Traces
    others: Mapping[str, Traces] = field(default_factory=dict)
    """Signals of the other diagnosed axes."""

    @property
    def command_unit(self) -> str:
        """As it stands on axes."""
        return pretty(self.diagnosis.data.command_unit)

    @property
    def force_per_command(self) -> float | None:
        """None where it is not known."""
        return self.diagnosis.data.force_per_command

    @property
    def force_unit(self) -> str:
        """As it stands on axes."""
        return pretty(self.diagnosis.data.force_unit)

    @property
    def place(self) -> tuple[float, str]:
        """Factor and unit in which positions are drawn."""
        return (1e3, "mm") if self.diagnosis.data.position_unit == "m" else (1.0, "rad")

    @property
    def small_place(self) -> tuple[float, str]:
        """Factor and unit in which small displacements are drawn."""
        return 1e6, f"µ{self.diagnosis.data.position_unit}"

    @property
    def push(self) -> str:
        """What a force on the axis is called."""
        return "force on the carriage" if self.diagnosis.data.position_unit == "m" else "torque"

    @property
    def effect_names(self) -> str:
        """What the whole model has beyond the declared one, in words."""
        found = [effect.name for effect in self.diagnosis.effects]
        unknown = self.diagnosis.unknown
        if unknown is not None and unknown.compensation is not None:
            found.append(f"spline ({unknown.compensation.name})")
        return " + ".join(found) if len(found) <= MOST_NAMES else "the effects found"

    def contribution(self, name: str) -> Array:
        """What an effect adds to the command; zero where that is not told."""
        found = self.traces.contributions.get(name)
        return np.zeros(len(self.traces.time_s)) if found is None else found

    def partial(self, name: str) -> Array:
        """The part of the command that everything but this effect leaves."""
        return self.traces.residual_after + self.contribution(name)

    def coefficient(self, signal: Signal) -> float:
        """Return what multiplies a signal in the whole model; 0 where nothing does."""
        return self.diagnosis.model.coefficient(self.diagnosis.theta, signal)

    def declared_coefficient(self, signal: Signal) -> float:
        """Return the same of the declared model where it is fitted alone."""
        return self.diagnosis.declared.coefficient(self.diagnosis.declared_theta, signal)

    @property
    def reference_acceleration(self) -> Array | None:
        """The desired acceleration at the rows; None where there is no reference."""
        data, t = self.diagnosis.data, self.traces.time_s
        if data.reference is None or len(t) < 2:
            return None
        step = float(np.median(np.diff(t)))
        ahead, here, back = (
            np.interp(t + shift, data.time_s, data.reference) for shift in (step, 0.0, -step)
        )
        return np.asarray((ahead - 2.0 * here + back) / step**2)

    @cached_property
    def declared_friction(self) -> Array:
        """Friction as the declared model has it where it is fitted alone."""
        return self._friction(
            self.diagnosis.declared, self.diagnosis.declared, self.diagnosis.declared_theta
        )

    @cached_property
    def friction_model(self) -> Array:
        """Friction as the whole model has it."""
        found = {effect.name for effect in self.diagnosis.effects}
        declared = EffectList([e for e in self.diagnosis.declared.effects if e.name not in found])
        total = self._friction(declared, self.diagnosis.model, self.diagnosis.theta)
        for name, contribution in self.traces.contributions.items():
            if name in self._friction_names:
                total = total + contribution
        return total

    @property
    def constant(self) -> float:
        """The constant part of what the whole model adds to the command beside friction."""
        others = [
            c for name, c in self.traces.contributions.items() if name not in self._friction_names
        ]
        return sum((float(np.mean(c)) for c in others), -self.coefficient("one"))

    @cached_property
    def _friction_names(self) -> frozenset[str]:
        return frozenset(e.name for e in self.diagnosis.model.effects if "friction" in e.groups)

    def _friction(self, effects: EffectList, model: EffectList, theta_hat: Array) -> Array:
        """Return the friction of some effects with the parameters that a model has for them."""
        traces, total = self.traces, np.zeros(len(self.traces.time_s))
        known = dict(zip(model.parameter_names, theta_hat, strict=False))
        for effect in effects.effects:
            if "friction" in effect.groups:
                names = [effect.full_name(p) for p in effect.parameters]
                theta = np.array([known.get(name, 0.0) for name in names])
                total += column_sum(
                    effect,
                    theta,
                    position=traces.position,
                    velocity=traces.velocity,
                    time=traces.time_s,
                    command=traces.command,
                )
        return total

    def force_over(
        self,
        found: FoundEffect,
        *,
        position: Array | float = 0.0,
        velocity: Array | float = 0.0,
        time: Array | float = 0.0,
        command: Array | float = 0.0,
    ) -> Array:
        """What a found effect adds to the command at these places; arrays of one shape (k,)."""
        return column_sum(
            found.effect,
            found.theta,
            position=position,
            velocity=velocity,
            time=time,
            command=command,
        )


def column_sum(
    effect: Effect,
    theta: Array,
    *,
    position: Array | float = 0.0,
    velocity: Array | float = 0.0,
    time: Array | float = 0.0,
    command: Array | float = 0.0,
) -> Array:
    """Return theta psi of a state or an input effect over arrays of one shape (k,)."""
    x, v, t, u = (
        np.ascontiguousarray(part, np.float64)
        for part in np.broadcast_arrays(position, velocity, time, command)
    )
    if effect.kind == "input":
        return np.asarray(theta @ input_columns(effect, u, x, v, t))
    return np.asarray(theta @ state_columns(effect, x, v, np.zeros(len(x)), v, t))
