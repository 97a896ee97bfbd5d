"""What `check` takes of a guard trips as itself; what it refuses is told as something else."""

import math

import pytest
import yaml
from beam_bench import absolute, beam
from config_bench import problems, write
from loop_bench import (
    TS,
    Rig,
    Still,
    gantry,
    homed_by,
    with_axes,
    with_driver,
    with_sim,
)

from motorctl.config import load, shipped_config, summarise
from motorctl.config.guard_keys import EncoderNoise, Skew, Thermal
from motorctl.config.heat_rules import WARM
from motorctl.log.sample import AxisState, FaultCause
from motorctl.motion import point_to_point

pytestmark = pytest.mark.slow

RESOLUTION_M = 0.5e-6
TOP_SPEED_M_S = 1.5


def shipped(**keys):
    """Return the shipped gantry as plain data, with these keys of its x axis."""
    data = yaml.safe_load(shipped_config("published_gantry").read_text())
    for part, changes in keys.items():
        data["axes"]["x"].setdefault(part, {}).update(changes)
    return data


def takes(folder, **keys):
    """Return whether `check` takes the shipped gantry with these keys of its x axis."""
    told = problems(folder, shipped(**keys))
    assert all(problem.key.startswith("axes.x.") for problem in told)
    return not told


def edge(accepted, taken, refused):
    """Return the last value that is taken and the first that is refused, to within 1 %."""
    assert accepted(taken)
    assert not accepted(refused)
    while abs(taken - refused) > 0.01 * taken:
        middle = 0.5 * (taken + refused)
        taken, refused = (middle, refused) if accepted(middle) else (taken, middle)
    return taken, refused


# The narrowest counter


@pytest.fixture
def narrow(tmp_path):
    def accepted(bits):
        # An absolute encoder's counter would have to be as wide as the travel.
        homing = homed_by("index").model_dump(exclude_none=True)
        return takes(tmp_path, encoder={"counter_bits": bits}, homing=homing)

    assert [bits for bits in (11, 12, 13, 14) if accepted(bits)] == [13, 14]
    patient = {"following_error": {"filter_time_s": 1e3}}
    machine = with_axes(gantry(), encoder={"counter_bits": 13}, limits=patient)
    with Rig(with_driver(machine, Still)) as rig:
        rig.start()
        yield rig


def go(rig, speed_m_s, periods=1.0):
    rig.driver.counts[0] += round(speed_m_s * periods * TS / RESOLUTION_M)
    rig.advance(1)


def test_an_axis_that_is_too_fast_is_told_as_that_with_the_narrowest_counter(narrow):
    for _ in range(10):
        go(narrow, 1.23 * TOP_SPEED_M_S)
    assert narrow.fault_of("x") is FaultCause.OVERSPEED


def test_late_reads_at_top_speed_are_no_jump_with_the_narrowest_counter(narrow):
    for _ in range(20):
        go(narrow, TOP_SPEED_M_S, 1.99)
        go(narrow, TOP_SPEED_M_S, 0.01)
    assert narrow.state_of("x") is AxisState.IDLE


# The motor's heat


THETA_0 = {
    "inertia_v_s2_m": 0.19,
    "viscous_friction_v_s_m": 0.25,
    "coulomb_friction_v": 0.1,
    "offset_v": 0.0,
    "em_quadratic_1_v": -0.005,
    "em_cubic_1_v2": -0.0005,
}
"""The plant that the shipped configuration starts from, which is what `check` reckons with."""


@pytest.mark.parametrize("seconds", [0.01, pytest.param(0.3, marks=pytest.mark.slow)])
def test_a_motor_trips_on_its_program_where_check_says_that_it_always_would(tmp_path, seconds):
    def thermal(volts):
        return {"continuous_voltage_v": volts, "time_constant_s": seconds}

    plant = with_sim(gantry(), plants={0: THETA_0})
    taken, refused = edge(lambda v: takes(tmp_path, guards={"thermal": thermal(v)}), 9.7, 0.5)
    cold = refused / WARM  # `check` reckons with a warm motor, which the plant is not
    for volts, fault in ((1.02 * taken, FaultCause.NONE), (0.98 * cold, FaultCause.THERMAL)):
        guards = {"thermal": Thermal(**thermal(volts))}
        with Rig(with_axes(plant, ["x"], guards=guards)) as rig:
            rig.start()
            rig.follow_programs(["published_x"])
            rig.seconds(3.5)
            assert rig.fault_of("x") is fault


