"""The compiled tick of one machine: one call for all axes' mathematics.

Each axis' list of effects has kernels of its own, so a small module is generated that passes
them to the common axis step. It is kept, readable, in the cache folder.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import indent
from types import ModuleType
from typing import Any

from motorctl.kernels import load_generated, source_digest
from motorctl.loop.vocabulary import STATUS_ROWS
from motorctl.model import EffectList

HEAD = '''"""The tick of {axes} axes. Generated; do not edit."""

from numba import njit

from motorctl.kernels import inner_kernel
from motorctl.loop.axis import (
    axis_between, axis_inputs, axis_reference, axis_step, report_axis,
)
from motorctl.loop.commands import take_commands
from motorctl.loop.guards.partners import stop_partners
from motorctl.loop.guards.supervision import supervise
from motorctl.loop.preview import fill_motion
from motorctl.loop.states import is_enabled
{imports}
'''

DEFINED = """
{decorator}
def {name}(
    counts, index_counts, words, volts, enable, elapsed, behind, overran, number, t, watch, status,
    mailbox, replies, settings, axes, law_settings, laws, beside, segments, segment_counts,
    excitations, samples, row, axis_status,{more}
):
"""

DUAL_IMPORTS = """from motorctl.loop.dual_drive import drive_ends, join_ends, report_skew
from motorctl.loop.skew import guide_skew, hold_skew
"""
DUAL_ARGUMENTS = " dual_settings, duals,"
LEARNING_IMPORTS = """from motorctl.loop.learned_feedforward import lead_by_learned
"""
LEARNING_ARGUMENTS = " learned,"

PASSED = """    {passed} = number // {divisor} - (number - elapsed) // {divisor}
"""

INPUTS = """    axis_inputs(
        {m}.correct, {m}.feedforward, settings[{i}], axes[{i}], laws[{i}], {count},
        {word}, {passed}, behind, t,
    )
"""

JOIN = """    join_ends(
        settings[{i}], dual_settings[{d}], axes[{i}], duals[{d}], counts[{c}], counts[{c2}],
        index_counts[{c}], index_counts[{c2}], words[{c}], words[{c2}], {passed}, behind, t,
    )
"""

COMMANDS = """    supervise(watch[0], status[0], settings, axes, elapsed, overran, t)
    stop_partners(settings, axes, t)  # of what has tripped, before a reset can hide it
    take_commands(
        watch[0], status, mailbox, replies, settings, axes, laws, segments, excitations, number, t,
    )
    stop_partners(settings, axes, t)
"""

REFERENCE = """    axis_reference(
        {m}.correct, {m}.feedforward, {m}.advance_context, settings[{i}], axes[{i}],
        law_settings[{i}], laws[{i}], segments[{i}], segment_counts[{i}], {index},
        {passed}, number, t,
    )
"""

GUIDE = """    guide_skew(settings[{i}], dual_settings[{d}], axes[{i}], duals[{d}], {passed}, t)
"""

MOTION = """    fill_motion(
        law_settings, laws, settings, axes, segments, segment_counts, beside, number, {i},
    )
"""

COUNT = """    moving = 0
    told = row % {rows}
"""

HOLD = """    hold_skew(
        settings[{i}], dual_settings[{d}], axes[{i}], duals[{d}], law_settings[{i}], {passed}, t,
    )
"""

LEAD = """    lead_by_learned(
        settings[{i}], axes[{i}], law_settings[{i}], laws[{i}], learned[{i}],
        status[0].models_row, {passed}, number,
    )
"""

STEP = """    {volts} = axis_step(
        {m}.state_columns, {m}.input_columns, {m}.feedforward, {m}.input_map, {m}.input_slope,
        {m}.advance_context, {m}.advance_inputs, settings[{i}], axes[{i}], law_settings[{i}],
        laws[{i}], excitations[{i}], {passed}, t, samples[row, {i}],
    )
"""

TELL_LEARNED = """    samples[row, {i}].learned_v = axes[{i}].learned_v
"""

DRIVE = """    drive_ends(
        settings[{i}], dual_settings[{d}], axes[{i}], duals[{d}], law_settings[{i}], u{i}, volts,
        {c}, {c2}, samples[row, {i}],
    )
"""

BETWEEN = """    samples[row, {i}] = samples[row - 1, {i}]
    axis_between(axes[{i}], samples[row, {i}])
