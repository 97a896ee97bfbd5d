"""What diagnosis tries: forms that can be had from any recording, and near enough to any truth."""

import math

import numpy as np
import pytest
from effect_forms import form
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from motorctl.model import Spans, known_effects
from motorctl.model.columns import input_columns, state_columns

pytestmark = pytest.mark.slow

GANTRY = Spans(
    position_m=(-0.2, 0.2), speed_m_s=1.05, acceleration_m_s2=36.0, command_v=9.9,
    time_s=(0.0, 24.0), period_s=2e-4, band_hz=200.0, resolution_m=5e-7, other_axes=("y",),
)  # fmt: skip
ROTARY = Spans(
    position_m=(-20.0, 43.0), speed_m_s=30.0, acceleration_m_s2=400.0, command_v=3.0,
    time_s=(100.0, 160.0), period_s=1e-3, band_hz=100.0, resolution_m=2e-5, rotary=True,
)  # fmt: skip
MOST_FORMS = 8000
SOUGHT = sorted(set(known_effects()) - {"residual_map"})  # the map is offered, not sought

# Nothing that could come out of a recording is left out, a standing axis neither.
sizes = st.one_of(st.just(0.0), st.floats(1e-9, 1e6))
any_spans = st.builds(
    lambda low, travel, begin, duration, **others: Spans(
        position_m=(low, low + travel), time_s=(begin, begin + duration), **others
    ),
    low=st.floats(-1e3, 1e3),
    travel=sizes,
    begin=st.floats(-1e3, 1e6),
    duration=sizes,
    speed_m_s=sizes,
    acceleration_m_s2=sizes,
    command_v=sizes,
    period_s=st.floats(1e-6, 10.0),
    band_hz=st.floats(1e-3, 1e6),
    resolution_m=sizes,
    other_axes=st.sampled_from([(), ("y",), ("y", "z")]),
)


@pytest.mark.parametrize("name", SOUGHT)
@settings(max_examples=60)
@given(spans=any_spans, line_hz=st.floats(1e-6, 1e3))
def test_any_recording_gives_forms_steps_and_richer_forms(name, spans, line_hz):
    cls = known_effects()[name]
    forms, ringing = cls.trials(spans), cls.ringing_at(line_hz, spans)
    assert len(forms) <= MOST_FORMS
    assert len(ringing) <= MOST_FORMS
    for effect in (*forms[:2], *forms[-2:], *ringing):
        assert type(effect) is cls
        assert all(map(math.isfinite, effect.constants))
        for option, step in effect.steps(spans).items():
            assert 0.0 < step < math.inf
            assert isinstance(getattr(effect.options, option), float)
        for richer in effect.richer(spans):
            assert type(richer) is cls
            assert len(richer.parameters) > len(effect.parameters)
            assert all(map(math.isfinite, richer.constants))


@pytest.mark.parametrize("name", SOUGHT)
def test_the_forms_of_a_machine_differ(name):
    for spans in (GANTRY, ROTARY):
        forms = [effect.options.model_dump_json() for effect in known_effects()[name].trials(spans)]
        assert len(set(forms)) == len(forms)
        elsewhere = not spans.other_axes if name == "cross_axis" else not spans.rotary
        assert forms or (name in ("cross_axis", "gravity") and elsewhere)


