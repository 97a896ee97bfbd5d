"""What an effect has to keep, looked at when it is loaded: each refusal tells the member and why.

What is cheap is asked here. What is dear, such as whether a slope is the derivative of its column
wherever one looks, is left to `motorctl.model.conformance`.
"""

from __future__ import annotations

import inspect
import math
import sys
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, get_args

from numba.core.dispatcher import Dispatcher

from motorctl.errors import UsageError
from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.knowledge import (
    CarriedOver,
    Group,
    Motion,
    Picture,
    PictureKind,
    Signal,
    Spans,
)
from motorctl.model.parameter import Parameter
from motorctl.model.pitch import PitchOptions
from motorctl.model.sought import End, Kind

TEXTS = ("title", "formula", "compensated", "identified", "visible_in")
FLAGS = (
    "electromagnetic",
    "odd",
    "varies",
    "varies_with_velocity",
    "ordinary",
    "scan_shows_part",
    "leaves_bursts",
    "told_by_other_speeds",
)
WAVES = ("wave_over_position", "wave_over_time")
OVER_A_PITCH = ("folded_over_pitch", "thrust_over_position")
"""Pictures of waves along the way."""
TO_SCALE = (
    *OVER_A_PITCH, "error_over_period", "acting_command", "force_response", "folded_over_time",
)  # fmt: skip
"""Pictures that need a length, a voltage, a frequency or a time of the effect's own."""
VARIABLES = ("position", "velocity", "command", "time", "history")
"""What unknown structure may depend on."""
ORDINARY = Spans(
    position_m=(-0.2, 0.2),
    speed_m_s=1.0,
    acceleration_m_s2=10.0,
    command_v=8.0,
    time_s=(0.0, 20.0),
    period_s=2e-4,
    band_hz=200.0,
    resolution_m=5e-7,
    other_axes=("beside",),
)
"""An ordinary recording, for which every effect has to answer."""
LINE = 20.0
"""A wave number [1/m] or a frequency [Hz] for which every wave has a form. Any other would do that
effects' options take. Chosen by hand: eight waves over the ordinary travel."""


class Refusal:
    """Raises UsageError for one effect, each time with a member and what was expected of it."""

    def __init__(self, who: str) -> None:
        self.who = who

    def __call__(self, member: str, what: str) -> UsageError:
        """Return the error for a member; `what` says what is wrong with it and what is right."""
        return UsageError(f"{self.who}: {member} {what}")

    def asked(self, member: str, question: Callable[[], Any]) -> Any:
        """Return what a member answers. Raises UsageError where it raises anything at all."""
        try:
            return question()
        except Exception as error:  # an effect of a third party may fail in any way
            raise self(member, f"raises {type(error).__name__}: {error}") from error

    def among(self, member: str, given: Iterable[object], possible: Iterable[str]) -> None:
        """Raise UsageError where something given is none of what is possible."""
        known = list(possible)
        for one in given:
            if one not in known:
                raise self(member, f"names {one!r}; expected one of: {', '.join(known) or '-'}")


def check_class(cls: type[Effect], who: str) -> None:
    """Check what the class says, and answers for an ordinary recording.

    Parameters
    ----------
    cls
        The effect.
    who
        How messages name it.

    Raises
    ------
    UsageError
        Where it does not keep the contract of `motorctl.model.Effect`.
    """
    refuse = Refusal(who)
    _check_words(cls, refuse)
    _check_knowledge(cls, refuse)
    _check_memory(cls, refuse)
    for kernel, arguments in kernels_of(cls).items():
        _check_kernel(cls, kernel, arguments, refuse)
    refuse.asked("trials", lambda: list(cls.trials(ORDINARY)))
    refuse.asked("trials_beyond", lambda: list(cls.trials_beyond(ORDINARY)))
    ringing = refuse.asked("ringing_at", lambda: list(cls.ringing_at(LINE, ORDINARY)))
    if not all(isinstance(form, cls) for form in ringing):
        raise refuse("ringing_at", f"returns {ringing!r}; expected forms of the effect")
    typical = refuse.asked("typical", lambda: cls.typical(ORDINARY))
    if not (typical is None or isinstance(typical, cls)):
        raise refuse("typical", f"returns {typical!r}; expected a form of the effect, or None")
    for variable in VARIABLES:
        smooth = refuse.asked(
            "smooth_function", partial(cls.smooth_function, (variable,), ORDINARY)
        )
        if not (smooth is None or isinstance(smooth, cls)):
            raise refuse(
                "smooth_function", f"returns {smooth!r}; expected a form of the effect, or None"
            )
    if cls.groups.intersection(WAVES):
        wave = refuse.asked("at_line", lambda: cls.at_line(LINE))
        if not isinstance(wave, cls):
            raise refuse("at_line", f"returns {wave!r}; expected a form of the effect")


