"""What every planned motion must keep to, for the tests of the motion room."""

import numpy as np

from motorctl.motion.segments import derivatives


def assert_continuous(trajectory, x=1e-9, v=1e-9, a=1e-9):
    """No joint steps by more than the given position, velocity and acceleration."""
    segments = trajectory.segments
    ends = derivatives(segments["c"], segments["duration_s"])
    starts = derivatives(segments["c"], np.zeros(len(segments)))
    for end, start, tolerance in zip(ends, starts, (x, v, a), strict=True):
        assert np.abs(end[:-1] - start[1:]).max(initial=0.0) <= tolerance


def assert_at_rest_at_both_ends(trajectory):
    """It starts and ends without velocity or acceleration."""
    _, v, a = trajectory.sample([0.0, trajectory.duration_s])
    np.testing.assert_allclose(v, 0, atol=1e-9)
    np.testing.assert_allclose(a, 0, atol=1e-9)


def assert_within(trajectory, velocity, acceleration, jerk, relative=1e-9):
    """The exact peaks keep to the limits."""
    peaks = trajectory.peaks()
    assert peaks.max_velocity_m_s <= velocity * (1 + relative)
    assert peaks.max_acceleration_m_s2 <= acceleration * (1 + relative)
    assert peaks.max_jerk_m_s3 <= jerk * (1 + relative)