"""

REPORT = """    enable[{c}] = is_enabled(axes[{i}])
    moving += enable[{c}]
    report_axis(axes[{i}], samples[row, {i}], law_settings[{i}].n, axis_status[told, {i}])
"""

REPORT_SKEW = """    enable[{c2}] = enable[{c}]
    report_skew(axes[{i}], duals[{d}], axis_status[told, {i}])
"""

TAIL = """    return watch[0].shutdown != 0 and moving == 0
"""


def compose_tick(
    models: Sequence[EffectList],
    channels: Sequence[int],
    divisors: Sequence[int],
    second_channels: Sequence[int | None] | None = None,
    learning: Sequence[bool] | None = None,
) -> ModuleType:
    """Return the generated module whose `tick` serves these axes.

    Its `steps`, which nobody calls, is what `tick` does of the axes' laws: another process may
    analyse it while this one begins with the rest. The references of all axes are moved on before
    any law looks at one. A channel's voltage stands between its axis' ticks.

    Parameters
    ----------
    models
        The list of effects of each axis.
    channels
        The place of each axis in the drivers' arrays.
    divisors
        How many ticks of the loop one tick of each axis lasts.
    second_channels
        The place of the second end of each axis; None for an axis with one motor. The dual drives
        are numbered in this order; without any the tick takes no records of them.
    learning
        Which axes may get a learned feedforward; without any the tick takes no records of it.
    """
    lists = dict.fromkeys(model.kernels.__name__ for model in models)
    imports = "".join(f"import {name}\n" for name in lists)
    places = [
        {
            "i": i,
            "c": channel,
            "m": model.kernels.__name__,
            "divisor": divisor,
            "passed": "elapsed" if divisor == 1 else f"passed{i}",
            "count": f"counts[{channel}]",
            "word": f"words[{channel}]",
            "index": f"index_counts[{channel}]",
            "volts": f"volts[{channel}]",
        }
        for i, (model, channel, divisor) in enumerate(zip(models, channels, divisors, strict=True))
    ]
    dual = [i for i, second in enumerate(second_channels or ()) if second is not None]
    for d, i in enumerate(dual):
        places[i] |= {"d": d, "c2": (second_channels or ())[i], "volts": f"u{i}"}
        places[i] |= {"count": f"duals[{d}].raw_counts", "word": f"duals[{d}].status"}
        places[i]["index"] = f"duals[{d}].raw_index_counts"
    learners = [i for i, learns in enumerate(learning or ()) if learns]
    begun = [PASSED.format(**place) for place in places if place["divisor"] != 1]
    parts = list(begun)
    for place in places:
        parts.append(_when_due(place, JOIN + INPUTS if "d" in place else INPUTS))
    parts.append(COMMANDS)
    for place in places:
        parts.append(_when_due(place, REFERENCE + GUIDE if "d" in place else REFERENCE))
    for place, model in zip(places, models, strict=True):
        if model.lag_s or model.delay_s or model.other_axes:
            parts.append(_when_due(place, MOTION))
    parts.append(COUNT.format(rows=STATUS_ROWS))
    steps = []
    for place in places:
        step = LEAD + STEP + TELL_LEARNED if place["i"] in learners else STEP
        if "d" in place:
            step = HOLD + step + DRIVE
        steps.append(_when_due(place, step, BETWEEN))
        parts += [steps[-1], REPORT.format(**place)]
        if "d" in place:
            parts.append(REPORT_SKEW.format(**place))
    parts.append(TAIL)
    more = DUAL_ARGUMENTS * bool(dual) + LEARNING_ARGUMENTS * bool(learners)
    imports += DUAL_IMPORTS * bool(dual) + LEARNING_IMPORTS * bool(learners)
    source = "".join(
        [
            HEAD.format(axes=len(models), imports=imports),
            DEFINED.format(
                decorator="@njit(cache=True, error_model='numpy')", name="tick", more=more
            ),
            *parts,
            DEFINED.format(decorator="@inner_kernel", name="steps", more=more),
            *begun,
            *steps,
        ]
    )
    return load_generated(f"tick_{source_digest(source)}", source)


def _when_due(place: Mapping[str, Any], part: str, otherwise: str = "") -> str:
    """Return what an axis does in its own ticks, and what in the others."""
    text = part.format(**place)
    if place["divisor"] == 1:
        return text
    text = f"    if {place['passed']}:\n{indent(text, '    ')}"
    if otherwise:
        text += f"    else:\n{indent(otherwise.format(**place), '    ')}"
    return text
