"""A model of one recording is tried on the same axis of another, or on its only one."""

import numpy as np
import pytest

from motorctl.errors import UsageError
from motorctl.identify.columns.measured import counterpart
from motorctl.log.recording import AxisRecording, Recording


def recording(*axes: str) -> Recording:
    rows = np.arange(4.0)
    named = {name: AxisRecording(name, rows, rows) for name in axes}
    return Recording("pulses.mat", 100.0, rows / 100.0, named)


def test_the_axis_of_that_name_is_taken_whatever_else_there_is() -> None:
    assert counterpart(recording("y", "x"), "x") == "x"


def test_an_only_axis_stands_for_it_under_another_name() -> None:
    assert counterpart(recording("joint_3"), "x") == "joint_3"


def test_of_several_axes_none_is_taken_for_it() -> None:
    with pytest.raises(UsageError, match=r"pulses\.mat: no axis 'x' to evaluate on; it has: y, z"):
        counterpart(recording("y", "z"), "x")
