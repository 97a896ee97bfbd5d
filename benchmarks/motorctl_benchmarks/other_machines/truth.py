"""What may be said of each kind of machine: the right names, their family, and silence.

The generators name what they put in by words of their own; here stands which of motorctl's effects
that is. A name of the same family is right enough: it sends whoever reads it to the right place of
the machine. Which effects motorctl has is asked of motorctl, so that an effect that is added to it
moves its kind from those outside the list to the known ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Literal

from motorctl.model.catalog import built_in_effects
from motorctl_benchmarks.diagnosis.answer import Answer
from motorctl_benchmarks.diagnosis.score import Truth
from motorctl_benchmarks.other_machines.clean_machines import CLEAN_KINDS
from motorctl_benchmarks.other_machines.mistakes import MISTAKES, told

Group = Literal["known", "outside", "clean", "mistake"]

UNKNOWN_PREFIX = "unknown_"
ALSO_RIGHT = {
    "unknown_shaker": frozenset({"periodic_disturbance"}),
    "unknown_spindle_imbalance": frozenset({"periodic_disturbance"}),
}
"""Names that are right for what its author thought to be without one: a force of one frequency, the
spindle's changing by less than 0.1 % a second."""
ALSO_THERE = {
    ("scipy_ode", "voltage_clipping"): frozenset({"input_lag", "input_delay"}),
}
"""What a generator's machines of a kind have beside it, which is no false name then: a current loop
of 500 to 900 Hz, where its supply has a limit."""
OTHERWISE_TOLD = "another mistake told"
CLEAN = ("none", "gravity_constant")
"""Kinds that lack nothing: a constant weight is an offset."""
NAMES: Mapping[str, tuple[str, ...]] = {
    "gravity_sine": ("gravity",),
    "cogging": ("cogging",),
    "force_ripple": ("force_ripple",),
    "current_saturation": ("em_quadratic", "em_cubic"),
    "command_lag": ("input_lag",),
    "command_delay": ("input_delay",),
    "voltage_clipping": ("voltage_clipping",),
    "stribeck": ("stribeck",),
    "asymmetric_friction": ("asymmetric_friction",),
    "quadratic_drag": ("quadratic_drag",),
    "presliding": ("presliding",),
    "load_friction": ("load_friction",),
    "warming_friction": ("warming_friction",),
    "position_friction": ("position_dependent_friction",),
    "backlash_motor": ("backlash",),
    "backlash_load": ("backlash",),
    "flexible_motor": ("flexible_mode",),
    "flexible_load": ("flexible_mode",),
    "measurement_ripple": ("encoder_error",),
    "payload_step": ("payload_change",),
    "position_force": ("position_force",),
    "hard_stop": ("hard_stop",),
    "drive_hysteresis": ("drive_hysteresis",),
    "eddy_brake": ("eddy_brake",),
}
"""The effects of which any is the right name, also where motorctl has no such effect."""
FAMILIES = (
    ("input_lag", "input_delay"),
    (
        "stribeck",
        "presliding",
        "asymmetric_friction",
        "quadratic_drag",
        "load_friction",
        "warming_friction",
        "position_dependent_friction",
        "eddy_brake",
    ),
    ("cogging", "position_force", "gravity", "hard_stop"),
    ("em_quadratic", "em_cubic", "dead_zone", "drive_hysteresis", "voltage_clipping"),
    ("gain_drift", "warming_friction", "payload_change"),
)
"""What acts in the same place or way: timing, friction, place, drive, what changes with time."""
NOTHING_MISSING = frozenset({"complete", "insufficient_data"})
CALLED_UNKNOWN = frozenset({"unknown_structure"})
SILENCE: Mapping[str, frozenset[str]] = {
    # Friction that differs by direction is an offset, where the motion has no rests.
    "asymmetric_friction": NOTHING_MISSING,
    # An encoder on the load does not see the antiresonance by which the mode is known.
    "flexible_load": CALLED_UNKNOWN,
    # Nor does it see the motor cross the gap: the load is merely not pushed for a while.
    "backlash_load": CALLED_UNKNOWN,
}
"""Verdicts that are right as well for a known kind, if nothing is named."""


@dataclass(frozen=True)
class KindTruth:
    """What may be said of machines of one kind."""

    group: Group
    names: frozenset[str]
    """Right."""
    family: frozenset[str]
    """Right enough, without the right ones."""
    silence: frozenset[str]
    """Verdicts that are right where nothing is named."""
    mistake: str = ""
    """What was done wrong with the recording: to be told, whatever else is said."""

    @property
    def put_in(self) -> Truth:
        """The right names as the campaign's rules take them."""
        return {name: {} for name in self.names}

    def false_names(self, answer: Answer) -> frozenset[str]:
        """Return what is named and neither right nor of the family.

        That an answer calls a false name indistinguishable from the right one does not mend it.
        """
        return answer.names - self.names - self.family

    def right(self, answer: Answer) -> bool:
        """Tell whether nothing false is named, and something is or the silence is right.

        A family alone is an answer too, if it is the right one.
        """
        if self.mistake:
            return told_of(answer) == (self.mistake,)
        if answer.names:
            return not self.false_names(answer)
        return answer.verdict in self.silence or self._family_alone(answer)

    def _family_alone(self, answer: Answer) -> bool:
        return answer.family in families_of(self.names)

    def exactly_named(self, answer: Answer) -> bool:
        """Tell whether the right name stands there and no other, of its family neither."""
        return bool(answer.names) and answer.names <= self.names

    def judged(self, answer: Answer) -> str:
        """Say in a word or two what an answer is; a verdict where nothing is named."""
        if self.mistake and told_of(answer):
            return "told" if self.right(answer) else OTHERWISE_TOLD
        if not answer.names:
            return "family" if self._family_alone(answer) else answer.verdict
        if self.exactly_named(answer):
            return "named"
        if self.right(answer):
            return "family"
        beside = any(named.may_be & self.names for named in answer.named)
        return "named and false" if beside else "false"


def told_of(answer: Answer) -> tuple[str, ...]:
    """Return the kinds of mistake that an answer tells."""
    return told(" ".join((answer.failure, *answer.notes)))


def families_of(names: Iterable[str]) -> frozenset[str]:
    """Return the families, in motorctl's own words, of those effects that motorctl has."""
    effects = built_in_effects()
    return frozenset(effects[name].family() for name in names if name in effects)


@cache
def truth_of(kind: str, generator: str = "") -> KindTruth:
    """Return what may be said of a kind, by one of the generators or by any.

    Raises KeyError where nothing is known of it.
    """
    if kind in CLEAN or kind in CLEAN_KINDS:
        return KindTruth("clean", frozenset(), frozenset(), NOTHING_MISSING)
    if kind in MISTAKES:
        return KindTruth("mistake", frozenset(), frozenset(), frozenset(), kind)
    if kind.startswith(UNKNOWN_PREFIX):
        names = ALSO_RIGHT.get(kind, frozenset())
        return KindTruth("outside", names, frozenset(), CALLED_UNKNOWN)
    names = frozenset(NAMES[kind])
    family = frozenset(name for part in FAMILIES if names & set(part) for name in part) - names
    family |= ALSO_THERE.get((generator, kind), frozenset())
    if names.isdisjoint(built_in_effects()):
        return KindTruth("outside", names, family, CALLED_UNKNOWN)
    return KindTruth("known", names, family, SILENCE.get(kind, frozenset()))
