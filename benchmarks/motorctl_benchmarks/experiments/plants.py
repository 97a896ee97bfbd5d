"""Plants on which look-alikes have to be told apart, drawn by seed."""

from __future__ import annotations

from dataclasses import replace

from motorctl_benchmarks.diagnosis.cases import Case, draw_case
from motorctl_benchmarks.diagnosis.configuration import with_effects
from motorctl_benchmarks.diagnosis.draw import Draw

FAMILIES = (
    "lag or delay",
    "cogging or force ripple",
    "friction by position",
    "payload or inertia",
    "coupling",
)
"""In turn, from the first seed on."""
WEAKEST, STRONGEST = 0.12, 0.8
"""Sizes of the effects, as parts of those of the campaign: log-uniform between."""
EARLIEST_S, LATEST_S = 1.0, 3.0
"""When a load changes [s]: while something moves that either motion has."""


def draw_plant(seed: int, family: str) -> Case:
    """Draw a machine with one effect of a family, or with both look-alikes."""
    draw = Draw(seed, "experiments")
    strength = draw.log_uniform(WEAKEST, STRONGEST)
    effects: tuple[str, ...]
    if family == FAMILIES[0]:
        effects = (draw.pick(("input_lag", "input_delay")),)
    elif family == FAMILIES[1]:
        both = ("cogging", "force_ripple")
        effects = draw.pick((both[:1], both[1:], both))
    elif family == FAMILIES[2]:
        effects = ("position_dependent_friction",)
    elif family == FAMILIES[3]:
        effects = ("payload_change",)
    else:
        effects = ("cross_axis",)
    case = draw_case(seed, effects=effects, strength=strength)
    if "payload_change" in case.truth:
        changed = {**case.truth["payload_change"], "time_s": draw.uniform(EARLIEST_S, LATEST_S)}
        truth = {**case.truth, "payload_change": changed}
        config = with_effects(case.config, case.axis, truth)
        case = replace(case, truth=truth, config=config)
    return case
