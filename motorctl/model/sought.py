"""What an effect tells those who look for it in a recording, draw it, or write it down.

None of it is asked while an axis runs.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar, Literal, cast

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

if TYPE_CHECKING:
    from motorctl.model.effect import Effect

Kind = Literal["state", "input", "command", "measurement"]
End = Literal["either", "upper", "neither"]

FAMILY_OF_KIND: Mapping[Kind, Family] = {
    "state": "moving_mass",
    "input": "thrust",
    "command": "command_timing",
    "measurement": "measurement",
}
"""The family of an effect whose groups tell none."""


class Sought(ABC):
    """The part of an effect that identification asks; `motorctl.model.Effect` adds what runs."""

    kind: ClassVar[Kind]
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
    valleys_along: ClassVar[str] = ""
    """An option along which a scan has more than one valley: all options are then sought by
    evolution, within their ranges."""
    may_lack: ClassVar[tuple[str, ...]] = ()
    """Options that are often zero: a form in which they are is taken unless they pay."""
    leaves_bursts: ClassVar[bool] = False
    """Of impacts, which no form follows closely: what it leaves does not speak against it."""
    told_by_other_speeds: ClassVar[bool] = False
    """A force that may stand for friction of another shape, where a motion passes each speed at one
    place or time only: it is named beside a function of speed alone, or not at all."""
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
    corner_is: ClassVar[str] = "that is only how friction turns over at rest"
    """What the form of its `corner` is, and what would tell the two apart: told where it is refuted
    for that."""
    revealed_by: ClassVar[tuple[Motion, ...]] = ()
    """Motions that show it and tell it from others, besides moves all over the travel."""

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
        return (cast("Effect", cls()),)

    @classmethod
    def trials_beyond(cls, spans: Spans) -> Sequence[Effect]:
        """Return what is tried as well where the last of `trials` is the best of them.

        Parameters
        ----------
        spans
            What the recording spans.

        Returns
        -------
        sequence of Effect
            In the order of the nonlinear option, on from the last of `trials`; usually empty.
        """
        return ()

    @classmethod
    def ringing_at(cls, line_hz: float, spans: Spans) -> Sequence[Effect]:
        """Return forms that ring at a line of what is left, tried where a wave over time has one.

        Parameters
        ----------
        line_hz
            The line's frequency [Hz].
        spans
            What the recording spans.

        Returns
        -------
        sequence of Effect
            Besides `trials`, which may leave such forms out, as few motions show them; usually
            empty.
        """
        return ()

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

        Only for places and times, for sizes that may be zero, and for forms that `trials` leaves
        out. Any other size may leave the range of the forms that are tried by a factor.

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

        At zero speed, or where it turns round: that is mended first. Where this form explains
        nearly as much as the effect itself, nothing else was seen, and the effect is not named.
        """
        return None

    @property
    def only_corner_is_left(self) -> bool:
        """Whether the friction beside it turns over so quickly that a corner adds nothing to it."""
        return True

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
        return cast("Effect", self), tuple(theta)

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
        return cast("Effect", self), tuple(theta)

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
