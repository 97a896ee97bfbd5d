"""What the machine shows of itself: counts, index marks, switches, and the faults in between."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from motorctl.hal import Status, inner_kernel
from motorctl_sim.physics.noise import normal_pair

LIMIT_NEGATIVE = np.uint32(Status.LIMIT_NEGATIVE)
LIMIT_POSITIVE = np.uint32(Status.LIMIT_POSITIVE)
HOME_SWITCH = np.uint32(Status.HOME_SWITCH)
INDEX_LATCHED = np.uint32(Status.INDEX_LATCHED)


@inner_kernel
def encoder_position(plant: Any, x: float) -> float:
    """Return the encoder's reading of a position [m], with its interpolation error."""
    if plant.error_amplitude == 0.0:
        return x
    error: float = plant.error_amplitude * math.sin(plant.error_rad_m * x + plant.error_phase)
    return x + error


@inner_kernel
def to_count(plant: Any, state: Any, y: float) -> int:
    """Return the counter's value at an encoder position y [m], in two's complement."""
    count: int = plant.sign * math.floor(y / plant.resolution + 0.5) + state.zero_count
    if plant.counter_bits < 63:
        half = 1 << (plant.counter_bits - 1)
        count = ((count + half) & (2 * half - 1)) - half
    return count


@inner_kernel
def apply_faults(plants: Any, states: Any, faults: Any, tick: int) -> None:
    """Find which faults are in force in the period `tick`, and make the counters' jumps."""
    for i in range(len(states)):
        states[i].fault_status = np.uint32(0)
        states[i].frozen = 0
        states[i].output_off = 0
        states[i].fault_force = 0.0
    for k in range(len(faults)):
        fault = faults[k]
        if not fault.start <= tick < fault.stop:
            continue
        for i in range(len(states)):
            if fault.axis not in (-1, i):
                continue
            state = states[i]
            state.fault_status |= fault.status
            state.frozen |= fault.freezes
            state.output_off |= fault.turns_off
            state.fault_force += fault.force
            if tick == fault.start and fault.jump != 0.0:
                plant = plants[i]
                state.zero_count += plant.sign * round(fault.jump / plant.resolution)


@inner_kernel
def observe(plant: Any, state: Any) -> None:
    """Take the count, latch an index mark passed since the last time, read the switches."""
    x = state.position
    status = (state.status & INDEX_LATCHED) | state.fault_status
    if state.frozen == 0:
        y = encoder_position(plant, x)
        if plant.encoder_noise_rms > 0.0:
            y += plant.encoder_noise_rms * normal_pair(state.random)[0]
        state.count = to_count(plant, state, y)
        for k in range(plant.index_marks):
            mark = plant.index_mark[k]
            if (state.seen_position < mark) != (x < mark):
                state.index_count = to_count(plant, state, encoder_position(plant, mark))
                status |= INDEX_LATCHED
    state.seen_position = x
    if x <= plant.lower_switch:
        status |= LIMIT_NEGATIVE
    if x >= plant.upper_switch:
        status |= LIMIT_POSITIVE
    if plant.home_from <= x <= plant.home_to:
        status |= HOME_SWITCH
    state.status = status
