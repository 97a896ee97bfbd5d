"""A log of a rotary axis says once that it is one, and its columns are in radians."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded_ring import AXES

from motorctl.axis_units import LINEAR, ROTARY, units_in, units_of
from motorctl.log.columns import LogAxis, log_columns, log_schema
from motorctl.log.sample import FaultCause
from motorctl.loop.faults import fault_message

SENTENCES = [
    ("limit 0.4 mm, at 1.2 m/s", "limit 0.4 mrad, at 1.2 rad/s"),
    ("3 V*s^2/m and 5e-06 m", "3 V*s^2/rad and 5e-06 rad"),
    ("2 V s²/m, error [µm], 0.5um a count", "2 V s²/rad, error [µrad], 0.5urad a count"),
    ("eF µm 3.2", "eF µrad 3.2"),
    ("axis m: 10 ms, 3 min, max_velocity_m_s 4", "axis m: 10 ms, 3 min, max_velocity_m_s 4"),
    ("0.8 N*m/V, 0.02 kg*m^2", "0.8 N*m/V, 0.02 kg*m^2"),
    ("m/s^2", "rad/s^2"),
    ("m", "rad"),
]


@pytest.mark.parametrize(("metres", "radians"), SENTENCES)
def test_a_sentence_in_metres_is_told_in_radians_with_its_numbers_untouched(metres, radians):
    assert ROTARY.words(metres) == radians
    assert LINEAR.words(metres) == metres


@given(st.floats(allow_nan=False), st.sampled_from(["m", "mm", "um", "m/s", "m/s^2", "V*s/m"]))
def test_no_number_is_changed_and_no_metre_left(value, unit):
    told = ROTARY.words(f"axis x at {value:g} {unit}, more")
    assert told.startswith(f"axis x at {value:g} ")
    assert "rad" in told


def test_columns_of_a_rotary_axis_are_in_radians():
    columns = {c.name: c for c in log_columns([LogAxis("c", ("inertia",), units=ROTARY)])}
    assert columns["c.position_m"].unit == "rad"
    assert columns["c.reference_acceleration_m_s2"].unit == "rad/s^2"
    assert columns["c.command_v"].unit == "V"
    assert columns["time_s"].unit == "s"
    assert {c.unit for c in log_columns(AXES) if c.name.endswith("velocity_m_s")} == {"m/s"}


@pytest.mark.parametrize(("units", "inertia"), [(LINEAR, "V*s^2/m"), (ROTARY, "V*s^2/rad")])
def test_each_estimate_carries_its_parameters_unit_in_the_axis_own_units(units, inertia):
    names, told = ("inertia", "force_ripple_sin_1"), ("V*s^2/m", "")
    axis = LogAxis("c", names, units=units, theta_units=told)
    schema = log_schema([axis], b"{}")
    assert schema.field("c.theta_hat_inertia").metadata[b"unit"] == inertia.encode()
    assert b"unit" not in schema.field("c.theta_hat_force_ripple_sin_1").metadata  # a number


def test_a_fault_of_a_rotary_axis_is_told_in_radians():
    told = fault_message(FaultCause.FOLLOWING_ERROR, 4e-3, 3e-3, 1.0, period_s=2e-4, units=ROTARY)
    assert told == "following error 4 mrad, limit 3 mrad, at 1.000 s"


def test_logs_that_are_older_than_rotary_axes_are_linear():
    assert units_in({"axes": {"x": {}}}, "x") is units_of(None) is LINEAR
    assert units_in({"axes": {"x": {"kind": "rotary"}}}, "x") is ROTARY
