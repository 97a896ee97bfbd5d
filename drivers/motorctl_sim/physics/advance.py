"""The gantry's equation of motion and its integration.

Per axis, every term in volts (newtons over the force constant A1):

    theta1 a = g(t) (1 + R(x)) (i + theta5 i|i| + theta6 i^3)     thrust, ripple R, heat g
             - theta2 v - c v|v|                                  viscous friction, drag
             - L(x, v) s - asymmetric |s|, |v|                    Coulomb friction of level L
             + theta4                                             offset
             + sum A_k sin(2 pi k x/P + phi_k) + profile(x)       cogging
             - k (x - c) - k3 (x - c)^3 + ends - cable            force of position
             + A sin(2 pi f t + phi) + noise                      force of time
             - m_o a_other - b_o v_other                          cross-axis coupling
             + parts on springs, end stops, faults, a beam to another channel

i is the command u behind D/A converter, dead zone, delay and first-order lag; s is the direction
(arctan, or a presliding state). The thrust curve is eq. 2 of Chen, Yao, Wang (IEEE/ASME Trans.
Mechatronics 18(3), 2013); the other terms are described where they are computed.

Integration: position Verlet (drift, kick, drift) in substeps. Forces are taken at the middle of
a substep, at x + h v/2 and at the velocity v + h a/2 extrapolated with the last acceleration.
So motion under constant force is exact, springs keep their energy, and viscous decay is of second
order. A coupled axis' acceleration is the one of the substep before.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from motorctl.hal import inner_kernel
from motorctl_sim.physics.actuator import amplifier_level, thrust
from motorctl_sim.physics.beam import couple_ends
from motorctl_sim.physics.friction import friction
from motorctl_sim.physics.noise import normal_pair
from motorctl_sim.physics.observation import (
    INDEX_LATCHED,
    apply_faults,
    encoder_position,
    observe,
    to_count,
)
from motorctl_sim.physics.plant_records import FROZEN
from motorctl_sim.physics.position import end_stop_force, position_force
from motorctl_sim.physics.sprung import advance_sprung, sprung_force

GAIN_DRIFT = FROZEN["GAIN_DRIFT"]
PAYLOAD_CHANGE = FROZEN["PAYLOAD_CHANGE"]
PERIODIC = FROZEN["PERIODIC"]
CROSS_AXIS = FROZEN["CROSS_AXIS"]
FLEXIBLE_MODE = FROZEN["FLEXIBLE_MODE"]
BACKLASH = FROZEN["BACKLASH"]
NOISE = FROZEN["NOISE"]
WANDERING = FROZEN["WANDERING"]
KEEP = np.uint32(~int(INDEX_LATCHED) & 0xFFFFFFFF)


@inner_kernel
def _hold(plant: Any, state: Any, tick: int) -> None:
    """Set what stays constant over the period `tick`."""
    terms = plant.terms
    state.level = amplifier_level(plant, state)
    if terms & GAIN_DRIFT:
        warm = 1.0 - math.exp(-tick * plant.drift_rate)
        state.gain = plant.force_ratio * (1.0 - plant.drift_fraction * warm)
    if terms & PAYLOAD_CHANGE and tick >= plant.added_at:
        state.inertia = plant.inertia + plant.added_inertia
    force = plant.offset + state.fault_force
    if terms & (NOISE | WANDERING):
        white, drive = normal_pair(state.random)
        force += plant.noise_rms * white
        decay = plant.wandering_decay
        state.wandering *= decay
        state.wandering += math.sqrt(1.0 - decay * decay) * plant.wandering_rms * drive
        force += state.wandering
    state.held_force = force


@inner_kernel
def _accelerate(plant: Any, states: Any, i: int, t: float, h: float) -> None:
    """Compute the acceleration at the middle of a substep; t [s] is the time there."""
    state = states[i]
    terms = plant.terms
    x = state.position + 0.5 * h * state.velocity
    moved = x - state.middle
    state.middle = x
    v = state.velocity + 0.5 * h * state.acceleration
    force = state.held_force + thrust(plant, state, x) - friction(plant, state, x, v, moved)
    force += position_force(plant, state, x, moved)
    if x > plant.upper_end or x < plant.lower_end:
        force += end_stop_force(plant, x, v)
    if terms & PERIODIC:
        angle = plant.periodic_rad_s * t + plant.periodic_phase
        force += plant.periodic_amplitude * math.sin(angle)
    if terms & CROSS_AXIS:
        other = states[plant.coupled_to]
        force -= plant.coupled_inertia * other.acceleration
        force -= plant.coupled_viscous * other.velocity
    flexible = loose = 0.0
    if terms & FLEXIBLE_MODE:
        flexible = sprung_force(plant.flexible, state.flexible, h)
    if terms & BACKLASH:
        loose = sprung_force(plant.loose, state.loose, h)
    acceleration = (force + flexible + loose) / state.inertia
    if terms & FLEXIBLE_MODE:
        advance_sprung(plant.flexible, state.flexible, flexible, acceleration, state.velocity, h)
    if terms & BACKLASH:
        advance_sprung(plant.loose, state.loose, loose, acceleration, state.velocity, h)
    state.next_acceleration = acceleration


@inner_kernel
def _move(state: Any, h: float) -> None:
    acceleration = state.next_acceleration
    state.position += h * (state.velocity + 0.5 * h * acceleration)
    state.velocity += h * acceleration
    state.acceleration = acceleration


@numba.njit(cache=True)
def start(clock: Any, plants: Any, states: Any, faults: Any) -> None:
    """Put the carriages at their places at time 0 and observe them; `states` come zeroed."""
    clock[0].tick = 0
    for i in range(len(states)):
        plant, state = plants[i], states[i]
        state.position = plant.initial_position
        state.velocity = plant.initial_velocity
        state.middle = plant.initial_position
        state.seen_position = plant.initial_position
        state.gain = plant.force_ratio
        state.inertia = plant.inertia
        if plant.terms & WANDERING:
            state.wandering = plant.wandering_rms * normal_pair(state.random)[0]
        if plant.absolute == 0:
            state.zero_count = -to_count(plant, state, encoder_position(plant, state.position))
    apply_faults(plants, states, faults, 0)
    for i in range(len(states)):
        observe(plants[i], states[i])


@numba.njit(cache=True)
def advance(clock: Any, plants: Any, states: Any, faults: Any, beams: Any, periods: int) -> None:
    """Simulate some periods, all axes together.

    Parameters
    ----------
    clock, plants, states, faults, beams
        Records of CLOCK (one), PLANT and STATE (one for each channel), FAULT and BEAM.
    periods
        How many.
    """
    axes = len(states)
    watch = clock[0]
    h = watch.substep
    for _ in range(periods):
        tick = watch.tick
        for i in range(axes):
            _hold(plants[i], states[i], tick)
        for j in range(watch.substeps):
            t = tick * watch.period + (j + 0.5) * h
            for i in range(axes):
                _accelerate(plants[i], states, i, t, h)
            for k in range(len(beams)):
                couple_ends(beams[k], states, h)
            for i in range(axes):
                _move(states[i], h)
        watch.tick = tick + 1
        if len(faults) > 0:
            apply_faults(plants, states, faults, tick + 1)
        for i in range(axes):
            observe(plants[i], states[i])


@numba.njit(cache=True)
def deliver(states: Any, counts: Any, index_counts: Any, status: Any) -> None:
    """Copy the last observation into the loop's arrays and rearm the index latches.

    Parameters
    ----------
    states
        Records of STATE, one for each channel.
    counts, index_counts, status
        Receive the observation [counts, counts, status bits], shape (channels,) each.
    """
    for i in range(len(states)):
        state = states[i]
        counts[i] = state.count
        index_counts[i] = state.index_count
        status[i] = state.status
        state.status &= KEEP


@numba.njit(cache=True)
def accept(states: Any, volts: Any, enable: Any) -> None:
    """Set the amplifiers' commands."""
    for i in range(len(states)):
        states[i].command = volts[i]
        states[i].enable = enable[i]
