"""Every effect's columns are its formula, in the tick as in the analysis."""

import numpy as np
import pytest
from effect_forms import EVERY, INPUT, STATE, each, form
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from motorctl.model import EffectList
from motorctl.model.bspline import basis
from motorctl.model.columns import input_columns, state_columns

NO_MEMORY = np.zeros(0)
COLUMNED = [effect for effect in EVERY if effect.kind in ("state", "input")]
INPUTS = [effect for effect, _ in INPUT]
ODD = [effect for effect in INPUTS if effect.odd]


def motion(seed: int, n: int = 60) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    scales = {"x": 0.3, "v": 0.4, "a": 20.0, "vs": 0.02, "u": 3.0}
    signals = {name: rng.normal(size=n) * scale for name, scale in scales.items()}
    signals["vs"][:3], signals["u"][:3] = 0.0, 0.0
    signals["t"] = np.sort(rng.uniform(0.0, 2.0, n))
    return signals


def columns(effect, s, others=None):
    if effect.kind == "input":
        return input_columns(effect, s["u"], s["x"], s["vs"], s["t"])
    return state_columns(effect, s["x"], s["v"], s["a"], s["vs"], s["t"], others)


def psi(effects, s, others=None):
    return EffectList(effects).regressor(
        s["x"], s["v"], s["a"], s["vs"], s["t"], s["u"], others
    )  # fmt: skip


@pytest.mark.parametrize("effect", each([effect for effect, _ in STATE]))
def test_a_state_effect_has_the_columns_of_its_formula(effect):
    s = motion(1)
    expected = np.array(dict(STATE)[effect](s["x"], s["v"], s["a"], s["vs"], s["t"]))
    assert columns(effect, s).shape == (len(effect.parameters), len(s["x"]))
    assert np.allclose(columns(effect, s), expected, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("effect", each(INPUTS))
def test_an_input_effect_has_the_columns_of_its_formula(effect):
    s = motion(2)
    expected = -np.array(dict(INPUT)[effect](s["u"], s["x"], s["vs"], s["t"]))
    assert np.allclose(columns(effect, s), expected, rtol=1e-12, atol=1e-13)


@pytest.fixture(scope="module")
def together():
    """Return a motion, and each effect's columns in the loop: a list has all effects once."""
    s, run = motion(3), {}
    others = np.random.default_rng(4).normal(size=(len(s["x"]), 2, 3))
    while left := [effect for effect in COLUMNED if effect not in run]:
        effects = list({effect.name: effect for effect in reversed(left)}.values())
        ends = np.cumsum([len(effect.parameters) for effect in effects])
        seen = others if any(effect.other_axes for effect in effects) else None
        run |= zip(effects, np.split(psi(effects, s, seen), ends[:-1], axis=1), strict=True)
    return s, others, run


@pytest.mark.slow
@pytest.mark.parametrize("effect", each(COLUMNED))
def test_the_analysis_tries_the_columns_that_the_loop_runs_whatever_is_beside(together, effect):
    s, others, run = together
    tried = columns(effect, s, others if effect.other_axes else None)
    # the same kernels; only constants folded by the compiler may round differently
    assert np.allclose(tried.T, run[effect], rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("effect", each(INPUTS))
@settings(max_examples=50)
@given(
    u=st.floats(-10.0, 10.0),
    x=st.floats(-0.5, 0.5),
    vs=st.floats(-0.5, 0.5),
    t=st.floats(0.0, 3.0),
    seed=st.integers(0, 1000),
)
def test_the_slope_of_an_input_effect_is_the_derivative_of_its_map(effect, u, x, vs, t, seed):
    kernels = EffectList([effect]).kernels
    theta = np.random.default_rng(seed).uniform(-1.0, 1.0, len(effect.parameters))
    h, place = 1e-7, (x, vs, t, NO_MEMORY, theta)
    low, here, high = (kernels.input_map(u + d, *place) for d in (-h, 0.0, h))
    assume(abs((high - here) - (here - low)) < 1e-5 * h)  # no corner of the map
    assert kernels.input_slope(u, *place) == pytest.approx((high - low) / (2 * h), abs=1e-5)


@pytest.mark.parametrize("effect", each(ODD))
@given(u=st.floats(-10.0, 10.0))
def test_an_input_effect_that_says_it_is_odd_is_odd(effect, u):
    kernels = EffectList([effect]).kernels
    theta = np.full(len(effect.parameters), 0.1)
    there, back = (kernels.input_map(value, 0.11, 0.2, 0.7, NO_MEMORY, theta) for value in (u, -u))
    assert back == -there


@pytest.mark.parametrize("effect", each(INPUTS))
def test_an_input_effect_that_does_not_vary_is_the_same_everywhere(effect):
    kernels = EffectList([effect]).kernels
    theta = np.full(len(effect.parameters), 0.1)
    places = [(0.0, 0.0, 0.0), (0.013, 0.1, 0.9), (-0.2, -0.3, 40.0)]
    values = {kernels.input_map(1.7, *place, NO_MEMORY, theta) for place in places}
    assert (len(values) > 1) == effect.varies


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "force_ripple",
        "dead_zone",
        "gain_drift",
        "drive_hysteresis",
        "load_friction",
        "voltage_clipping",
    ],
)
@pytest.mark.parametrize("orders", [(1,), (1, 2, 3, 4, 6)])
def test_the_widest_bounds_leave_the_input_map_an_inverse(name, orders):
    options = {
        "force_ripple": {"pitch_m": 0.03, "orders": orders},
        "dead_zone": {"half_width_v": 0.15},
        "gain_drift": {"time_constant_s": 2.0},
        "drive_hysteresis": {"play_v": 0.2, "plays": min(len(orders), 3)},
        "load_friction": {"slope_s_m": 300.0},
        "voltage_clipping": {"limit_v": 0.1, "no_load_m_s": 2.0},
    }
    effect = form(name, **options[name])
    kernels = EffectList([effect]).kernels
    rng = np.random.default_rng(7)
    for _ in range(300):
        theta = np.array([rng.choice([p.lower, p.upper]) for p in effect.parameters])
        u, x, t = rng.uniform(-0.3, 0.3), rng.uniform(-1.0, 1.0), rng.uniform(0.0, 100.0)
        assert (
            kernels.input_slope(
                u, x, rng.uniform(-1.0, 1.0), t, np.zeros(effect.memory_size), theta
            )
            > 0.04
        )


