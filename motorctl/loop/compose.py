"""The compiled tick of one machine: one call for all axes' mathematics.

Each axis' list of effects has kernels of its own, so a small module is generated that passes
them to the common axis step. It is kept, readable, in the cache folder.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType

from motorctl.kernels import load_generated, source_digest
from motorctl.log.sample import AxisState
from motorctl.model import EffectList

OFF = int(AxisState.OFF)
FAULT = int(AxisState.FAULT)

HEAD = '''"""The tick of {axes} axes. Generated; do not edit."""

from numba import njit

from motorctl.loop.axis import axis_inputs, axis_step, report_axis
from motorctl.loop.commands import take_commands
from motorctl.loop.supervision import supervise
{imports}

@njit(cache=True)
def tick(
    counts, index_counts, words, volts, enable, elapsed, overran, number, t, watch, status,
    mailbox, replies, settings, axes, law_settings, laws, segments, segment_counts, samples,
    row, axis_status,
):
    for i in range({axes}):
        channel = ({channels},)[i]
        axis_inputs(settings[i], axes[i], counts[channel], words[channel], elapsed, t)
    supervise(watch[0], status[0], axes, elapsed, overran, t)
    take_commands(watch[0], status, mailbox, replies, settings, axes, segments, number, t)
    moving = 0
'''

STEP = """    volts[{c}] = axis_step(
        {m}.state_columns, {m}.input_columns, {m}.feedforward, {m}.input_map, {m}.input_slope,
        settings[{i}], axes[{i}], law_settings[{i}], laws[{i}], segments[{i}], segment_counts[{i}],
        index_counts[{c}], elapsed, number, t, samples[row, {i}],
    )
    enable[{c}] = axes[{i}].state != {off} and axes[{i}].state != {fault}
    moving += enable[{c}]
    report_axis(axes[{i}], samples[row, {i}], law_settings[{i}].n, axis_status[{i}])
"""

TAIL = """    return watch[0].shutdown != 0 and moving == 0
"""


def compose_tick(models: Sequence[EffectList], channels: Sequence[int]) -> ModuleType:
    """Give the generated module whose `tick` serves these axes.

    channels[i] is the place of axis i in the drivers' arrays.
    """
    lists = dict.fromkeys(model.kernels.__name__ for model in models)
    imports = "".join(f"import {name}\n" for name in lists)
    source = HEAD.format(
        axes=len(models), imports=imports, channels=", ".join(str(c) for c in channels)
    )
    for i, (model, channel) in enumerate(zip(models, channels, strict=True)):
        name = model.kernels.__name__
        source += STEP.format(i=i, c=channel, m=name, off=OFF, fault=FAULT)
    source += TAIL
    return load_generated(f"tick_{source_digest(source)}", source)
