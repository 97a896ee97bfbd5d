"""The error across a path of two axes: what of it is to the side, and how large it is drawn."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.image import imread

from motorctl.identify.compare.contour_picture import contour_of, pairs_of, plot_contour
from motorctl.identify.compare.pictures import plot_comparison
from motorctl.identify.compare.runs import Comparison, compare
from motorctl.log import AxisRecording, Recording

RADIUS_M = 0.05
PHASE = np.linspace(0.0, 6.0 * np.pi, 3000)
CIRCLE = {
    "axes": {"x": {"program": "ring"}, "y": {"program": "ring"}},
    "programs": {"ring": {"kind": "circle", "axes": ["x", "y"]}},
}


def circled(
    radial_m: float, along_rad: float, metadata: dict[str, Any] | None = None
) -> Comparison:
    """A circle, followed too far out and too far ahead."""
    there = RADIUS_M + radial_m
    axes = {
        name: AxisRecording(
            name=name,
            position=there * turn(PHASE + along_rad),
            reference=RADIUS_M * turn(PHASE),
            command=np.zeros(len(PHASE)),
        )
        for name, turn in (("x", np.cos), ("y", np.sin))
    }
    told = {"config": CIRCLE} if metadata is None else metadata
    return compare([Recording("circle", 1000.0, np.arange(len(PHASE)) / 1000.0, axes, told)])


@given(st.floats(-1e-4, 1e-4))
def test_an_error_outwards_is_to_the_right_of_a_circle_that_turns_left(radial_m: float) -> None:
    contour = contour_of(circled(radial_m, 0.0).runs[0], ("x", "y"))
    np.testing.assert_allclose(contour.error, -radial_m, atol=1e-9)
    assert contour.largest == pytest.approx(abs(radial_m), abs=1e-9)
    assert contour.rms == pytest.approx(abs(radial_m), abs=1e-9)


@given(st.floats(-1e-3, 1e-3))
def test_an_error_along_the_path_is_none_to_the_side(along_rad: float) -> None:
    contour = contour_of(circled(0.0, along_rad).runs[0], ("x", "y"))
    assert contour.largest < RADIUS_M * (along_rad**2 + 1e-7)  # the circle bends away


def test_a_path_is_drawn_where_two_axes_follow_one_program(tmp_path: Path) -> None:
    names = {path.name for path in plot_comparison(circled(1e-5, 0.0), tmp_path)}
    assert "contour_x_y.png" in names


@pytest.mark.parametrize(
    "metadata",
    [
        {},
        {
            "config": {
                "axes": {"x": {"program": "shuttle"}},
                "programs": {"shuttle": {"axes": ["x"]}},
            }
        },
        {"config": CIRCLE, "motions": [{"name": "shuttle", "axes": ["x"]}]},
        {"config": "damaged"},
    ],
    ids=["foreign", "one axis", "another motion", "damaged"],
)
def test_no_path_is_drawn_where_no_program_of_two_axes_was_followed(
    metadata: dict[str, Any],
) -> None:
    assert pairs_of(circled(1e-5, 0.0, metadata)) == []


def test_of_a_joint_and_a_carriage_each_axis_own_error_is_drawn(tmp_path: Path) -> None:
    recording = circled(1e-5, 1e-4).runs[0].recording
    turning = dataclasses.replace(recording.axes["y"], position_unit="rad")
    axes = {"x": recording.axes["x"], "y": turning}
    compared = compare([dataclasses.replace(recording, axes=axes)])
    assert pairs_of(compared) == [("x", "y")]
    contour = contour_of(compared.runs[0], ("x", "y"))
    assert len(contour.error) == 0  # metres and radians have no distance in common
    for name, off, path in zip("xy", contour.off, contour.path, strict=True):
        record = axes[name]
        assert record.reference is not None
        own = record.position - record.reference
        np.testing.assert_allclose(off, own[np.isin(record.reference, path)], atol=1e-12)
    assert imread(plot_contour(compared, ("x", "y"), tmp_path / "mixed.png")).size > 0


def test_axes_at_rest_draw_an_empty_path(tmp_path: Path) -> None:
    still = np.zeros(500)
    axes = {n: AxisRecording(name=n, position=still, reference=still, command=still) for n in "xy"}
    recording = Recording("rest", 1000.0, np.arange(500) / 1000.0, axes, {"config": CIRCLE})
    picture = plot_contour(compare([recording]), ("x", "y"), tmp_path / "rest.png")
    assert imread(picture).size > 0
