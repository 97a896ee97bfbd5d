"""The simulated beam moves and turns as mechanics says, found here on paper."""

import numpy as np
import pytest
from sim_bench import BARE, Bench

from motorctl.hal import Channel
from motorctl_sim import SimDriver, SimOptions

L, ENDS, M, TURNING = 0.8, (0.09, 0.07), 0.3, 0.02
BEAM = {
    "channels": [0, 1],
    "spacing_m": L,
    "inertia_v_s2_m": M,
    "rotary_inertia_v_s2_m": TURNING,
}


def bench(*plants, **beam):
    changes = [*plants, *({} for _ in ENDS[len(plants) :])]
    ends = [BARE | {"inertia_v_s2_m": m} | c for m, c in zip(ENDS, changes, strict=True)]
    return Bench(*ends, beams=[BEAM | beam])


def mass_matrix(load=0.0, r=0.0):
    """From the kinetic energy of a rod, two carriages and a load: Hessian in (v1, v2), by hand."""
    arms = [(ENDS[0], L / 2), (ENDS[1], -L / 2), (M, 0.0), (load, r)]
    mean = sum(m for m, _ in arms)  # in (v, omega): v = (v1 + v2)/2, omega = (v1 - v2)/L
    cross = sum(m * arm for m, arm in arms)
    turning = sum(m * arm * arm for m, arm in arms) + TURNING * L * L
    to_mean = np.array([[0.5, 0.5], [1 / L, -1 / L]])
    return to_mean.T @ np.array([[mean, cross], [cross, turning]]) @ to_mean


@pytest.mark.parametrize("load", [None, (0.11, 0.25), (0.2, -0.4)])
def test_constant_volts_accelerate_the_ends_by_the_mass_matrix(load):
    beam = {"load": {"inertia_v_s2_m": load[0], "position_m": load[1]}} if load else {}
    volts = np.array([1.0, 0.3])
    motion = bench(**beam).run(volts, 500)
    expected = np.linalg.solve(mass_matrix(*(load or ())), volts)
    t = motion.time_s[-1]
    assert motion.acceleration_m_s2[-1] == pytest.approx(expected, rel=1e-9)
    assert motion.position_m[-1] == pytest.approx(0.5 * expected * t**2, rel=1e-6)


def test_a_load_over_one_end_leaves_the_other_end_without_it():
    near, far = np.linalg.inv(mass_matrix(0.2, L / 2)), np.linalg.inv(mass_matrix())
    volts = np.array([0.0, 1.0])
    beam = {"load": {"inertia_v_s2_m": 0.2, "position_m": L / 2}}
    motion = bench(**beam).run(volts, 50)
    assert motion.acceleration_m_s2[-1] == pytest.approx(near @ volts, rel=1e-9)
    assert (far @ volts)[1] > motion.acceleration_m_s2[-1][1]


def test_an_elastic_beam_swings_in_skew_at_its_natural_frequency():
    k = 400.0
    ends = [{"initial_position_m": 1e-3}, {"initial_position_m": -1e-3}]
    motion = bench(*ends, stiffness_v_m=k).run(0.0, 5000)
    skew = motion.position_m[:, 0] - motion.position_m[:, 1]
    # (1 -1) M^-1 (1 -1)' k is the square of the frequency.
    u = np.array([1.0, -1.0])
    omega = np.sqrt(k * u @ np.linalg.solve(mass_matrix(), u))
    assert skew == pytest.approx(2e-3 * np.cos(omega * motion.time_s), abs=2e-6)


def test_motors_that_push_against_each_other_skew_the_beam_by_their_volts_over_its_stiffness():
    k, du = 300.0, 0.6
    motion = bench(stiffness_v_m=k, damping_v_s_m=8.0).run([du, -du], 20_000)
    skew = motion.position_m[:, 0] - motion.position_m[:, 1]
    assert skew[-1] == pytest.approx(du / k, rel=1e-6)


def test_without_forces_momentum_and_energy_stay():
    ends = [{"initial_velocity_m_s": 0.3}, {"initial_velocity_m_s": 0.1}]
    motion = bench(*ends, stiffness_v_m=200.0).run(0.0, 3000)
    v, m = motion.velocity_m_s, mass_matrix()
    assert v @ m.sum(axis=0) == pytest.approx(np.full(len(v), v[0] @ m.sum(axis=0)), rel=1e-9)
    skew = motion.position_m[:, 0] - motion.position_m[:, 1]
    energy = 0.5 * np.einsum("ti,ij,tj->t", v, m, v) + 0.5 * 200.0 * skew**2
    assert energy == pytest.approx(np.full(len(v), energy[0]), rel=1e-3)


def test_a_weaker_motor_pulls_less():
    strong, weak = bench(), bench({}, {"force_constant_ratio": 0.8})
    volts = [0.0, 1.0]
    ratio = weak.run(volts, 50).acceleration_m_s2[-1] / strong.run(volts, 50).acceleration_m_s2[-1]
    assert ratio == pytest.approx([0.8, 0.8])


def test_a_machine_without_beams_moves_as_before():
    alone = Bench(BARE, BARE).run([1.0, 0.5], 50)
    assert alone.acceleration_m_s2[-1] == pytest.approx([5.0, 2.5], rel=1e-12)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"beams": [BEAM | {"channels": [0, 0]}]}, "should be two channels"),
        ({"beams": [BEAM, BEAM]}, "0 has a beam already"),
        ({"beams": [BEAM | {"stiffness_v_m": 1e9}]}, "too stiff"),
        ({"beams": [BEAM | {"damping_v_s_m": 1e6}]}, "damps too fast"),
        (
            {
                "beams": [BEAM],
                "plants": {
                    1: {
                        "flexible_mode": {
                            "frequency_hz": 50.0,
                            "damping_ratio": 0.1,
                            "fraction": 0.2,
                        }
                    }
                },
            },
            "no place on a beam",
        ),
    ],
)
def test_a_beam_that_cannot_be_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        SimOptions.model_validate(options)


def test_a_beam_whose_end_no_axis_uses_is_told():
    channel = Channel("x", 0, 1e-6, 32, 10.0)
    driver = SimDriver(SimOptions.model_validate({"beams": [BEAM]}), [channel], 0.2e-3)
    assert driver.problems() == [(("beams", 0, "channels", 1), "found 1, which no axis uses")]
