"""From the command to the thrust: D/A converter, dead zone, delay, lag, iron-core thrust."""

from __future__ import annotations

import math
from typing import Any

from motorctl.hal import inner_kernel
from motorctl_sim.physics.plant_records import DELAY_LINE, FROZEN
from motorctl_sim.physics.shapes import dahl, harmonics

INPUT_DELAY = FROZEN["INPUT_DELAY"]
THRUST_HYSTERESIS = FROZEN["THRUST_HYSTERESIS"]


@inner_kernel
def amplifier_level(plant: Any, state: Any) -> float:
    """Return the voltage that the amplifier answers to over this period [V]."""
    if state.enable == 0 or state.output_off != 0 or not math.isfinite(state.command):
        return 0.0
    level = min(max(state.command, -plant.max_voltage), plant.max_voltage)
    if plant.converter_step > 0.0:
        level = round(level / plant.converter_step) * plant.converter_step
    dead = plant.dead_half_width
    return float(level - min(max(level, -dead), dead))


@inner_kernel
def _delayed(plant: Any, state: Any) -> float:
    # Mean of the delayed command over this substep: a delay of n + f substeps takes the share f
    # from one substep earlier, so the impulse of any delay is exact.
    cursor = state.cursor
    state.line[cursor] = state.level
    newer = state.line[(cursor - plant.delay_whole) & (DELAY_LINE - 1)]
    older = state.line[(cursor - plant.delay_whole - 1) & (DELAY_LINE - 1)]
    state.cursor = (cursor + 1) & (DELAY_LINE - 1)
    return float(newer + plant.delay_part * (older - newer))


@inner_kernel
def thrust(plant: Any, state: Any, x: float) -> float:
    """Advance the actuator by a substep; return its mean thrust over it [V].

    Fm(i)/A1 = i + theta5 i|i| + theta6 i^3 (Chen, Yao, Wang 2013, eq. 2), i the command behind
    delay and first-order lag; both are integrated exactly for a command held over substeps.
    """
    u = _delayed(plant, state) if plant.terms & INPUT_DELAY else state.level
    before = state.current
    i = u + (before - u) * plant.lag_mean
    state.current = u + (before - u) * plant.lag_decay
    force: float = i + plant.quadratic * i * abs(i) + plant.cubic * i * i * i
    if plant.ripple.count > 0:
        force *= 1.0 + harmonics(plant.ripple, x)
    force *= state.gain
    if plant.terms & THRUST_HYSTERESIS:
        change = state.current - before
        state.hysteresis = dahl(state.hysteresis, change, plant.hysteresis_voltage)
        force -= plant.hysteresis_force * state.hysteresis
    state.thrust = force
    return force
