"""A diagnosis as JSON and as values in words: the contract's keys, units, numbers only."""

import json
import math
from dataclasses import replace

import diagnosis_bench as bench
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorctl.identify.diagnose.report.json_document import axis_document, diagnosis_document
from motorctl.identify.diagnose.report.parameter_text import Value, percent
from motorctl.model import effect_class

TRIPLE = {"value", "std_error", "unit"}


def strict(document):
    """Read a document back as a script would; NaN and infinity are no JSON."""
    return json.loads(json.dumps(document, allow_nan=False))


@pytest.fixture(scope="module")
def cogging():
    return bench.axis_diagnosis("cogging")


def test_the_document_has_every_key_of_the_contract(cogging):
    found = strict(diagnosis_document(bench.recording(x=cogging)))
    assert {"source", "sample_rate_hz", "duration_s", "axes"} <= set(found)
    axis = found["axes"]["x"]
    assert axis["declared"] == list(bench.DECLARED)
    assert set(axis["parameters"]) == set(bench.DECLARED)
    assert axis["parameters"]["inertia"] == {
        "value": pytest.approx(0.43),
        "std_error": pytest.approx(1e-3),
        "unit": "V*s^2/m",
    }
    assert axis["verdict"] == "effect"
    effect = axis["effects"][0]
    assert effect["name"] == "cogging"
    assert 0.0 <= effect["confidence"] <= 1.0
    assert 0.0 <= effect["explained_fraction"] <= 1.0
    assert effect["parameters"]["pitch_m"] == {
        "value": 0.03,
        "std_error": pytest.approx(3e-5),
        "unit": "m",
    }
    assert effect["indistinguishable_from"] == []
    assert effect["evidence"]
    assert set(effect["alternatives"][0]) >= {"name", "why_not"}
    assert set(axis["error"]) >= {
        "unit",
        "held_out_before_rms",
        "held_out_after_rms",
        "noise_floor_rms",
        "explained_fraction",
        "simulated_position_before_rms_m",
        "simulated_position_after_rms_m",
    }


def test_parameters_of_the_declared_model_alone_are_told_apart_from_the_injected_ones():
    """Stribeck friction that is missing bends the viscous friction of the declared model."""
    axis = strict(axis_document(bench.axis_diagnosis("stribeck")))
    alone = axis["parameters_declared_alone"]["viscous_friction"]["value"]
    together = axis["parameters"]["viscous_friction"]["value"]
    assert together == pytest.approx(0.25)
    assert abs(alone - together) > 0.02


def test_sine_and_cosine_are_given_as_amplitude_and_phase_too(cogging):
    """A sin(2 pi k x/P + phase) with the standard errors that follow from both coefficients."""
    found = strict(axis_document(cogging))["effects"][0]["parameters"]
    assert found["amplitude_1"]["value"] == pytest.approx(math.hypot(0.25, 0.1))
    assert found["amplitude_1"]["unit"] == "V"
    # equal and independent errors of both coefficients are the error of any direction
    assert found["amplitude_1"]["std_error"] == pytest.approx(2e-3)
    assert found["phase_2_rad"]["value"] == pytest.approx(math.atan2(-0.08, 0.05))
    assert found["phase_2_rad"]["std_error"] == pytest.approx(2e-3 / math.hypot(0.05, 0.08))
    x, pitch = 0.0123, 0.03
    angle = 2.0 * math.pi * x / pitch
    as_pair = found["sin_1"]["value"] * math.sin(angle) + found["cos_1"]["value"] * math.cos(angle)
    as_one = found["amplitude_1"]["value"] * math.sin(angle + found["phase_1_rad"]["value"])
    assert as_one == pytest.approx(as_pair)


@pytest.mark.parametrize("name", sorted(bench.KNOWN))
def test_every_effect_is_told_with_options_values_and_units(name):
    found = strict(axis_document(bench.axis_diagnosis(name)))["effects"][0]
    cls = effect_class(name)
    # what the document tells makes the same effect again
    effect = cls(cls.Options.model_validate(found["options"]))
    assert effect.constants == bench.make(name)[0].constants
    for parameter in effect.parameters:
        entry = found["parameters"][parameter.name or name]
        assert set(entry) >= TRIPLE
        assert isinstance(entry["value"], float)
    for option, value in bench.KNOWN[name][0].items():
        if isinstance(value, float):
            assert found["parameters"][option]["value"] == value
            assert found["parameters"][option]["unit"] or option in ("exponent", "damping_ratio")