def check_effect(effect: Effect, who: str) -> None:
    """Check what an effect says with its options in place.

    Parameters
    ----------
    effect
        One form of it.
    who
        How messages name it.

    Raises
    ------
    UsageError
        Where it does not keep the contract of `motorctl.model.Effect`.
    """
    refuse = Refusal(who)
    parameters = refuse.asked("parameters", lambda: tuple(effect.parameters))
    _check_parameters(effect, parameters, refuse)
    constants = refuse.asked("constants", lambda: [float(c) for c in effect.constants])
    if not constants or any(math.isnan(constant) for constant in constants):
        raise refuse("constants", f"gives {constants}; expected at least one, and numbers")
    size = refuse.asked("memory_size", lambda: effect.memory_size)
    if not isinstance(size, int) or size < 0:
        raise refuse("memory_size", f"gives {size!r}; expected how many numbers are remembered")
    others = refuse.asked("other_axes", lambda: tuple(effect.other_axes))
    if not all(isinstance(axis, str) for axis in others):
        raise refuse("other_axes", f"gives {others}; expected names of axes")
    if others and not (effect.kind == "state" and effect.remembers()):
        raise refuse("other_axes", "is for a state effect with a memory, which `advance` fills")
    for member in ("lag_s", "delay_s", "repeats_every"):
        value = refuse.asked(member, partial(_number, effect, member))
        if not 0.0 <= value < math.inf:
            raise refuse(member, f"gives {value}; expected a finite number of at least 0")
        if value and member != "repeats_every" and effect.kind != "command":
            raise refuse(member, f"gives {value}; expected 0, for its kind is '{effect.kind}'")
    lines = refuse.asked("lines", lambda: [float(line) for line in effect.lines])
    if not all(0.0 < line < math.inf for line in lines):
        raise refuse("lines", f"gives {lines}; expected wave numbers or frequencies above 0")
    picture = refuse.asked("picture", lambda: effect.picture)
    if not isinstance(picture, Picture):
        raise refuse("picture", f"gives {picture!r}; expected a motorctl.model.Picture")
    refuse.among("picture", [picture.kind], get_args(PictureKind))
    if picture.kind in TO_SCALE and not 0.0 < picture.scale < math.inf:
        raise refuse("picture", f"{picture.kind} has a scale of {picture.scale}; expected above 0")
    if picture.kind in OVER_A_PITCH and not (lines and effect.repeats_every):
        raise refuse(
            "picture", f"{picture.kind} is of a wave; expected lines and repeats_every with it"
        )
    if effect.kind == "input" and effect.remembers():
        memories = refuse.asked("memories", lambda: [tuple(m) for m in effect.memories()])
        if not memories or any(len(memory) != size for memory in memories):
            raise refuse("memories", f"gives {memories}; expected memories of {size} numbers each")
    steps = refuse.asked("steps", lambda: dict(effect.steps(ORDINARY)))
    refuse.among("steps", steps, type(effect.options).model_fields)
    if not all(0.0 < step < math.inf for step in steps.values()):
        raise refuse("steps", f"gives {steps}; expected a first step above 0 for each option")
    theta = [parameter.initial for parameter in parameters]
    carried = refuse.asked("carry_over", lambda: effect.carry_over(theta, ORDINARY))
    if not isinstance(carried, CarriedOver):
        raise refuse("carry_over", f"returns {carried!r}; expected a motorctl.model.CarriedOver")
    refuse.among("carry_over", carried.adds, get_args(Signal))


def kernels_of(cls: type[Effect]) -> dict[str, str]:
    """Return the compiled functions that an effect's module needs, each with its arguments."""
    w = "w, " if cls.remembers() else ""
    place = "".join(f"{name}, " for name in cls.place("x", "vs", "t"))
    kernels: dict[str, str] = {}
    if cls.kind == "state":
        kernels["column"] = f"j, x, v, a, vs, t, {w}c"
        advance = "w, x, v, a, dt, others, c"
    else:
        advance = "w, u, dt, c"
    if cls.kind == "input":
        kernels["column"] = kernels["slope"] = f"j, u, {place}{w}c"
    if cls.kind == "measurement":
        kernels["correct"] = "y, c"
        if cls.amplitudes:
            kernels["column"] = "j, x, c"
    if cls.remembers():
        kernels["advance"] = advance
    return kernels


def _check_words(cls: type[Effect], refuse: Refusal) -> None:
    if not cls.name.isidentifier():
        raise refuse("name", f"is '{cls.name}'; expected letters, digits and _")
    kind = getattr(cls, "kind", None)
    if kind not in get_args(Kind):
        raise refuse("kind", f"is {kind!r}; expected one of: {', '.join(get_args(Kind))}")
    for text in TEXTS:
        words = getattr(cls, text, None)
        if not (isinstance(words, str) and words.strip()):
            raise refuse(text, f"is {words!r}; expected a text on the class")
    if not (isinstance(cls.Options, type) and issubclass(cls.Options, EffectOptions)):
        raise refuse("Options", "is no class derived from motorctl.model.EffectOptions")
    for flag in FLAGS:
        if not isinstance(getattr(cls, flag), bool):
            raise refuse(flag, f"is {getattr(cls, flag)!r}; expected True or False")
    for flag in ("odd", "varies"):
        if getattr(cls, flag) and cls.kind != "input":
            raise refuse(flag, f"is for input effects; its kind is '{cls.kind}'")
    if cls.varies_with_velocity and not cls.varies:
        raise refuse("varies_with_velocity", "is for effects that vary: expected varies = True")