def test_friction_is_nothing_at_rest_however_steep_it_is():
    steep = {"slope_s_m": float("inf")}
    effects = [
        form("stribeck", velocity_m_s=0.01, **steep),
        form("asymmetric_friction", **steep),
        form("position_dependent_friction", **steep),
    ]
    zero = np.zeros(3)
    psi = EffectList(effects).regressor(zero + 0.1, zero, zero, zero, zero, zero)
    assert (psi == 0.0).all()
    slow = EffectList(effects).regressor(zero + 0.1, zero, zero, zero - 1e-9, zero, zero)
    assert np.allclose(slow[0], [-1.0, 1.0, 0.0, -0.1])


@given(x=st.floats(-2.0, 2.0), count=st.integers(4, 48))
def test_all_splines_together_are_one_wherever_the_carriage_is(x, count):
    low, high = -0.3, 0.4
    cells_per_m = (count - 3) / (high - low)
    values = [basis(j, x, low, cells_per_m, float(count)) for j in range(count)]
    assert sum(values) == pytest.approx(1.0, abs=1e-12)
    assert min(values) >= 0.0


def test_splines_are_told_from_a_constant():
    x = np.linspace(-0.2, 0.2, 500)
    zero = np.zeros_like(x)
    spline = state_columns(form("position_force", knots=(-0.2, 0.2, 30)), x, zero, zero, zero, zero)
    psi = np.vstack([spline, np.ones_like(x)]).T
    assert np.linalg.matrix_rank(psi) == 30


def test_four_splines_are_any_cubic_polynomial():
    x = np.linspace(-0.2, 0.2, 200)
    zero = np.zeros_like(x)
    spline = state_columns(form("position_force", knots=(-0.2, 0.2, 4)), x, zero, zero, zero, zero)
    psi = np.vstack([spline, np.ones_like(x)]).T
    wanted = 3.0 + x - 20.0 * x**2 + 70.0 * x**3
    theta = np.linalg.lstsq(psi, wanted, rcond=None)[0]
    assert np.allclose(psi @ theta, wanted, atol=1e-12)


def test_columns_of_signals_that_do_not_fit_together_are_refused():
    s = motion(8)
    short = s | {"a": s["a"][:-1]}
    with pytest.raises(ValueError, match="differ in shape"):
        columns(form("inertia"), short)
    with pytest.raises(ValueError, match="differ in shape"):
        columns(form("em_cubic"), s | {"x": s["x"][:-1]})
    with pytest.raises(ValueError, match="other axes' motion has shape"):
        columns(form("cross_axis", axes=("y",)), s, np.zeros((len(s["x"]), 2, 3)))


def test_other_axes_whose_motion_is_not_given_are_at_rest():
    assert (columns(form("cross_axis", axes=("y", "z")), motion(9)) == 0.0).all()
