"""Cases of the campaign: a machine with known causes in it, and a motion, all drawn by seed."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

from motorctl.errors import UsageError
from motorctl_benchmarks.diagnosis.configuration import (
    CHANNELS,
    DRIVER,
    configure,
    with_effects,
    with_motion,
)
from motorctl_benchmarks.diagnosis.draw import Draw
from motorctl_benchmarks.diagnosis.known_effects import KNOWN, NOT_TOGETHER
from motorctl_benchmarks.diagnosis.motions import Motion
from motorctl_benchmarks.diagnosis.plants import AxisPlant, Options, draw_axis
from motorctl_benchmarks.diagnosis.strength import Claim, claim, scaled
from motorctl_benchmarks.diagnosis.unknown_effects import UNKNOWN

NO_CLAIM = Claim(0.25, 0.0, 1.0)
AT_ONCE_S = 1e-4
"""Thermal time constant of a motor that is warm from the start."""
SINE_ENCODER_RESOLUTION_M = 0.2e-6
"""Interpolation errors belong to interpolated, so finely resolving encoders."""


@dataclass(frozen=True)
class Case:
    """A machine, what is wrong with one of its axes, and the motion that is recorded."""

    seed: int
    axis: str
    """The axis under test; the other one has nothing undeclared."""
    effects: tuple[str, ...]
    """What was put in; empty: the declared model is complete."""
    truth: Mapping[str, Options]
    """The simulator's options of every effect that was put in, by its name."""
    strength: float
    """1: as on real gantries; 0.2: the same shape, a fifth of the size."""
    motion: Motion
    config: Options
    """A whole configuration, plants included, as `motorctl.config.load_resolved` takes it."""

    @property
    def known(self) -> bool:
        """Whether a diagnosis can name all of it."""
        return all(effect in KNOWN for effect in self.effects)

    @property
    def name(self) -> str:
        """A name that does not tell what was put in: seed and digest of the configuration."""
        text = json.dumps([self.axis, self.config], sort_keys=True)
        return f"case-{self.seed:06d}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"

    @property
    def title(self) -> str:
        """What it is, for people."""
        what = " + ".join(self.effects) or "clean"
        return f"{what} at {self.strength:g}, {self.motion} motion, axis {self.axis}"


def draw_case(
    seed: int,
    *,
    effects: int | Collection[str] = 1,
    strength: float = 1.0,
    motion: Motion = "rich",
) -> Case:
    """Draw a case: so many known effects, or these, on one axis of a two-axis machine.

    The seed decides the machine, the axis under test, the motion and the shape of each effect, each
    from a stream of its own: the same seed gives the same machine and motion at any strength, but
    for the limits of acceleration, which leave room for what the effects take. What is drawn is
    told by `draw_axis`, `configure`, `draw_programs` and the functions in `KNOWN` and `UNKNOWN`.

    Parameters
    ----------
    seed
        Decides everything that is drawn.
    effects
        The number of known effects, or the effects' names.
    strength
        Factor on the size of the effects.
    motion
        Kind of the motion.

    Raises
    ------
    UsageError
        There is no effect of that name.
    """
    names = _some_known(seed, effects, motion) if isinstance(effects, int) else tuple(effects)
    drawers = KNOWN | UNKNOWN
    if strange := [name for name in names if name not in drawers]:
        raise UsageError(f"no effect '{strange[0]}' can be put in; known: {', '.join(drawers)}")
    axis = Draw(seed, "axis under test").pick(tuple(CHANNELS))
    plants = {name: draw_axis(Draw(seed, "plant", name)) for name in CHANNELS}
    if "encoder_error" in names:
        plants[axis] = _with_sine_encoder(plants[axis])
    full = {name: drawers[name](Draw(seed, "effect", name), plants[axis]) for name in names}
    claims = {name: claim(full) if name == axis and full else NO_CLAIM for name in CHANNELS}
    truth = {name: scaled(name, options, strength) for name, options in full.items()}
    config = with_effects(configure(seed, plants, claims, motion), axis, truth)
    return Case(seed, axis, names, truth, strength, motion, config)


def clean_case(seed: int, motion: Motion = "rich") -> Case:
    """Draw a machine that its declared model describes completely."""
    return draw_case(seed, effects=(), motion=motion)


def unknown_case(seed: int, motion: Motion = "rich", *, strength: float = 1.0) -> Case:
    """Draw a machine with one effect that no list of known effects has."""
    effect = Draw(seed, "unknown effect").pick(tuple(UNKNOWN))
    return draw_case(seed, effects=(effect,), strength=strength, motion=motion)


def without_effects(case: Case) -> Case:
    """Return the same machine and motion with nothing undeclared in it: the oracle."""
    channel = str(CHANNELS[case.axis])
    taken = (*case.truth, "position_force") if "cable_hysteresis" in case.truth else case.truth
    sim = {key: part for key, part in case.config["drivers"][DRIVER].items() if key != "faults"}
    plant = {key: part for key, part in sim["plants"][channel].items() if key not in taken}
    drivers = {DRIVER: sim | {"plants": sim["plants"] | {channel: plant}}}
    return replace(case, effects=(), truth={}, config=case.config | {"drivers": drivers})


def as_left(case: Case, duration_s: float) -> Case:
    """Return the same machine as a recording of `duration_s` left it: what happened stays so.

    A configuration starts anew at every start of the daemon, so what is refined from a recording
    is for the machine after its load has changed and its motor is warm.
    """
    after = dict(case.truth)
    if (load := after.get("payload_change")) is not None:
        after["payload_change"] = {**load, "time_s": 0.0}
    if (drift := after.get("gain_drift")) is not None:
        lost = drift["fraction"] * -math.expm1(-duration_s / drift["time_constant_s"])
        after["gain_drift"] = {"fraction": lost, "time_constant_s": AT_ONCE_S}
    return replace(case, truth=after, config=with_effects(case.config, case.axis, after))


def on_other_motion(case: Case, seed: int, motion: Motion = "rich") -> Case:
    """Return the same machine, effects included, on a motion drawn by another seed."""
    return replace(case, motion=motion, config=with_motion(case.config, seed, motion))


def _some_known(seed: int, count: int, motion: Motion) -> tuple[str, ...]:
    """Draw known effects; coupling only where the axes move apart, else nothing could show it."""
    names: list[str] = []
    for name in Draw(seed, "effects").some(tuple(KNOWN), len(KNOWN)):
        clash = any({name, *names} >= pair for pair in NOT_TOGETHER)
        untestable = name == "cross_axis" and motion == "synchronised"
        if len(names) < count and not clash and not untestable:
            names.append(name)
    return tuple(names)


def _with_sine_encoder(plant: AxisPlant) -> AxisPlant:
    resolution = min(plant.resolution_m, SINE_ENCODER_RESOLUTION_M)
    noise = plant.encoder_noise_m * resolution / plant.resolution_m
    return replace(plant, resolution_m=resolution, encoder_noise_m=noise)


def plain(case: Case) -> dict[str, Any]:
    """Return what was put in as plain data, to be kept beside the results."""
    return {
        "name": case.name,
        "seed": case.seed,
        "axis": case.axis,
        "effects": list(case.effects),
        "known": case.known,
        "truth": dict(case.truth),
        "strength": case.strength,
        "motion": case.motion,
    }