def _check_knowledge(cls: type[Effect], refuse: Refusal) -> None:
    options = cls.Options.model_fields
    refuse.among("groups", refuse.asked("groups", lambda: list(cls.groups)), get_args(Group))
    motions = refuse.asked("revealed_by", lambda: list(cls.revealed_by))
    refuse.among("revealed_by", motions, get_args(Motion))
    amplitudes = refuse.asked("amplitudes", lambda: list(cls.amplitudes))
    if amplitudes and cls.kind != "measurement":
        raise refuse("amplitudes", f"is for measurement effects; its kind is '{cls.kind}'")
    refuse.among("amplitudes", amplitudes, options)
    if cls.valleys_along:
        refuse.among("valleys_along", [cls.valleys_along], options)
    refuse.among("may_lack", refuse.asked("may_lack", lambda: list(cls.may_lack)), options)
    ends = refuse.asked("refuted_at_end", lambda: dict(cls.refuted_at_end))
    refuse.among("refuted_at_end", ends, options)
    refuse.among("refuted_at_end", ends.values(), get_args(End))
    usual = refuse.asked("usual", lambda: dict(cls.usual))
    if usual and cls.kind != "input":
        raise refuse("usual", f"is for input effects; its kind is '{cls.kind}'")
    if cls.proportional_to is not None:
        refuse.among("proportional_to", [cls.proportional_to], get_args(Signal))
    if "wave_over_position" in cls.groups and not issubclass(cls.Options, PitchOptions):
        raise refuse(
            "Options", "is no PitchOptions, which an effect of the group wave_over_position has"
        )
    if cls.groups.intersection(WAVES) and _is_inherited(cls, "at_line"):
        raise refuse("at_line", f"is missing; a {' and '.join(cls.groups)} has it")


def _check_memory(cls: type[Effect], refuse: Refusal) -> None:
    if not isinstance(cls.memory, int) or cls.memory < 0:
        raise refuse("memory", f"is {cls.memory!r}; expected how many numbers it remembers")
    if cls.remembers() and cls.kind not in ("state", "input"):
        raise refuse("memory", f"is for state and input effects; its kind is '{cls.kind}'")


def _check_kernel(cls: type[Effect], kernel: str, arguments: str, refuse: Refusal) -> None:
    module = sys.modules[cls.__module__]
    found = getattr(module, kernel, None)
    # Only compiled functions can be called from the compiled tick.
    if not isinstance(found, Dispatcher):
        raise refuse(
            kernel,
            f"is missing: expected {kernel}({arguments}) decorated with numba's njit in its "
            f"module {cls.__module__}",
        )
    given = inspect.signature(found.py_func).parameters
    if len(given) != len(arguments.split(", ")):
        raise refuse(kernel, f"is {kernel}({', '.join(given)}); expected {kernel}({arguments})")


def _check_parameters(effect: Effect, parameters: tuple[Any, ...], refuse: Refusal) -> None:
    if not all(isinstance(parameter, Parameter) for parameter in parameters):
        raise refuse("parameters", f"gives {parameters}; expected motorctl.model.Parameter each")
    if parameters and effect.kind not in ("state", "input"):
        raise refuse(
            "parameters", f"gives some; expected none, for its kind is '{effect.kind}': only "
            "options"
        )  # fmt: skip
    names = [parameter.name for parameter in parameters]
    for name in names:
        if names.count(name) > 1:
            raise refuse("parameters", f"names {name!r} twice; expected different names")
        if not (name.isidentifier() if len(names) > 1 else not name or name.isidentifier()):
            raise refuse(
                "parameters", f"names {name!r}; expected letters, digits and _, or nothing where "
                "there is one parameter only"
            )  # fmt: skip
    for p in parameters:
        if not p.lower < p.upper or not p.lower <= p.initial <= p.upper:
            raise refuse(
                "parameters", f"gives '{p.symbol}' {p.lower} to {p.upper} from {p.initial}; "
                "expected lower < upper and the start value between them"
            )  # fmt: skip
        if not 0.0 < p.covariance < math.inf:
            raise refuse(
                "parameters", f"gives '{p.symbol}' a covariance of {p.covariance}; expected a "
                "number above 0"
            )  # fmt: skip


def _number(effect: Effect, member: str) -> float:
    return float(getattr(effect, member))


def _is_inherited(cls: type[Effect], member: str) -> bool:
    """Return whether a member is still that of the base class."""
    return getattr(cls, member).__func__ is getattr(Effect, member).__func__
