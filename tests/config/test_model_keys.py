"""Other models for a machine that runs: what counts as another one, and in which order it comes."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorctl.config import Machine, load, load_resolved, shipped_config
from motorctl.config.machine import MOST_PARAMETERS
from motorctl.config.model_keys import axes_with_other_models, learns_the_same, with_models_of
from motorctl.errors import ConfigError

GANTRY = load(shipped_config("published_gantry"))
EFFECTS = list(GANTRY.resolved["axes"]["x"]["model"])  # type: ignore[index]


def reordered(order: list[str], **gains: float) -> dict[str, Any]:
    """Return the gantry's configuration with x's effects in another order."""
    config: dict[str, Any] = copy.deepcopy(dict(GANTRY.resolved))
    x = config["axes"]["x"]
    x["model"] = {name: x["model"][name] for name in order}
    x["gains"] |= gains
    return config


def loaded(config: dict[str, Any]) -> Machine:
    return load_resolved(config, str(GANTRY.source))


@given(order=st.permutations(EFFECTS))
def test_a_configuration_whose_effects_stand_in_another_order_keeps_that_of_what_runs(
    order: list[str],
) -> None:
    merged: Any = with_models_of(GANTRY, reordered(order, ks_v_s_m=40.0))
    assert list(merged["axes"]["x"]["model"]) == EFFECTS
    assert merged["axes"]["x"]["gains"]["ks_v_s_m"] == 40.0


def test_effects_that_are_new_come_after_those_that_run() -> None:
    other = reordered(EFFECTS[::-1])
    cogging = {"pitch_m": 0.06, "orders": [1]}
    other["axes"]["x"]["model"] = {"cogging": cogging, **other["axes"]["x"]["model"]}
    merged: Any = with_models_of(GANTRY, other)
    assert list(merged["axes"]["x"]["model"]) == [*EFFECTS, "cogging"]


@pytest.mark.parametrize(("functions", "parameters"), [((30, 30), 64), ((30, 31), 65)])
def test_a_model_with_more_parameters_than_there_is_room_for_is_refused(
    functions: tuple[int, int], parameters: int
) -> None:
    config = reordered(EFFECTS)
    names = ("position_force", "position_dependent_friction")
    for name, count in zip(names, functions, strict=True):
        config["axes"]["x"]["model"][name] = {"knots": [-0.05, 0.45, count]}
    if parameters <= MOST_PARAMETERS:
        assert len(loaded(config).axes["x"].estimates) == parameters
        return
    with pytest.raises(ConfigError, match="65 parameters; at most 64 are possible: leave out"):
        loaded(config)


def test_an_estimate_in_another_order_is_not_taken_for_the_same() -> None:
    other = loaded(reordered(EFFECTS[::-1]))
    assert other.axes["x"].theta_initial[0] != pytest.approx(GANTRY.axes["x"].theta_initial[0])
    assert axes_with_other_models(GANTRY, other) == ["x"]
    assert not learns_the_same(GANTRY, other, "x")
    assert learns_the_same(GANTRY, loaded(reordered(EFFECTS, ks_v_s_m=40.0)), "x")