# Noise


@pytest.fixture(scope="module")
def most_noise_m(tmp_path_factory):
    folder = tmp_path_factory.mktemp("noise")
    taken, _ = edge(lambda m: takes(folder, guards={"encoder_noise": {"rms_m": m}}), 50e-6, 1e-3)
    return taken


def told_as(limit_m, noise_m, seed):
    """Return what noise of so much rms in its second difference trips at rest."""
    plants = {0: {"encoder": {"noise_rms_m": noise_m / math.sqrt(6.0)}}}
    machine = with_axes(
        with_sim(gantry(), plants=plants, seed=seed),
        ["x"],
        guards={"encoder_noise": EncoderNoise(rms_m=limit_m)},
    )
    with Rig(machine) as rig:
        rig.start()
        rig.seconds(0.5)
        return rig.fault_of("x")


@pytest.mark.parametrize("seed", range(3))
def test_noise_beyond_the_largest_limit_that_check_takes_is_told_as_noise(most_noise_m, seed):
    assert told_as(most_noise_m, 1.1 * most_noise_m, seed) is FaultCause.ENCODER_NOISE


@pytest.mark.parametrize("seed", range(3))
def test_noise_beyond_thrice_as_much_would_be_told_as_something_else(most_noise_m, seed):
    told = told_as(3.0 * most_noise_m, 3.3 * most_noise_m, seed)
    assert told not in (FaultCause.NONE, FaultCause.ENCODER_NOISE)


# Friction at the start


@pytest.mark.parametrize(("limit_m", "trips"), [(3e-6, True), (4.3e-6, False)])
def test_a_slow_start_against_friction_trips_only_a_limit_that_check_refuses_or_notes(
    tmp_path, limit_m, trips
):
    # 0.1 V by ks k1, 95 V s/m x 250 1/s: 4.2 um; with the fast adaptation 3.3 um.
    error = {"minimum_m": limit_m, "per_velocity_s": 0.0, "filter_time_s": 0.0}
    data = shipped(limits={"following_error": error})
    del data["axes"]["x"]["program"]  # which is fast
    refused = problems(tmp_path, data)
    assert bool(refused) is trips
    if not refused:
        notes = summarise(load(write(tmp_path, data)))["notes"]
        assert not [note for note in notes if "friction holds" in note]
    sticky = {**THETA_0, "presliding": {"kind": "dahl", "displacement_m": 1e-6}}
    plant = with_sim(gantry(), plants={0: sticky})
    with Rig(with_axes(plant, ["x"], limits={"following_error": error})) as rig:
        rig.start()
        rig.follow({"x": point_to_point(0.0, 0.2e-3, 0.3e-3, 5.0, 500.0)})
        rig.seconds(0.4)
        assert (rig.fault_of("x") is FaultCause.FOLLOWING_ERROR) is trips


# What the law itself stays behind


@pytest.mark.parametrize(("limit_m", "trips"), [(12e-6, True), (18e-6, False)])
def test_a_program_trips_a_following_error_that_the_law_is_beyond_with_an_exact_model(
    tmp_path, limit_m, trips
):
    error = {"minimum_m": limit_m, "per_velocity_s": 0.0, "filter_time_s": 0.0}
    data = shipped(limits={"following_error": error})
    assert bool(problems(tmp_path, data)) is trips
    machine = with_sim(gantry(), plants={0: THETA_0})
    with Rig(with_axes(machine, ["x"], limits={"following_error": error})) as rig:
        rig.start()
        rig.follow({"x": machine.programs["published_x"].trajectories()["x"]})
        rig.seconds(3.0)
        assert (rig.fault_of("x") is FaultCause.FOLLOWING_ERROR) is trips


# A beam that is squared


@pytest.mark.parametrize(("limit_m", "trips"), [(4e-6, True), (9e-6, True), (17e-6, False)])
def test_squaring_a_beam_trips_a_skew_limit_that_check_refuses(tmp_path, limit_m, trips):
    data = yaml.safe_load(shipped_config("dual_gantry").read_text())
    data["axes"]["x"]["guards"]["skew"]["limit_m"] = limit_m
    assert bool(problems(tmp_path, data)) is trips
    askew = absolute(beam(), apart_m=0.3e-3)
    with Rig(with_axes(askew, ["x"], guards={"skew": Skew(limit_m=limit_m)})) as rig:
        rig.start()
        rig.seconds(0.5)
        assert (rig.fault_of("x") is FaultCause.SKEW) is trips
