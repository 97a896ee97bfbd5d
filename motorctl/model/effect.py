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
from abc import ABC
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from types import MappingProxyType
from typing import ClassVar, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from motorctl.model.knowledge import (
    FAMILY_OF_GROUP,
    CarriedOver,
    Family,
    Group,
    Motion,
    Picture,
    Signal,
    Spans,
)
from motorctl.model.parameter import Parameter

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
T = TypeVar("T")
Kind = Literal["state", "input", "command", "measurement"]
End = Literal["either", "upper", "neither"]


FAMILY_OF_KIND: Mapping[Kind, Family] = {
    "state": "moving_mass",
    "input": "thrust",
    "command": "command_timing",
    "measurement": "measurement",
}
"""The family of an effect whose groups tell none."""


class EffectOptions(BaseModel):
    """Base of an effect's own options: its nonlinear parameters, fixed while running."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Effect(ABC):
    """Base of every effect.

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
    groups: ClassVar[frozenset[Group]] = frozenset()
    """The kinds that it belongs to; effects that share one may be taken for each other."""
    proportional_to: ClassVar[Signal | None] = None
    """The signal that the one column of a basic effect is. Each signal has one basic effect."""
    amplitudes: ClassVar[tuple[str, ...]] = ()
    """Options of a measurement effect in which its error is linear [m]; without them diagnosis does
    not look for it."""
    ordinary: ClassVar[bool] = False
    """Common on sound machines: a motion that could not have shown it proves no model complete."""
    scan_shows_part: ClassVar[bool] = False
    """A first look, with one line or coarse columns, shows only a part of what it explains."""
    leaves_bursts: ClassVar[bool] = False
    """Of impacts, which no form follows closely: what it leaves does not speak against it."""
    sets_in: ClassVar[bool] = False
    """Sets in at once, at a time of its own."""
    refuted_at_end: ClassVar[Mapping[str, End]] = MappingProxyType({})
    """At which end of its range (see `ranges`) an option means another effect: that refutes it.

    "upper" for an option that is refined and not named here; "neither" where both ends are limits
    that the effect comes to by nature, such as a time constant beyond the recording.
    """
    usual: ClassVar[Mapping[str, float]] = MappingProxyType({})
    """Parameters of an input effect whose value is known before any recording: taken where the rows
    at hand hardly show the effect."""
    revealed_by: ClassVar[tuple[Motion, ...]] = ()
    """Motions that show it and tell it from others, besides moves all over the travel."""
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

    @classmethod
    def family(cls) -> Family:
        """Return the kind of physics that it belongs to: what is sure where the member is not."""
        for group, family in FAMILY_OF_GROUP.items():
            if group in cls.groups:
                return family
        return FAMILY_OF_KIND[cls.kind]

    @property
    def lines(self) -> tuple[float, ...]:
        """Wave numbers [1/m] or frequencies [Hz] at which it shows as lines of a spectrum."""
        return ()

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
    def repeats_every(self) -> float:
        """Length [m] or time [s] after which it repeats; 0 where it does not."""
        return 0.0

    @property
    def remark(self) -> str:
        """What its options say of the recording, where a reader should think twice; usually ""."""
        return ""

    @property
    def picture(self) -> Picture:
        """How it is drawn."""
        return Picture("over_time", "What it adds to the command, over time.")

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return the forms that diagnosis tries first, in the order of their nonlinear option.

        Parameters
        ----------
        spans
            What the recording spans: travel [m], top speed [m/s], duration [s] and the like.

        Returns
        -------
        sequence of Effect
            One form without options; empty where the recording cannot show the effect.
        """
        return (cls(),)

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Return the options that diagnosis refines.

        Parameters
        ----------
        spans
            What the recording spans.

        Returns
        -------
        mapping
            A first step for each option, in the option's own unit.
        """
        return {}

    def ranges(self, spans: Spans) -> Mapping[str, tuple[float, float]]:
        """Return between what values options that are refined mean this effect.

        Only for places and times. A size, which is never zero, may leave the range of the forms
        that are tried by a factor.

        Parameters
        ----------
        spans
            What the recording spans.

        Returns
        -------
        mapping
            Lowest and highest value, in the option's own unit; nothing for an option without end.
        """
        return {}

    def contradicted_by(self, spans: Spans) -> str | None:
        """Return what of a recording this form itself says cannot be, or None.

        Parameters
        ----------
        spans
            What the recording spans.

        Returns
        -------
        str or None
            The end of "it is refuted:", with the numbers of both.
        """
        return None

    def richer(self, spans: Spans) -> Sequence[Effect]:
        """Return forms one step richer than this one, which diagnosis takes where they pay.

        Parameters
        ----------
        spans
            What the recording spans.

        Returns
        -------
        sequence of Effect
            Empty where there is no richer form.
        """
        return ()

    def corner(self) -> Effect | None:
        """Return the form of a friction that is but its corner at rest; None: it has none.

        How any friction turns over at zero speed is mended first. Where this form explains nearly
        as much as the effect itself, nothing else was seen, and the effect is not named.
        """
        return None

    @classmethod
    def typical(cls, spans: Spans) -> Effect | None:
        """Return a form of middling options, to ask whether a motion could show it, or None."""
        forms = list(cls.trials(spans))
        return forms[len(forms) // 2] if forms else None

    @classmethod
    def delaying(cls, delay_s: float) -> Effect | None:
        """Return the form that only delays the command by `delay_s` [s]; None if there is none."""
        return None

    @classmethod
    def at_line(cls, line: float) -> Effect:
        """Return the form of a wave with one line.

        Parameters
        ----------
        line
            A wave number [1/m] or a frequency [Hz].

        Returns
        -------
        Effect
            The form.

        Raises
        ------
        TypeError
            The effect belongs to a group of waves and does not define this.
        """
        raise TypeError(f"{cls.__name__} is a wave and does not define at_line")

    @classmethod
    def smooth_function(cls, variables: Sequence[str], spans: Spans) -> Effect | None:
        """Return a form that takes any smooth function of `variables`; None where there is none.

        Parameters
        ----------
        variables
            Of position, velocity, command, time, history: what unknown structure depends on.
        spans
            What the recording spans.
        """
        return None

    @classmethod
    def over_place(cls, knots: tuple[float, float, int]) -> Effect | None:
        """Return a form that takes any smooth force of position; None where there is none.

        Parameters
        ----------
        knots
            From and to where [m], and how many splines.
        """
        return None

    def on_own_acceleration(self, theta: Sequence[float]) -> tuple[Effect, tuple[float, ...]]:
        """Return a resonance as it acts on the machine's own acceleration.

        It was fitted on the acceleration that the machine would have if it were rigid.

        Parameters
        ----------
        theta
            Its parameters there, in parts of the inertia, in the order of `parameters`.

        Returns
        -------
        effect
            The form on the machine's own acceleration.
        theta
            Its parameters, in parts of the inertia.
        """
        return self, tuple(theta)

    def on_rigid_acceleration(self, theta: Sequence[float]) -> tuple[Effect, tuple[float, ...]]:
        """Return a resonance as it acts on the acceleration of a rigid machine.

        The reverse of `on_own_acceleration`: to predict a motion from the command.

        Parameters
        ----------
        theta
            Its parameters on the machine's own acceleration, in parts of the inertia.

        Returns
        -------
        effect
            The form on what the machine would do if it were rigid.
        theta
            Its parameters there, in parts of the inertia.
        """
        return self, tuple(theta)

    def carry_over(self, theta: Sequence[float], spans: Spans) -> CarriedOver:
        """Return what of the effect belongs into a configuration.

        Parameters
        ----------
        theta
            Its fitted parameters, in the order and the units of `parameters`.
        spans
            What the recording spans.

        Returns
        -------
        CarriedOver
            By default the effect as it is.
        """
        return CarriedOver()

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
