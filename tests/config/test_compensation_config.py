"""Effects of every kind in the configuration: what it takes, refuses, checks and tells."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from config_bench import line_of, machine, problems, write
from law_bench import fill_law

from motorctl.config import load, load_resolved, summarise
from motorctl.config.analysis import loop_margins, required_command
from motorctl.control import law_settings, max_input_delay_s
from motorctl.errors import UsageError
from motorctl.loop.tick import axes_beside
from motorctl.model import EffectList, effect_class, make_effect

GAINS = {"k1_1_s": 250.0, "ks_v_s_m": 95.0, "gamma_d": 500.0, "period_s": 2e-4}
NO_MEMORY = np.zeros(0)
NARROW = {"bounds": [-0.05, 0.05]}


def with_effects(**effects: Any) -> dict[str, Any]:
    """Return the bench machine with two axes, and more effects on x."""
    data = machine()
    data["axes"]["y"] = copy.deepcopy(data["axes"]["x"]) | {"channel": 1, "program": None}
    data["axes"]["x"]["model"] |= effects
    return data


EVERY = {
    "cogging": {"pitch_m": 0.05, "orders": [1, 3], "parameters": {"sin_1": {"initial": 0.1}}},
    "force_ripple": {"pitch_m": 0.03, "parameters": {"sin_1": NARROW, "cos_1": NARROW}},
    "presliding": {"displacement_m": 1e-5},
    "position_force": {"knots": [-0.1, 0.3, 6]},
    "dead_zone": {"half_width_v": 0.1, "parameters": {"depth": {"initial": 0.05}}},
    "cross_axis": {"axes": ["y"]},
    "payload_change": {"time_s": 3.0, "initial": 0.02},
    "input_lag": {"time_s": 0.0004},
    "input_delay": {"time_s": 0.0003},
    "encoder_error": {"period_m": 2e-5, "sin_m": 1e-7},
}


@pytest.fixture
def every(tmp_path: Path) -> Path:
    return write(tmp_path, with_effects(**EVERY))


@pytest.mark.slow
def test_effects_of_every_kind_make_a_machine_and_make_it_again(every: Path) -> None:
    axis = load(every).axes["x"]
    assert axis.model.names[-len(EVERY) :] == tuple(EVERY)
    assert (axis.model.lag_s, axis.model.delay_s) == (0.0004, 0.0003)
    initial = dict(zip(axis.model.parameter_names, axis.estimates, strict=True))
    assert initial["cogging_sin_1"].initial == 0.1
    assert initial["payload_change"].initial == 0.02
    assert (initial["force_ripple_cos_1"].lower, initial["force_ripple_cos_1"].upper) == (
        -0.05,
        0.05,
    )
    again = load_resolved(load(every).resolved, hardware=True)
    assert again.resolved == load(every).resolved
    assert again.axes["x"].model.module_name == axis.model.module_name


@pytest.mark.slow
def test_c1_runs_on_all_effects_but_the_electromagnetic_ones(every: Path) -> None:
    axis = load(every, "C1").axes["x"]
    assert set(axis.declared.names) - set(axis.model.names) == {"em_quadratic", "em_cubic"}
    assert (axis.model.lag_s, axis.model.delay_s) == (0.0004, 0.0003)
    assert axis.model.other_axes == ("y",)


@pytest.mark.slow
def test_the_summary_tells_every_effect_with_its_options(every: Path) -> None:
    told = summarise(load(every))["axes"]["x"]
    assert told["effects"][-3:] == ["input_lag", "input_delay", "encoder_error"]
    assert told["effect_options"]["input_lag"] == {"time_s": 0.0004}
    assert told["effect_options"]["cross_axis"] == {"axes": ["y"]}
    assert [row["lag_s"] for row in told["margins"]] == [0.0004] * 6
    assert told["margins"][0]["delay_s"] == 0.0003


# What is declared, the key of the problem, what the message says.
MISTAKES = [
    ({"cross_axis": {"axes": ["z"]}}, "cross_axis.axes[0]", ["unknown axis 'z'", "y"]),
    ({"cross_axis": {"axes": ["y", "x"]}}, "cross_axis.axes[1]", ["the axis itself"]),
    ({"input_lag": {"time_s": 0.1}}, "input_lag", ["input_lag 0.1 s", "at most 0.03 s"]),
    (
        {"input_lag": {"time_s": 0.01}, "input_delay": {"time_s": 0.022}},
        "input_delay",
        ["input_lag 0.01 s + input_delay 0.022 s", "together", "2000 Hz"],
    ),
    ({"input_lag": {"time_s": 1e-4, "initial": 1.0}}, "input_lag.initial", ["only options"]),
    (
        {"encoder_error": {"period_m": 2e-5, "parameters": {"sin": {}}}},
        "encoder_error.parameters.sin",
        ["unknown parameter"],
    ),
    ({"cogging": {"pitch_m": 0.05, "initial": 1.0}}, "cogging.initial", ["sin_1, cos_1"]),
    (
        {"force_ripple": {"pitch_m": 0.03, "parameters": {"sin_1": {"bounds": [-0.5, 0.5]}}}},
        "force_ripple",
        ["Assumption 2", "force_ripple", "narrower bounds"],
    ),
    (
        {
            "force_ripple": {
                "pitch_m": 0.03,
                "parameters": {"sin_1": {"initial": 0.45}, "cos_1": {"initial": 0.45}},
            }
        },
        "em_quadratic",
        ["Assumption 2 fails at theta(0)"],
    ),
]


@pytest.mark.parametrize(("effects", "key", "words"), MISTAKES, ids=[k for _, k, _ in MISTAKES])
def test_a_mistake_in_an_effect_is_told_at_its_key(
    tmp_path: Path, effects: dict[str, Any], key: str, words: list[str]
) -> None:
    data = with_effects()
    if "force_ripple" not in effects:
        data["axes"]["x"]["model"] = {"inertia": {"initial": 0.2}}
    data["axes"]["x"]["model"] |= effects
    found = problems(tmp_path, data)
    told = [problem for problem in found if problem.key == f"axes.x.model.{key}"]
    assert told, found
    assert all(word in told[0].message for word in words), told[0].message
    name = key.split(".")[0]
    assert told[0].line is not None
    assert told[0].line >= line_of(tmp_path / "machine.yaml", name)


def test_a_lag_that_the_gains_cannot_bear_is_refused(tmp_path: Path) -> None:
    data = with_effects()
    data["axes"]["x"]["model"] = {"inertia": {"initial": 0.2}, "input_lag": {"time_s": 0.025}}
    (found,) = problems(tmp_path, data)
    assert found.key == "axes.x.gains"
    assert "0.025 s of lag" in found.message


@pytest.mark.slow
def test_axes_beside_are_found_by_name_in_the_machines_order(every: Path) -> None:
    assert axes_beside(load(every)).tolist() == [[1], [-1]]


@pytest.mark.parametrize("delay_s", [0.0, 3.3e-4])
@pytest.mark.parametrize("lag_s", [1e-4, 2e-3])
def test_with_a_lag_the_gain_margin_is_where_the_loop_becomes_unstable(
    lag_s: float, delay_s: float
) -> None:
    margins = loop_margins(0.19, 0.25, **GAINS, delay_s=delay_s, lag_s=lag_s)
    assert margins.stable
    assert margins.lag_s == lag_s
    for factor, stable in ((0.999, True), (1.001, False)):
        gain = factor * margins.gain_margin
        more = GAINS | {"ks_v_s_m": 95.0 * gain, "gamma_d": 500.0 * gain}
        assert loop_margins(0.19, 0.25, **more, delay_s=delay_s, lag_s=lag_s).stable is stable


def test_a_short_lag_costs_the_phase_that_it_has_at_the_crossover() -> None:
    without = loop_margins(0.19, 0.25, **GAINS)
    behind = loop_margins(0.19, 0.25, **GAINS, lag_s=1e-4)
    lost = np.degrees(np.arctan(1e-4 * behind.crossover_rad_s))
    assert without.phase_margin_deg - behind.phase_margin_deg == pytest.approx(lost, abs=0.3)


@pytest.mark.slow
def test_a_map_that_varies_asks_for_the_command_that_it_turns_into_the_motion() -> None:
    names = ("inertia", "em_quadratic", "em_cubic")
    ripple = make_effect(effect_class("force_ripple"), {"pitch_m": 0.03})
    model = EffectList([*(make_effect(effect_class(name)) for name in names), ripple])
    theta = np.array([0.19, -0.01, -0.001, 0.1, 0.05])
    x, a = np.linspace(0.0, 0.1, 200), np.linspace(-25.0, 25.0, 200)
    still = np.zeros(200)
    u = required_command(model, theta, 10.0)(x, still, a)
    given = [
        model.kernels.input_map(*pair, 0.0, 0.0, NO_MEMORY, theta)
        for pair in zip(u, x, strict=True)
    ]
    assert np.abs(u).max() < 10.0
    assert given == pytest.approx(0.19 * a, abs=1e-5)


def test_the_history_bounds_lag_and_delay_together() -> None:
    model = EffectList(
        [
            make_effect(effect_class(n), o)
            for n, o in (("inertia", {}), ("input_delay", {"time_s": 0.01}))
        ]
    )
    settings: dict[str, Any] = {
        **GAINS,
        "period_s": 1.0 / 2000.0,
        "d_hat_max_v": 1.0,
        "max_voltage_v": 10.0,
        "lower": [0.1],
        "upper": [1.0],
        "covariance": [1.0],
    }
    record = np.zeros(1, law_settings(1))[0]
    assert max_input_delay_s(1.0 / 2000.0) == pytest.approx(0.03)
    fill_law(record, model, {**settings, "input_delay_s": 0.02 - 1e-9})
    assert record["delay_ticks"] == 59
    with pytest.raises(UsageError, match="input delay"):
        fill_law(record, model, {**settings, "input_delay_s": 0.0201})
