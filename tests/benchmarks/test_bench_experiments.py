"""`motorctl bench experiments`: plants that are drawn, and figures of what came of them."""

import pytest

from motorctl.errors import UsageError
from motorctl_benchmarks.experiments.findings import ExperimentsOptions, found_of
from motorctl_benchmarks.experiments.plants import EARLIEST_S, FAMILIES, LATEST_S, draw_plant
from motorctl_benchmarks.experiments.run_plant import Compared, Outcome

RICH = Outcome(24.0, settled=True, exact=True, no_wrong_name=True)


def plant(motion_s, **changes):
    chosen = Outcome(motion_s, settled=True, exact=True, no_wrong_name=True, **changes)
    return Compared("case", FAMILIES[0], {"input_lag": {}}, 0.5, RICH, RICH, chosen, ("one",))


def figure(findings, name):
    return next(each for each in findings.figures if each.name == name)


def test_a_seed_decides_the_plant_and_its_family_the_effects():
    for family in FAMILIES:
        first, again = (draw_plant(990_050, family) for _ in range(2))
        assert first.config == again.config
        assert first.effects
    assert draw_plant(990_050, FAMILIES[0]).effects[0] in ("input_lag", "input_delay")
    load = draw_plant(990_050, "payload or inertia")
    assert EARLIEST_S <= load.truth["payload_change"]["time_s"] <= LATEST_S
    plants = load.config["drivers"]["gantry"]["plants"].values()
    (put_in,) = [each["payload_change"] for each in plants if "payload_change" in each]
    assert put_in["time_s"] == load.truth["payload_change"]["time_s"]


def test_the_time_is_judged_by_the_median_and_lags_by_their_error():
    found = found_of([plant(6.0, time_error=0.02), plant(6.0, time_error=-0.3), plant(20.0)])
    assert figure(found, "time").value == pytest.approx(0.25)
    assert figure(found, "time").met
    assert figure(found, "within").value == pytest.approx(100.0 / 3.0)
    assert not figure(found, "within").met


def test_what_is_said_to_be_inseparable_is_no_lag_that_was_told_apart():
    found = found_of([plant(6.0, time_error=0.02), plant(6.0, inseparable=("alike",))])
    assert figure(found, "within").value == 100.0
    assert "1 of 2 lags and delays told apart, 1 said to be inseparable" in found.notes[0]


def test_a_lag_that_is_still_open_is_not_told_apart():
    open_one = Outcome(24.0, settled=False, exact=True, time_error=0.0)
    row = Compared("case", FAMILIES[0], {"input_lag": {}}, 0.5, RICH, RICH, open_one)
    found = found_of([plant(6.0, time_error=0.02), row])
    assert found.notes[0].startswith("1 of 2 lags and delays told apart, 0 said")
    assert found.notes[0].endswith("1 still open")


def test_a_kind_of_plants_that_is_none_is_refused_with_those_that_are():
    with pytest.raises(UsageError, match="--only gears: plants are of these kinds"):
        ExperimentsOptions(families=("gears",))