@pytest.mark.parametrize("name", SOUGHT)
def test_a_form_can_be_refined_by_its_steps(name):
    spans = ROTARY if name == "gravity" else GANTRY
    forms = known_effects()[name].trials(spans)
    effect = forms[len(forms) // 2]
    for option, step in effect.steps(spans).items():
        value = getattr(effect.options, option)
        low, _ = effect.ranges(spans).get(option, (-math.inf, math.inf))
        for part in (0.5, -0.5, 0.01):
            if value == low and part < 0.0:  # as friction that is not there
                continue
            moved = effect.with_options(**{option: value + part * step})
            assert getattr(moved.options, option) == value + part * step


def drive(spans: Spans, n: int = 3000) -> dict[str, np.ndarray]:
    """Return a motion that fills the spans: slow and fast, here and there."""
    t = np.linspace(*spans.time_s, n)
    s = t - t[0]
    wander = [np.sin(k * s * 2.0 * math.pi / s[-1] + k * k) / k for k in (1, 3, 5, 14, 23)]
    x = np.sum(wander, axis=0)
    x = spans.position_m[0] + spans.travel_m * (x - x.min()) / np.ptp(x)
    v = np.gradient(x, t)
    v *= spans.speed_m_s / abs(v).max()
    a = np.gradient(v, t)
    a *= spans.acceleration_m_s2 / abs(a).max()
    u = spans.command_v * a / abs(a).max()
    return {"x": x, "v": v, "a": a, "vs": v, "t": t, "u": u}


def seen_by(effect, s) -> np.ndarray:
    if effect.kind == "input":
        return input_columns(effect, s["u"], s["x"], s["vs"], s["t"])
    return state_columns(effect, s["x"], s["v"], s["a"], s["vs"], s["t"])


def best_match(truth, spans: Spans) -> float:
    """Return how much of a truth's first column the best trial explains, 0 to 1."""
    s = drive(spans)
    wanted = seen_by(truth, s)[0]
    best = 0.0
    for effect in type(truth).trials(spans):
        basis = np.linalg.qr(seen_by(effect, s).T)[0]
        best = max(best, float(np.sum((basis.T @ wanted) ** 2) / (wanted @ wanted)))
    return best


@pytest.mark.slow
@pytest.mark.parametrize("spans", [GANTRY, ROTARY], ids=["gantry", "rotary"])
@pytest.mark.parametrize("share", [0.9, 0.31, 0.0773, 0.03])
@pytest.mark.parametrize("name", ["cogging", "force_ripple"])
def test_some_trial_is_near_any_pitch(name, share, spans):
    truth = form(name, pitch_m=share * spans.travel_m)
    assert best_match(truth, spans) > 0.6


@pytest.mark.parametrize("share", [1e-3, 7.7e-3, 0.03, 0.21])
@pytest.mark.parametrize("exponent", [0.7, 1.0, 2.0])
@pytest.mark.parametrize("spans", [GANTRY, ROTARY], ids=["gantry", "rotary"])
def test_some_trial_is_near_any_stribeck_speed(share, exponent, spans):
    truth = form("stribeck", velocity_m_s=share * spans.speed_m_s, exponent=exponent)
    assert best_match(truth, spans) > 0.95


@pytest.mark.parametrize("share", [1e-3, 5.3e-3, 0.02, 0.09])
@pytest.mark.parametrize("spans", [GANTRY, ROTARY], ids=["gantry", "rotary"])
def test_some_trial_is_near_any_dead_zone(share, spans):
    truth = form("dead_zone", half_width_v=share * spans.command_v)
    assert best_match(truth, spans) > 0.99


@pytest.mark.parametrize("spans", [GANTRY, ROTARY], ids=["gantry", "rotary"])
@pytest.mark.parametrize("share", [0.15, 0.4, 2.0])
def test_some_trial_is_near_any_thermal_time_constant(share, spans):
    truth = form("gain_drift", time_constant_s=share * spans.duration_s, begin_s=spans.time_s[0])
    assert best_match(truth, spans) > 0.99


@pytest.mark.parametrize("spans", [GANTRY, ROTARY], ids=["gantry", "rotary"])
@pytest.mark.parametrize("share", [0.1, 0.37, 0.93])
def test_some_trial_is_near_any_time_of_a_payload_change(share, spans):
    truth = form("payload_change", time_s=spans.time_s[0] + share * spans.duration_s)
    assert best_match(truth, spans) > 0.8


@pytest.mark.parametrize("frequency_hz", [1.234, 17.77, 49.99])
def test_some_trial_is_near_any_frequency_of_a_disturbance(frequency_hz):
    band = Spans(**{**vars(GANTRY), "time_s": (0.0, 12.0), "band_hz": 60.0})
    assert best_match(form("periodic_disturbance", frequency_hz=frequency_hz), band) > 0.7


@pytest.mark.parametrize("frequency_hz", [13.0, 51.7, 97.0, 160.0])
@pytest.mark.parametrize("damping_ratio", [0.007, 0.02, 0.08])
def test_some_trial_is_near_any_resonance(frequency_hz, damping_ratio):
    # an acceleration that excites all of the band, as it does what diagnosis looks for
    t = np.arange(4000) * 1e-3
    a = np.random.default_rng(1).normal(size=4000)
    zero = np.zeros(4000)
    truth = form("flexible_mode", frequency_hz=frequency_hz, damping_ratio=damping_ratio)
    spans = Spans(**{**vars(GANTRY), "time_s": (0.0, 4.0), "period_s": 1e-3})
    wanted = state_columns(truth, zero, zero, a, zero, t)[0] + a
    matches = []
    for effect in type(truth).trials(spans):
        tried = state_columns(effect, zero, zero, a, zero, t)[0] + a
        matches.append((wanted @ tried) ** 2 / (tried @ tried) / (wanted @ wanted))
    assert max(matches) > 0.6


@pytest.mark.parametrize("displacement_m", [2e-6, 5e-6, 17e-6, 50e-6, 200e-6])
def test_some_trial_is_near_any_presliding_displacement(displacement_m):
    x = 1e-3 * np.sin(np.linspace(0.0, 60.0, 20_000))
    zero, t = np.zeros_like(x), np.arange(20_000) * 2e-4
    moving = np.gradient(x, t)

    def h(effect):
        return state_columns(effect, x, moving, zero, moving * 1e6, t)[0]

    wanted = h(form("presliding", displacement_m=displacement_m))
    tried = [h(effect) for effect in known_effects()["presliding"].trials(GANTRY)]
    assert max((wanted @ c) ** 2 / (c @ c) / (wanted @ wanted) for c in tried) > 0.95


def test_encoders_of_common_scales_are_tried():
    periods = [e.options.period_m for e in known_effects()["encoder_error"].trials(GANTRY)]
    for period in (2e-6, 4e-6, 10e-6, 20e-6, 40e-6, 100e-6):
        assert min(abs(p - period) for p in periods) < 1e-12
    assert min(periods) > 3.9 * GANTRY.resolution_m


def test_lags_that_the_sampling_cannot_show_are_not_tried():
    slow = Spans(**{**vars(GANTRY), "period_s": 0.01})
    times = [e.options.time_s for e in known_effects()["input_lag"].trials(slow)]
    assert min(times) == pytest.approx(0.05 * 0.01)
    assert max(times) == pytest.approx(20 * 0.01)


def test_the_delays_of_slow_links_follow_on_those_that_are_tried_first():
    delay = known_effects()["input_delay"]
    fast = Spans(**{**vars(GANTRY), "period_s": 2e-4})
    first, beyond = (
        [e.options.time_s for e in tried(fast)] for tried in (delay.trials, delay.trials_beyond)
    )
    assert max(first) < min(beyond) < 1.5 * max(first)
    assert max(beyond) == pytest.approx(min(0.25, fast.duration_s / 10.0))
    assert beyond == sorted(beyond)
    brief = Spans(**{**vars(GANTRY), "time_s": (0.0, 0.04)})
    assert not delay.trials_beyond(brief)


def test_no_other_axis_means_no_coupling_to_try():
    assert list(known_effects()["cross_axis"].trials(ROTARY)) == []
    (coupled,) = known_effects()["cross_axis"].trials(GANTRY)
    assert coupled.other_axes == ("y",)
    three = Spans(**{**vars(GANTRY), "other_axes": ("y", "z")})
    assert [e.other_axes for e in coupled.richer(three)] == [("y", "z")]


def test_a_richer_wave_keeps_the_waves_it_had():
    found = form("cogging", pitch_m=0.0125)
    for richer in found.richer(GANTRY):
        have = {order / richer.options.pitch_m for order in richer.options.orders}
        assert any(h == pytest.approx(1.0 / 0.0125) for h in have)
        assert len(have) == 2
    # the true pitch, where its fourth order was the strongest
    assert any(
        e.options.pitch_m == pytest.approx(0.05) and e.options.orders == (1, 4)
        for e in found.richer(GANTRY)
    )


def test_shapes_over_the_travel_grow_from_a_line_to_thirty_splines():
    line, *_ = known_effects()["position_force"].trials(GANTRY)
    assert [len(e.parameters) for e in line.richer(GANTRY)] == [2, 7, 15, 29]
    finest = line.richer(GANTRY)[-1]
    assert list(finest.richer(GANTRY)) == []
    slope, bow = known_effects()["position_dependent_friction"].trials(GANTRY)
    assert [len(e.parameters) for e in slope.richer(GANTRY)] == [2, 7, 15, 29]
    assert [len(e.parameters) for e in bow.richer(GANTRY)] == [7, 15, 29]


def test_refining_beyond_what_an_option_allows_is_told():
    with pytest.raises(ValidationError):
        form("flexible_mode", frequency_hz=50.0).with_options(damping_ratio=-0.1)
