"""What an effect is: one physical term of the force balance, in volts.

The model of an axis is a list of effects. Each contributes columns psi to

    u = sum over effects and their parameters of theta_i psi_i

(Chen, Yao, Wang 2013, eq. 4, solved for the command u; psi = -phi of their eq. 25).
A *state* effect's column is a function of motion and time; an *input* effect's column is
-h(u), so that the input map v(u) = u + sum theta_i h_i(u) equals the sum of the state columns.
A *command* effect is what happens to the command before it acts (lag, delay); a *measurement*
effect is an error of the measured position. These two have no linear parameters.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from copy import copy
from typing import ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from motorctl.model.parameter import Parameter
from motorctl.model.sought import Kind, Sought

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
T = TypeVar("T")


class EffectOptions(BaseModel):
    """Base of an effect's own options: its nonlinear parameters, fixed while running."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Effect(Sought):
    """Base of every effect: what is computed while an axis runs; `Sought` is what diagnosis asks.

    A subclass stands in a module of its own, which also defines the compiled kernels

        column(j, x, v, a, vs, t, c) -> float     for a state effect
        column(j, u, c) -> float and slope(j, u, c) -> float     for an input effect
        correct(y, c) -> float     for a measurement effect: the position without its error
        column(j, x, c) -> float     for a measurement effect with `amplitudes`: the error of the
                                     measured position at x for an amplitude of one

    Here j is the parameter's index within the effect, x [m], v [m/s], a [m/s^2] the motion,
    vs [m/s] a velocity free of quantisation (the desired one in the loop), t [s] the time,
    u [V] the command and c the numbers that `constants` gives: a tuple in the loop, an array
    where many forms are tried, so kernels only index it. An input effect's `column` is h(u)
    and `slope` dh/du.

    A state effect with a memory says how many numbers it holds (`memory`, or by instance
    `memory_size`); its kernels are ``column(j, x, v, a, vs, t, w, c)``, with w the memory after
    this tick, and ``advance(w, x, v, a, dt, others, c)``, which brings it up to the motion x, v, a
    that is reached dt [s] after the last. others[i] is (x, v, a) of the i-th of `other_axes`.
    An input effect that `varies` with place or time has ``column(j, u, x, t, c)`` and
    ``slope(j, u, x, t, c)``; one that `varies_with_velocity` has ``(j, u, x, vs, t, c)``. One with
    a memory has ``column(j, u, w, c)``, ``slope(j, u, w, c)`` (or ``(j, u, x, t, w, c)`` where it
    varies as well) and ``advance(w, u, dt, c)``: w is the memory after the last command that acted,
    so that from it the column is a function of u alone, and `advance` commits the command u that
    acts, dt [s] after the last. A memory begins as zeros, at rest.

    Kernels run in the real-time tick and must not raise: one that divides is decorated with
    ``njit(error_model="numpy")``, or 1/0 may end the loop. What is not finite trips the axis.
    """

    name: ClassVar[str]
    kind: ClassVar[Kind]
    electromagnetic: ClassVar[bool] = False
    """Part of what C2 compensates and C1 does not."""
    odd: ClassVar[bool] = False
    """An input effect whose h(-u) = -h(u)."""
    memory: ClassVar[int] = 0
    """Numbers that a state or an input effect remembers from tick to tick."""
    varies: ClassVar[bool] = False
    """An input effect that depends on place or time as well."""
    varies_with_velocity: ClassVar[bool] = False
    """An input effect that varies, with velocity too: friction that the motor's force causes."""
    title: ClassVar[str]
    formula: ClassVar[str]
    compensated: ClassVar[str]
    identified: ClassVar[str]
    visible_in: ClassVar[str]
    """What motion makes the effect visible."""
    Options: ClassVar[type[EffectOptions]] = EffectOptions
    load_sign: ClassVar[float] = 1.0
    """Sign of its parameters as forces on the load's side."""

    held: tuple[str, ...] = ()
    """Names of parameters that are zero and not fitted."""

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
    def memory_size(self) -> int:
        """Numbers that this form of the effect remembers."""
        return self.memory

    @property
    def stands_still(self) -> bool:
        """Whether the command alone decides what an input effect adds: no place, time or past."""
        return not (self.varies or self.remembers())

    @classmethod
    def remembers(cls) -> bool:
        """Return whether the kernels take a memory: they do in all forms, or in none."""
        return cls.memory > 0 or cls.memory_size is not Effect.memory_size

    @classmethod
    def place(cls, x: T, vs: T, t: T) -> tuple[T, ...]:
        """Return what the kernels of an input effect take between the command and the memory."""
        if cls.varies_with_velocity:
            return x, vs, t
        return (x, t) if cls.varies else ()

    def memories(self) -> Sequence[tuple[float, ...]]:
        """Return memories of an input effect at which the slope of its column is looked at.

        The command stays invertible (Assumption 2) at these, so the steepest fall that any history
        can lead to should be among them.

        Returns
        -------
        sequence of tuple of float
            Each of `memory_size` numbers; by default the memory at rest alone.
        """
        return ((0.0,) * self.memory_size,)

    @property
    def other_axes(self) -> tuple[str, ...]:
        """Axes whose motion the effect depends on."""
        return ()

    @property
    def lag_s(self) -> float:
        """First-order lag that a command effect gives the command."""
        return 0.0

    @property
    def delay_s(self) -> float:
        """Pure delay that a command effect gives the command."""
        return 0.0

    def way_of_rise_m(self, low: float, high: float) -> float:
        """Return the way in which a friction rises between two parts of itself [m].

        0 where it does not give before it slides.
        """
        return 0.0

    @property
    def is_spline(self) -> bool:
        """Whether the parameters are heights of a smooth function of no form of its own."""
        return False

    def over_acceleration(self, w: Array) -> ComplexArray | None:
        """Return the column over the acceleration in a frequency response.

        Parameters
        ----------
        w
            Frequencies (n,) [rad/s], above 0.

        Returns
        -------
        ndarray or None
            (n,) complex, the same for each of its parameters; None unless the column is linear in
            the acceleration and remembers it.
        """
        return None

    @property
    def column(self) -> Callable[..., float]:
        """The compiled column, taken from the effect's module."""
        return self.kernel("column")

    @property
    def slope(self) -> Callable[..., float]:
        """The compiled derivative of an input effect's column."""
        return self.kernel("slope")

    def with_options(self, **changes: object) -> Effect:
        """Return this effect with other options.

        Parameters
        ----------
        **changes
            New values by the options' names.

        Returns
        -------
        Effect
            A new one; this one stays as it is.

        Raises
        ------
        pydantic.ValidationError
            An option is unknown or its value is not allowed.
        """
        other = type(self)(self.Options.model_validate(self.options.model_dump() | changes))
        other.held = self.held
        return other

    def holding(self, parameters: Iterable[str]) -> Effect:
        """Return this effect with some parameters at zero, not to be fitted.

        Parameters
        ----------
        parameters
            Their names.
        """
        other = copy(self)
        other.held = tuple(dict.fromkeys((*self.held, *parameters)))
        return other

    def kernel(self, name: str) -> Callable[..., float]:
        """Return a compiled function of the effect's module, such as ``column`` or ``advance``."""
        kernel: Callable[..., float] = getattr(sys.modules[type(self).__module__], name)
        return kernel

    def full_name(self, parameter: Parameter) -> str:
        """Return the name of one of the effect's parameters in logs and reports."""
        return f"{self.name}_{parameter.name}" if parameter.name else self.name
