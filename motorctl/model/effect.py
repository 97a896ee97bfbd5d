"""What an effect is: one physical term of the force balance, in volts.

The model of an axis is a list of effects. Each contributes columns psi to

    u = sum over effects and their parameters of theta_i psi_i

(Chen, Yao, Wang 2013, eq. 4, solved for the command u; psi = -phi of their eq. 25).
A *state* effect's column is a function of motion and time; an *input* effect's column is
-h(u), so that the input map v(u) = u + sum theta_i h_i(u) equals the sum of the state columns.
"""

from __future__ import annotations

import sys
from abc import ABC
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict

from motorctl.errors import UsageError

Kind = Literal["state", "input"]


@dataclass(frozen=True)
class Parameter:
    """One linear parameter theta of an effect."""

    name: str
    """Unique within the effect; empty where the effect has this parameter only."""
    symbol: str
    unit: str
    lower: float
    """Widest bounds that make physical sense, unless the configuration gives narrower ones."""
    upper: float
    initial: float
    covariance: float
    """Default initial diagonal of Gamma: how far from `initial` the truth may lie, squared."""


class EffectOptions(BaseModel):
    """Base of an effect's own options: its nonlinear parameters, fixed while running."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Effect(ABC):
    """Base of every effect.

    A subclass stands in a module of its own, which also defines the compiled kernels

        column(j, x, v, a, vs, t, c) -> float     for a state effect
        column(j, u, c) -> float and slope(j, u, c) -> float     for an input effect

    Here j is the parameter's index within the effect, x [m], v [m/s], a [m/s^2] the motion,
    vs [m/s] a velocity free of quantisation (the desired one in the loop), t [s] the time,
    u [V] the command and c the tuple that `constants` gives. An input effect's `column` is h(u)
    and `slope` dh/du.

    Kernels run in the real-time tick and must not raise: one that divides is decorated with
    ``njit(error_model="numpy")``, or 1/0 ends the loop. What is not finite trips the axis.
    """

    name: ClassVar[str]
    kind: ClassVar[Kind]
    electromagnetic: ClassVar[bool] = False
    """Part of what C2 compensates and C1 does not."""
    odd: ClassVar[bool] = False
    """An input effect whose h(-u) = -h(u)."""
    title: ClassVar[str]
    formula: ClassVar[str]
    compensated: ClassVar[str]
    identified: ClassVar[str]
    visible_in: ClassVar[str]
    """What motion makes the effect visible."""
    Options: ClassVar[type[EffectOptions]] = EffectOptions

    def __init__(self, options: EffectOptions | None = None) -> None:
        self.options = self.Options() if options is None else options

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The linear parameters, in the order of the kernel's index j."""
        raise TypeError(f"{type(self).__name__} does not define its parameters")

    @property
    def constants(self) -> tuple[float, ...]:
        """The fixed numbers that the kernels get as c."""
        return (0.0,)

    @property
    def column(self) -> Callable[..., float]:
        """The compiled column, taken from the effect's module."""
        return self._kernel("column")

    @property
    def slope(self) -> Callable[..., float]:
        """The compiled derivative of an input effect's column."""
        return self._kernel("slope")

    def _kernel(self, name: str) -> Callable[..., float]:
        kernel: Callable[..., float] = getattr(sys.modules[type(self).__module__], name)
        return kernel

    def full_name(self, parameter: Parameter) -> str:
        """Name one of the effect's parameters in logs and reports."""
        return f"{self.name}_{parameter.name}" if parameter.name else self.name


def make_effect(cls: type[Effect], options: Mapping[str, Any] | None = None) -> Effect:
    """Make an effect from plain options; raises pydantic.ValidationError where they are wrong."""
    if not getattr(cls, "name", ""):
        raise UsageError(f"effect class {cls.__module__}:{cls.__qualname__} has no name")
    return cls(cls.Options.model_validate(dict(options or {})))
