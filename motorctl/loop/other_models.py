"""Other models for a machine that runs: everything of them that its loop needs, made beforehand.

That is compiled code and filled records, and no model. The loop's process has nothing to read, to
import or to compile, which would keep its ticks waiting.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.config.machine import MOST_PARAMETERS, Machine
from motorctl.config.model_keys import axes_with_other_models, learns_the_same
from motorctl.control import law_settings, law_state
from motorctl.kernels import SentKernel, load_generated, packed, source_digest
from motorctl.loop.axis_records import AXIS_SETTINGS
from motorctl.loop.shared import LoopMemory
from motorctl.loop.tick import Tick
from motorctl.loop.warm_up import Unconnected
from motorctl.model import EffectList

HEAD = '''"""Laws that take over from others while their axes hold. Generated; do not edit."""

from numba import njit

from motorctl.control.law import still_command, take_over_law
from motorctl.loop.preview import fill_motion
{imports}

@njit(cache=True, error_model='numpy')
def take_over(
    holding, settings, axes, law_settings, laws, old_settings, before, beside, segments,
    segment_counts, number, t,
):
    refused = -1
'''

AXIS = """    if holding[{i}]:
        fill_motion(
            law_settings, laws, settings, axes, segments, segment_counts, beside, number, {i},
        )
        u = still_command(
            {old}.input_map, {old}.input_slope, old_settings[{i}], before[{i}], t,
        )
        if not take_over_law(
            {m}.feedforward, {m}.input_map, {m}.advance_context, {m}.advance_inputs,
            law_settings[{i}], laws[{i}], before[{i}], u, t,
        ):
            refused = {i}
"""

TAIL = """    return refused
"""


@dataclass(frozen=True)
class OtherModels:
    """What a loop takes over of other models: records as bytes, which take no time to be sent."""

    axes: tuple[int, ...]
    """Those with another model, by number."""
    names: tuple[str, ...]
    """Their names."""
    learned_stays: tuple[int, ...]
    """Those of them whose estimate means the same as before: gains alone are others."""
    own_settings: tuple[str, ...]
    """Which fields of AXIS_SETTINGS come of the models."""
    beside: tuple[tuple[int, ...], ...]
    """As of `axes_beside`."""
    remembered: int
    """Numbers that the effects of one axis remember, at most."""
    settings_bytes: bytes
    law_settings_bytes: bytearray
    laws_bytes: bytearray
    """The two that the laws write to: where they come from elsewhere, in place, without a copy."""
    tick: SentKernel
    take_over: SentKernel

    def settings(self) -> NDArray[np.void]:
        """Return AXIS_SETTINGS (axes,) as on devices that nobody knows."""
        return np.frombuffer(self.settings_bytes, AXIS_SETTINGS)

    def laws(self, room: int) -> tuple[NDArray[np.void], NDArray[np.void], NDArray[np.int64]]:
        """Return the laws' settings (axes,) and states (axes,) as they begin, and `beside`.

        room is how many parameters the loop's memory was made for. Once: what runs on them writes
        to them.
        """
        beside = np.array(self.beside, np.int64)
        states = law_state(room, self.remembered, beside.shape[1])
        return (
            np.frombuffer(self.law_settings_bytes, law_settings(room)),
            np.frombuffer(self.laws_bytes, states),
            beside,
        )


def take_over_arguments(before: Tick, after: Tick, holding: NDArray[np.bool_]) -> tuple[Any, ...]:
    """Return what the kernel that takes over is called with, but for the tick and its time [s].

    Parameters
    ----------
    before, after
        The tick that ran last, and the one that runs next.
    holding
        The axes that hold a command, (axes,).
    """
    records = (after.settings, after.axes, after.law_settings, after.laws)
    old = (before.law_settings, before.laws)
    memory = before.memory
    return holding, *records, *old, after.beside, memory.segments, memory.segment_counts


def other_models(before: Machine, after: Machine) -> OtherModels:
    """Make what the loop of `before` needs for the models of `after`: seconds, where they are new.

    Parameters
    ----------
    before, after
        Two machines that differ in what `model_keys` names alone.
    """
    names = list(after.axes)
    changed = axes_with_other_models(before, after)
    numbers = [names.index(name) for name in changed]
    memory = LoopMemory.create(names, MOST_PARAMETERS, after.rate_hz)
    try:
        old, new = (
            Tick(machine, memory, virtual=True, driver_class=Unconnected)
            for machine in (before, after)
        )
        fields = new.settings.dtype.names or ()
        models, old_models = (
            [axis.model for axis in machine.axes.values()] for machine in (after, before)
        )
        arguments = take_over_arguments(old, new, np.zeros(len(names), np.bool_))
        return OtherModels(
            tuple(numbers),
            tuple(changed),
            tuple(n for n in numbers if learns_the_same(before, after, names[n])),
            tuple(f for f in fields if not np.array_equal(new.settings[f], old.settings[f])),
            tuple(map(tuple, new.beside.tolist())),
            max(model.context_size for model in models),
            new.settings.tobytes(),
            bytearray(new.law_settings.tobytes()),
            bytearray(new.laws.tobytes()),
            new.packed(),
            packed(load_take_over(old_models, models, numbers), *arguments, 1, 0.0),
        )
    finally:
        memory.close()


def load_take_over(
    before: Sequence[EffectList], after: Sequence[EffectList], changed: Sequence[int]
) -> object:
    """Return the kernel that lets the laws of these axes take over; each list has kernels."""
    old, new = ([models[i].kernels.__name__ for i in changed] for models in (before, after))
    used = dict.fromkeys([*old, *new])
    source = "".join(
        [
            HEAD.format(imports="".join(f"import {name}\n" for name in used)),
            *(AXIS.format(i=i, m=m, old=o) for i, o, m in zip(changed, old, new, strict=True)),
            TAIL,
        ]
    )
    take_over: object = load_generated(f"take_over_{source_digest(source)}", source).take_over
    return take_over
