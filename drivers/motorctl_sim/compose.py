"""Make the records that the compiled physics works on from options and channels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.hal import Channel, Status
from motorctl_sim.options import Fault, Plant, SimOptions
from motorctl_sim.options.settings import Profile
from motorctl_sim.physics.plant_records import (
    BEAM,
    CLOCK,
    FAULT,
    PLANT,
    PROFILE_CELLS,
    STATE,
    Term,
)

Records = NDArray[np.void]

NEVER = 2**62
FAULT_STATUS = {
    "encoder_lost": Status.ENCODER_LOST,
    "amplifier_fault": Status.AMPLIFIER_FAULT,
    "communication_lost": Status.COMMUNICATION_LOST,
    "estop": Status.ESTOP,
}
FREEZING = ("encoder_lost", "encoder_stuck", "communication_lost")
TURNING_OFF = ("amplifier_fault", "communication_lost", "estop")


def make_clock(options: SimOptions, period_s: float) -> Records:
    """Divide the period into substeps no longer than the options allow."""
    clock = np.zeros(1, CLOCK)
    substeps = max(1, math.ceil(period_s / options.substep_s - 1e-9))
    clock["period"], clock["substeps"] = period_s, substeps
    clock["substep"] = period_s / substeps
    return clock


def make_plants(options: SimOptions, channels: Sequence[Channel], clock: Records) -> Records:
    """Return one record of PLANT for each channel, in their order."""
    plants = np.zeros(len(channels), PLANT)
    numbers = [channel.number for channel in channels]
    for record, channel in zip(plants, channels, strict=True):
        plant = options.plant(channel.number)
        terms = _motion(record, plant, clock) | _actuator(record, plant, clock)
        terms |= _friction(record, plant) | _forces(record, plant, clock)
        terms |= _other_masses(record, plant, numbers)
        record["terms"] = int(terms)
        _encoder(record, plant, channel)
        _switches(record, plant)
    return plants


def make_states(options: SimOptions, channels: Sequence[Channel]) -> Records:
    """Return a zeroed record of STATE for each channel, with its own random generator."""
    states = np.zeros(len(channels), STATE)
    for state, channel in zip(states, channels, strict=True):
        sequence = np.random.SeedSequence((options.seed, channel.number))
        state["random"] = sequence.generate_state(4, np.uint64)
    return states


def make_faults(options: SimOptions, channels: Sequence[Channel], period_s: float) -> Records:
    """Return the records of all faults that concern one of the channels."""
    numbers = [channel.number for channel in channels]
    heard = [f for f in options.faults if f.channel is None or f.channel in numbers]
    records = np.zeros(len(heard), FAULT)
    for record, fault in zip(records, heard, strict=True):
        record["axis"] = -1 if fault.channel is None else numbers.index(fault.channel)
        record["start"], record["stop"] = _periods(fault, period_s)
        record["status"] = int(FAULT_STATUS.get(fault.kind, 0))
        record["freezes"] = fault.kind in FREEZING
        record["turns_off"] = fault.kind in TURNING_OFF
        record["jump"], record["force"] = fault.jump_m, fault.force_v
    return records


def make_beams(options: SimOptions, channels: Sequence[Channel]) -> Records:
    """Return the records of all beams whose ends are among the channels."""
    numbers = [channel.number for channel in channels]
    whole = [beam for beam in options.beams if set(beam.channels) <= set(numbers)]
    records = np.zeros(len(whole), BEAM)
    for record, beam in zip(records, whole, strict=True):
        record["first"], record["second"] = (numbers.index(end) for end in beam.channels)
        quarter, turning = 0.25 * beam.inertia_v_s2_m, beam.rotary_inertia_v_s2_m
        m11, m12, m22 = quarter + turning, quarter - turning, quarter + turning
        if load := beam.load:
            w1 = 0.5 + load.position_m / beam.spacing_m
            w2 = 0.5 - load.position_m / beam.spacing_m
            m11 += load.inertia_v_s2_m * w1 * w1
            m12 += load.inertia_v_s2_m * w1 * w2
            m22 += load.inertia_v_s2_m * w2 * w2
        record["m11"], record["m12"], record["m22"] = m11, m12, m22
        record["stiffness"], record["damping"] = beam.stiffness_v_m, beam.damping_v_s_m
    return records


def _periods(fault: Fault, period_s: float) -> tuple[int, int]:
    start = math.ceil(fault.at_s / period_s - 1e-9)
    if fault.duration_s is None:
        return start, NEVER
    return start, start + max(1, math.ceil(fault.duration_s / period_s - 1e-9))


def _motion(record: Any, plant: Plant, clock: Records) -> Term:
    record["inertia"] = plant.carriage_inertia_v_s2_m
    record["viscous"] = plant.viscous_friction_v_s_m
    record["offset"] = plant.offset_v
    record["lower_end"], record["upper_end"] = plant.travel_m
    record["end_stiffness"] = plant.end_stop.stiffness_v_m
    record["end_damping"] = plant.end_stop.damping_v_s_m
    record["initial_position"] = plant.initial_position_m
    record["initial_velocity"] = plant.initial_velocity_m_s
    if plant.quadratic_drag:
        record["drag"] = plant.quadratic_drag.drag_v_s2_m2
    if not (change := plant.payload_change):
        return Term(0)
    record["added_inertia"] = change.inertia_v_s2_m
    record["added_at"] = math.ceil(change.time_s / float(clock["period"][0]) - 1e-9)
    return Term.PAYLOAD_CHANGE


def _actuator(record: Any, plant: Plant, clock: Records) -> Term:
    terms = Term(0)
    amplifier = plant.amplifier
    record["max_voltage"] = amplifier.max_voltage_v
    if amplifier.resolution_bits is not None:
        record["converter_step"] = 2.0 * amplifier.max_voltage_v / 2**amplifier.resolution_bits
    record["force_ratio"] = plant.force_constant_ratio
    record["quadratic"] = plant.em_quadratic_1_v
    record["cubic"] = plant.em_cubic_1_v2
    substep = float(clock["substep"][0])
    if plant.dead_zone:
        record["dead_half_width"] = plant.dead_zone.half_width_v
    if plant.input_delay:
        record["delay_whole"], record["delay_part"] = divmod(plant.input_delay.time_s / substep, 1)
        terms |= Term.INPUT_DELAY
    if plant.input_lag:
        steps = substep / plant.input_lag.time_s
        record["lag_decay"] = math.exp(-steps)
        record["lag_mean"] = -math.expm1(-steps) / steps
    if ripple := plant.force_ripple:
        parts = [(h.order, h.amplitude, h.phase_rad) for h in ripple.harmonics]
        _harmonics(record["ripple"], ripple.pitch_m, parts)
    if drift := plant.gain_drift:
        record["drift_fraction"] = drift.fraction
        record["drift_rate"] = float(clock["period"][0]) / drift.time_constant_s
        terms |= Term.GAIN_DRIFT
    if hysteresis := plant.thrust_hysteresis:
        record["hysteresis_force"] = hysteresis.force_v
        record["hysteresis_voltage"] = hysteresis.voltage_v
        terms |= Term.THRUST_HYSTERESIS
    return terms


def _friction(record: Any, plant: Plant) -> Term:
    terms = Term(0)
    record["coulomb"] = plant.coulomb_friction_v
    record["slope"] = plant.friction_slope_s_m
    if presliding := plant.presliding:
        record["displacement"] = presliding.displacement_m
        record["micro_damping"] = presliding.micro_damping_v_s_m
        terms |= Term.DAHL if presliding.kind == "dahl" else Term.LUGRE
    if stribeck := plant.stribeck:
        record["stribeck_force"] = stribeck.force_v
        record["stribeck_velocity"] = stribeck.velocity_m_s
        record["stribeck_exponent"] = stribeck.exponent
        terms |= Term.STRIBECK
    if asymmetric := plant.asymmetric_friction:
        record["asymmetric_coulomb"] = asymmetric.coulomb_v
        record["asymmetric_viscous"] = asymmetric.viscous_v_s_m
    if over := plant.position_dependent_friction:
        record["friction_center"] = over.center_m
        record["friction_linear"] = over.linear_v_m
        record["friction_quadratic"] = over.quadratic_v_m2
        _profile(record["friction_profile"], over.profile)
        terms |= Term.POSITION_FRICTION
    if patch := plant.friction_patch:
        record["patch_force"] = patch.force_v
        record["patch_position"], record["patch_width"] = patch.position_m, patch.width_m
        record["patch_velocity"] = patch.velocity_m_s
        terms |= Term.FRICTION_PATCH
    if bump := plant.friction_bump:
        record["bump_force"] = bump.force_v
        record["bump_velocity"], record["bump_width"] = bump.velocity_m_s, bump.width_m_s
        terms |= Term.FRICTION_BUMP
    return terms


def _forces(record: Any, plant: Plant, clock: Records) -> Term:
    terms = Term(0)
    if cogging := plant.cogging:
        parts = [(h.order, h.amplitude_v, h.phase_rad) for h in cogging.harmonics]
        _harmonics(record["cogging"], cogging.pitch_m, parts)
        if cogging.aperiodic:
            _profile(record["cogging_profile"], cogging.aperiodic)
            terms |= Term.POSITION_FORCE
    if force := plant.position_force:
        record["force_center"] = force.center_m
        record["spring"], record["cubic_spring"] = force.spring_v_m, force.cubic_v_m3
        _profile(record["force_profile"], force.profile)
        terms |= Term.POSITION_FORCE
        if force.end_effect:
            record["end_effect_force"] = force.end_effect.force_v
            record["end_effect_length"] = force.end_effect.length_m
            terms |= Term.END_EFFECT
        if force.cable:
            record["cable_force"] = force.cable.force_v
            record["cable_length"] = force.cable.length_m
            terms |= Term.CABLE
    if periodic := plant.periodic_disturbance:
        record["periodic_amplitude"] = periodic.amplitude_v
        record["periodic_rad_s"] = 2.0 * math.pi * periodic.frequency_hz
        record["periodic_phase"] = periodic.phase_rad
        terms |= Term.PERIODIC
    if plant.force_noise_rms_v:
        record["noise_rms"] = plant.force_noise_rms_v
        terms |= Term.NOISE
    if wandering := plant.wandering_force:
        record["wandering_rms"] = wandering.rms_v
        steps = float(clock["period"][0]) / wandering.time_constant_s
        record["wandering_decay"] = math.exp(-steps)
        terms |= Term.WANDERING
    return terms


def _other_masses(record: Any, plant: Plant, numbers: Sequence[int]) -> Term:
    terms = Term(0)
    if (coupled := plant.cross_axis) and coupled.channel in numbers:
        record["coupled_to"] = numbers.index(coupled.channel)
        record["coupled_inertia"] = coupled.acceleration_v_s2_m
        record["coupled_viscous"] = coupled.velocity_v_s_m
        terms |= Term.CROSS_AXIS
    if mode := plant.flexible_mode:
        inertia = mode.fraction * plant.inertia_v_s2_m
        _sprung(record["flexible"], inertia, mode.frequency_hz, mode.damping_ratio, 0.0)
        record["flexible"]["friction"] = mode.friction_v
        terms |= Term.FLEXIBLE_MODE if inertia else Term(0)
    if loose := plant.backlash:
        inertia = loose.fraction * plant.inertia_v_s2_m
        frequency, gap = loose.contact_frequency_hz, loose.gap_m
        _sprung(record["loose"], inertia, frequency, loose.damping_ratio, gap)
        terms |= Term.BACKLASH if inertia else Term(0)
    return terms


def _encoder(record: Any, plant: Plant, channel: Channel) -> None:
    encoder = plant.encoder
    record["resolution"] = channel.resolution_m
    record["counter_bits"] = channel.counter_bits
    record["sign"] = -1 if encoder.reversed else 1
    record["absolute"] = encoder.absolute
    record["encoder_noise_rms"] = encoder.noise_rms_m
    record["index_marks"] = len(encoder.index_marks_m)
    record["index_mark"][: len(encoder.index_marks_m)] = encoder.index_marks_m
    if error := plant.encoder_error:
        record["error_amplitude"] = error.amplitude_m
        record["error_rad_m"] = 2.0 * math.pi / error.period_m
        record["error_phase"] = error.phase_rad


def _switches(record: Any, plant: Plant) -> None:
    limits = plant.limit_switches_m
    record["lower_switch"], record["upper_switch"] = limits or (-math.inf, math.inf)
    home = plant.home_switch
    if home is None:  # nowhere pressed
        record["home_from"], record["home_to"] = math.inf, -math.inf
        return
    record["home_from"] = -math.inf if home.from_m is None else home.from_m
    record["home_to"] = math.inf if home.to_m is None else home.to_m


def _harmonics(record: Any, pitch_m: float, terms: Sequence[tuple[int, float, float]]) -> None:
    record["count"] = len(terms)
    for k, (order, amplitude, phase) in enumerate(terms):
        record["wave_number"][k] = 2.0 * math.pi * order / pitch_m
        record["amplitude"][k], record["phase"][k] = amplitude, phase


def _profile(record: Any, profile: Profile | None) -> None:
    if profile is None:
        return
    from scipy.interpolate import CubicSpline  # long to load, and few gantries have a profile

    spline = CubicSpline(profile.position_m, profile.force_v)
    nodes, cell = np.linspace(
        profile.position_m[0], profile.position_m[-1], PROFILE_CELLS + 1, retstep=True
    )
    record["start"], record["cells_per_m"] = nodes[0], 1.0 / cell
    record["nodes"][:, 0] = spline(nodes)
    record["nodes"][:, 1] = spline(nodes, 1) * cell


def _sprung(record: Any, inertia: float, frequency_hz: float, zeta: float, gap_m: float) -> None:
    omega = 2.0 * math.pi * frequency_hz
    record["inertia"], record["stiffness"] = inertia, omega * omega
    record["damping"], record["half_gap"] = 2.0 * zeta * omega, 0.5 * gap_m
