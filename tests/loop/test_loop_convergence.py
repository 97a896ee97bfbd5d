"""Theorem 2 of the paper: with rich motion and an aligned regressor the estimate is the truth.

The plant is the simulated gantry without what the declared model lacks; it is written apart from
the model. Both axes follow several sines at once, through a program of recorded points.
"""

import numpy as np
import pytest
from loop_bench import Rig, gantry, rich_points, with_axes, with_sim

from motorctl.motion import Points, Trajectory

TRUTH = {
    "x": np.array([0.197, 0.2265, 0.139, 0.012, -0.0122, -0.00104]),
    "y": np.array([0.670, 0.296, 0.182, 0.004, -0.0168, -0.00058]),
}
PEAK_M_S2 = {"x": 36.0, "y": 11.0}
DURATION_S = 24.0
DELAY_S = 0.48e-3  # 2.4 periods
VOLTS = np.linspace(-10.0, 10.0, 201)


@pytest.fixture(scope="module")
def rich_motion(tmp_path_factory) -> dict[str, Trajectory]:
    path = tmp_path_factory.mktemp("program") / "rich.csv"
    rich_points(path, DURATION_S, **PEAK_M_S2)
    return Points(name="rich", axes=("x", "y"), file=path).trajectories()


def learned(motion, *, delay_s: float, known_s: float) -> dict[str, np.ndarray]:
    """Return theta_hat after the motion on a plant with a delay, of which `known_s` is known."""
    plant = {"initial_position_m": 0.2}
    if delay_s:
        plant["input_delay"] = {"time_s": delay_s}
    machine = with_axes(
        with_sim(gantry(), plants={0: plant, 1: plant}),
        encoder={"resolution_m": 1e-9, "counter_bits": 64},
        limits={"max_velocity_m_s": 2.0},
        adaptation={"input_delay_s": known_s},
    )
    with Rig(machine) as rig:
        rig.start()
        rig.follow(motion)
        rig.seconds(DURATION_S - 1.0)
        rig.raise_faults()
        return {
            axis: rig.last(axis)["theta_hat"][: truth.size].copy() for axis, truth in TRUTH.items()
        }


def input_map(theta: np.ndarray) -> np.ndarray:
    return VOLTS + theta[4] * VOLTS * abs(VOLTS) + theta[5] * VOLTS**3


def worst_of_map(theta: np.ndarray, truth: np.ndarray) -> float:
    """Return the largest error of v(u) over the range, as a share of v(uM)."""
    return np.abs(input_map(theta) - input_map(truth)).max() / input_map(truth).max()


@pytest.mark.slow
@pytest.mark.parametrize("delay_s", [0.0, DELAY_S])
def test_the_estimate_converges_to_the_truth(rich_motion, delay_s):
    theta_hat = learned(rich_motion, delay_s=delay_s, known_s=delay_s)
    for axis, truth in TRUTH.items():
        assert theta_hat[axis][:4] == pytest.approx(truth[:4], rel=0.01)
        # theta5 and theta6 are nearly collinear: the map that they make is what counts.
        assert worst_of_map(theta_hat[axis], truth) < 0.01


@pytest.mark.slow
def test_a_delay_that_is_not_known_keeps_the_estimate_from_the_truth(rich_motion):
    theta_hat = learned(rich_motion, delay_s=DELAY_S, known_s=0.0)
    for axis, truth in TRUTH.items():
        error = np.abs(theta_hat[axis] / truth - 1.0)
        assert error[1] > 0.1
        assert error[4] > 0.1