def test_lag_is_told_by_its_time_alone():
    found = strict(axis_document(bench.axis_diagnosis("input_lag")))["effects"][0]
    assert found["parameters"] == {
        "time_s": {"value": 0.8e-3, "std_error": pytest.approx(0.8e-6), "unit": "s"}
    }


def test_a_rotary_axis_that_is_driven_by_current_has_its_own_units():
    axis = bench.axis_diagnosis("cogging")
    data = replace(
        axis.data,
        position_unit="rad",
        command_unit="A",
        force_per_command=0.4,
        force_unit="N*m",
    )
    found = strict(axis_document(replace(axis, data=data, error=replace(axis.error, unit="A"))))
    assert found["parameters"]["inertia"]["unit"] == "A*s^2/rad"
    assert found["parameters_force"]["inertia"]["unit"] == "N*m*s^2/rad"
    assert found["parameters_force"]["inertia"]["value"] == pytest.approx(0.4 * 0.43)
    assert found["effects"][0]["parameters"]["pitch_m"]["unit"] == "rad"
    assert found["effects"][0]["parameters"]["sin_1"]["unit"] == "A"
    assert found["error"]["simulated_position_unit"] == "rad"


def test_forces_are_on_the_load_s_side_as_fit_gives_them(cogging):
    found = strict(axis_document(cogging))["parameters_force"]
    assert found["coulomb_friction"]["value"] == pytest.approx(35.0 * 0.18)
    assert found["offset"]["value"] == pytest.approx(-35.0 * 0.03)
    assert found["cogging_sin_1"] == {
        "value": pytest.approx(35.0 * 0.25),
        "std_error": pytest.approx(35.0 * 1e-3),
        "unit": "N",
    }


def test_without_a_force_constant_no_force_is_told(cogging):
    plain = replace(cogging, data=replace(cogging.data, force_per_command=None))
    assert strict(axis_document(plain))["parameters_force"] == {}


def test_where_nothing_could_be_fitted_every_number_is_null():
    found = strict(axis_document(bench.insufficient_axis()))
    assert found["verdict"] == "insufficient_data"
    assert found["effects"] == []
    assert found["error"]["held_out_before_rms"] is None
    assert found["error"]["explained_fraction"] is None
    assert all(entry["value"] is None for entry in found["parameters"].values())
    assert found["missing"][0]["program"]["kind"] == "moves"


def test_unknown_structure_tells_what_it_depends_on_and_what_would_compensate_it():
    found = strict(axis_document(bench.unknown_axis()))
    assert found["effects"] == []
    assert found["unknown"]["depends_on"] == ["position", "velocity"]
    assert found["unknown"]["family"] == "force_of_position"
    compensation = found["unknown"]["compensation"]
    assert compensation["name"] == "position_force"
    assert compensation["parameters"]["knot_1"]["value"] == pytest.approx(0.02)
    assert compensation["options"]["knots"] == [0.0, 0.4, 8]


def test_unknown_structure_without_a_compensation_says_so():
    axis = bench.unknown_axis(depends_on=())
    bare = replace(axis.unknown, compensation=None, theta=np.zeros(0), std_error=np.zeros(0))
    found = strict(axis_document(replace(axis, unknown=bare)))
    assert found["unknown"]["compensation"] is None
    assert found["unknown"]["depends_on"] == []


@given(st.floats(allow_nan=True, allow_infinity=True), st.floats(allow_nan=True))
def test_values_are_told_whatever_they_are(value, error):
    told = Value(value, error, "V").told()
    assert told.endswith("V") or told == "–"
    assert "nan" not in told
    strict(Value(value, error, "V").document())


@given(
    st.floats(1e-6, 1e6).map(lambda v: round(v, 9)),
    st.floats(1e-4, 0.3),
    st.sampled_from(["V", "m", "s", "rad"]),
)
def test_a_value_in_words_is_right_within_a_tenth_of_its_standard_error(value, relative, unit):
    told = Value(value, relative * value, unit).told()
    number, sign, rest = told.partition(" ± ")
    assert sign
    error, _, own = rest.partition(" ")
    prefix = {"m": 1e-3, "µ": 1e-6}[own[0]] if len(own) > len(unit) else 1.0
    assert abs(float(number) * prefix - value) <= 0.1 * relative * value + 1e-9 * value
    assert float(error) * prefix == pytest.approx(relative * value, rel=0.06)


@given(st.floats(0.0, 1.0))
def test_a_share_that_is_not_all_never_reads_as_all(share):
    assert (percent(share) == "100 %") == (share == 1.0)
