"""Positions, ways and speeds as a person writes them: never taken for the other."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorctl.cli.lengths import (
    Target,
    acceleration_m_s2,
    length_m,
    target_of,
    velocity_m_s,
)
from motorctl.errors import UsageError
from motorctl.log.units import POSITION_UNITS, VELOCITY_UNITS

numbers = st.floats(-1e3, 1e3, allow_nan=False)
UNITS = {unit: factor for unit, (factor, _) in POSITION_UNITS.items()}
UNITS |= {"µm": 1e-6, "°": math.pi / 180.0}
units = st.sampled_from(sorted(UNITS))


@given(numbers)
def test_a_number_without_a_unit_is_a_position_in_metres_whatever_its_sign(value: float) -> None:
    assert target_of(f"{value!r}", None) == Target(position_m=value)


@given(st.floats(0.0, 1e3), units, st.sampled_from(["", " "]))
def test_a_number_with_a_unit_is_a_position_in_that_unit(
    value: float, unit: str, between: str
) -> None:
    target = target_of(f"{value!r}{between}{unit}", None)
    assert target.by_m is None
    assert target.position_m == pytest.approx(value * UNITS[unit])


@given(st.floats(0.0, 1e3), units)
def test_a_plus_with_a_unit_is_a_way(value: float, unit: str) -> None:
    target = target_of(f"+{value!r}{unit}", None)
    assert target.position_m is None
    assert target.by_m == pytest.approx(value * UNITS[unit])


@given(numbers, st.sampled_from(["", *UNITS]))
def test_by_is_a_way_with_either_sign(value: float, unit: str) -> None:
    target = target_of(None, f"{value!r}{unit}")
    assert target.by_m == pytest.approx(value * UNITS.get(unit, 1.0))


@pytest.mark.parametrize(
    ("written", "meanings"),
    [
        ("-10mm", ("position in metres is -0.01", "--by -10mm")),
        ("-2 um", ("position in metres is -2e-06", "--by -2 um")),
        ("-90deg", ("position in radians is -1.5708", "--by -90deg")),
        ("+0.01", ("A position is 0.01", "way +0.01m or, of a rotary axis, +0.01rad")),
    ],
)
def test_what_could_be_either_is_refused_with_both_ways_to_say_it(
    written: str, meanings: tuple[str, str]
) -> None:
    with pytest.raises(UsageError, match="is it a position or a way") as refused:
        target_of(written, None)
    for meaning in meanings:
        assert meaning in str(refused.value)


@pytest.mark.parametrize(
    "written", ["", "mm", "ten", "10 furlongs", "1e400", "nan", "inf", "1mm2", "1 2", "0x10"]
)
def test_what_means_nothing_is_refused_with_what_would_be_right(written: str) -> None:
    with pytest.raises(UsageError, match=r"should be a length such as 0\.25, 250mm"):
        length_m(written)


@pytest.mark.parametrize("given_twice", [(None, None), ("0.1", "1mm")])
def test_a_move_needs_one_of_both(given_twice: tuple[str | None, str | None]) -> None:
    with pytest.raises(UsageError, match="a position, or a way with --by"):
        target_of(*given_twice)


def test_speeds_have_units_of_their_own() -> None:
    assert velocity_m_s("0.05") == velocity_m_s("50mm/s") == velocity_m_s("50 mm/s") == 0.05
    assert acceleration_m_s2("2") == acceleration_m_s2("2000mm/s^2") == 2.0
    for wrong in ("50mm", "50mm/min", "50mm/s^2", "3deg"):
        with pytest.raises(UsageError, match=r"should be a velocity such as 0\.05 or 50mm/s"):
            velocity_m_s(wrong)
    with pytest.raises(UsageError, match="should be an acceleration"):
        acceleration_m_s2("5mm/s")


@given(st.floats(0.0, 1e3), units)
def test_angles_are_of_rotary_axes_and_lengths_of_linear_ones(value: float, unit: str) -> None:
    base = dict.fromkeys(("°",), "rad").get(unit) or POSITION_UNITS.get(unit, (0.0, "m"))[1]
    other = "m" if base == "rad" else "rad"
    assert length_m(f"{value!r}{unit}", base) == length_m(f"{value!r}{unit}")
    with pytest.raises(UsageError, match=r"should be an? (length|angle) such as .* of this axis"):
        length_m(f"{value!r}{unit}", other)
    assert length_m(f"{value!r}", other) == value


def test_turns_a_minute_are_a_speed_of_a_rotary_axis() -> None:
    assert velocity_m_s("30rpm", "rad") == pytest.approx(math.pi)
    assert velocity_m_s("180deg/s", "rad") == pytest.approx(VELOCITY_UNITS["deg/s"][0] * 180.0)
    assert acceleration_m_s2("180deg/s^2", "rad") == pytest.approx(math.pi)
    with pytest.raises(UsageError, match=r"0\.05 or 50mm/s of this axis"):
        velocity_m_s("30rpm", "m")
