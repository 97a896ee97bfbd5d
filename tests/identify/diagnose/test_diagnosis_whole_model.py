"""Physics of the whole model: friction takes energy at every speed, inertia is what it can be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant
from sums_of_sines import sum_of_sines

from motorctl.config import load
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.refutation import beside_driving_friction, without_refuted
from motorctl.identify.diagnose.search.search import Found, rival_gains, whitened
from motorctl.identify.diagnose.search.whole_model import (
    GIVES,
    friction_power,
    inertia_off,
    seen_inertia,
)
from motorctl.identify.same_axis import declared_inertias
from motorctl.log import read_recording
from motorctl.model import effect_class, make_effect

PLANT = OtherPlant(shape="arctan", width_m_s=1.0 / 900.0)
SIDES = ("acceleration", "command")


def outcome(data, *added, side="acceleration"):
    signals = make_signals(data, slope_s_m=900.0)
    regressors, noise = whitened(signals, C1, added, side)
    final = Hypothesis(regressors, added).refreshed()
    base = Hypothesis(regressors).refreshed()
    return Found(base, final, (), spans_of(signals), noise, rival_gains(final))


def pushed_one_way(force_s_m):
    """Return a recording in which the command spends so much more forward, for each m/s."""
    data = PLANT.run(seed=4, duration_s=8.0)
    speed = np.abs(np.gradient(data.position, data.period_s))
    smooth = np.convolve(speed, np.ones(51) / 51.0, "same")
    return replace(data, command=data.command + force_s_m * smooth)


@pytest.mark.parametrize("side", SIDES)
def test_friction_that_drives_the_axis_one_way_is_refuted(side):
    asymmetric = make_effect(effect_class("asymmetric_friction"))
    found = outcome(pushed_one_way(1.2), asymmetric, side=side)
    assert friction_power(found.base).given <= GIVES
    power = friction_power(found.final)
    assert power.given > GIVES
    assert power.speed < 0.0
    kept, why = without_refuted(found)
    assert not kept.final.added
    assert "the friction of the whole model drives the axis at -" in why[0]


@pytest.mark.parametrize("side", SIDES)
def test_beside_friction_that_drives_the_axis_anyway_nothing_is_named(side):
    data = PLANT.run(seed=4, duration_s=8.0)
    speed = np.gradient(data.position, data.period_s)
    driven = replace(data, command=data.command - 2.0 * speed)
    ripple = make_effect(effect_class("cogging"), {"pitch_m": 0.06, "orders": (1,)})
    found = outcome(driven, ripple, side=side)
    assert friction_power(found.base).given > GIVES
    assert without_refuted(found) == (found, ())
    kept, why = beside_driving_friction(found)
    assert not kept.final.added
    assert "cogging: not named, for with it and without it the friction of the whole" in why[0]


@pytest.mark.slow
def test_a_machine_whose_friction_seems_to_drive_it_gets_no_name():
    data = replace(PLANT, cogging=0.3, pitch_m=0.04).run(seed=4, duration_s=8.0)
    speed = np.gradient(data.position, data.period_s)
    found = diagnose_axis(replace(data, command=data.command - 2.0 * speed), C1)
    assert found.effects == ()
    assert any("drives the axis" in note for note in found.notes)


def test_two_frictions_that_drive_together_are_to_blame_and_not_what_stands_beside_them():
    pushed = pushed_one_way(1.2)
    speed = np.gradient(pushed.position, pushed.period_s)
    force = pushed.command + 0.05 * np.sin(2.0 * np.pi * pushed.position / 0.02)
    pushed = replace(pushed, command=force - 0.8 * speed * np.abs(speed))
    effects = [
        make_effect(effect_class("cogging"), {"pitch_m": 0.02, "orders": (1,)}),
        make_effect(effect_class("asymmetric_friction")),
        make_effect(effect_class("quadratic_drag")),
    ]
    found = outcome(pushed, *effects, side="command")
    assert friction_power(found.final).given > GIVES
    kept, why = without_refuted(found)
    assert "cogging" in [effect.name for effect in kept.final.added]
    assert "_" in why[0].split(" is refuted")[0]


@pytest.mark.parametrize("scale", [0.01, 20.0])
def test_what_friction_gives_is_the_same_for_light_and_heavy_axes_on_either_side(scale):
    asymmetric = make_effect(effect_class("asymmetric_friction"))
    pushed = pushed_one_way(1.2)
    given = [
        friction_power(
            outcome(replace(pushed, command=k * pushed.command), asymmetric, side=side).final
        ).given
        for k, side in ((1.0, "acceleration"), (scale, "acceleration"), (scale, "command"))
    ]
    assert given == pytest.approx([given[0]] * 3, rel=0.2)


def test_friction_that_differs_by_direction_and_takes_energy_both_ways_is_kept():
    asymmetric = make_effect(effect_class("asymmetric_friction"))
    found = outcome(pushed_one_way(0.15), asymmetric)
    assert friction_power(found.final).given == 0.0
    assert without_refuted(found) == (found, ())


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("missing", [{"gravity": 4.0, "travel": 2.0}, {"cogging": 0.3}, {}])
def test_inertia_is_seen_without_knowing_what_is_missing(side, missing):
    plant = replace(PLANT, **missing)
    seen = seen_inertia(outcome(plant.run(seed=4, duration_s=8.0), side=side).base)
    assert seen.low < 1.05 * plant.inertia
    assert seen.high > 0.95 * plant.inertia
    assert seen.high < 3.0 * seen.low


def swinging(inertia):
    """Return a sine with a little of another, of an axis that a force pushes from its middle.

    At the sine's frequency alone the force of the place acts as inertia, five times as much as
    there is.
    """
    rate, rng = 1000.0, np.random.default_rng(3)
    t = np.arange(0.0, 20.0, 1.0 / rate)
    w = 2.0 * np.pi * 1.0
    x = 0.1 * np.sin(w * t) + 1e-3 * np.sin(3.7 * w * t)
    v, a = np.gradient(x, t), np.gradient(np.gradient(x, t), t)
    command = 0.05 * a - 0.2 * w**2 * x + 0.3 * v + 0.2 * np.tanh(900.0 * v)
    return Measured(
        source="swinging.csv",
        axis="x",
        sample_rate_hz=rate,
        time_s=t,
        position=x + 1e-8 * rng.standard_normal(len(x)),
        command=command + 1e-4 * rng.standard_normal(len(x)),
        usable=np.ones(len(x), dtype=np.bool_),
        inertia=inertia,
    )


def test_an_effect_that_takes_the_place_of_a_declared_inertia_is_refuted():
    spring = make_effect(effect_class("position_force"))
    free = outcome(swinging(None), spring)
    assert without_refuted(free) == (free, ())
    found = outcome(swinging((0.2, 0.3)), spring)
    kept, why = without_refuted(found)
    assert not kept.final.added
    assert "with it the inertia would be 0.05" in why[0]
    assert "0.2 to 0.3 is declared: 3.79 times off" in why[0]


def test_a_configuration_declares_between_what_its_inertia_lies(tmp_path):
    machine = load("published_gantry")
    path, t = tmp_path / "run.csv", np.arange(2000) / 1000.0
    columns = np.column_stack([t, 0.1 * np.sin(t), np.cos(t)])
    header = "time_s,x.position_m,x.command_v"
    np.savetxt(path, columns, delimiter=",", header=header, comments="")
    recording = read_recording(path)
    place = machine.axes["x"].model.index_of("acceleration")
    bounds = machine.axes["x"].estimates[place]
    assert declared_inertias(recording, machine, ["x"]) == {"x": (bounds.lower, bounds.upper)}
    assert declared_inertias(recording, None, ["x"]) == {}


def test_a_part_on_a_spring_need_not_be_seen_as_inertia():
    plant = replace(PLANT, load=0.8, load_hz=12.0)
    mode = make_effect(effect_class("flexible_mode"), {"frequency_hz": 12.0, "damping_ratio": 0.05})
    found = outcome(plant.run(seed=4, duration_s=8.0), mode)
    assert inertia_off(found.final, seen_inertia(found.base)) < 2.0


@pytest.mark.slow
def test_a_negative_inertia_beside_friction_that_brakes_is_no_reversed_sign():
    time_s = np.arange(8000) / 200.0
    position, speed = sum_of_sines(8, time_s, np.arange(0.1, 3.0, 0.1), 0.05)
    braked = 1.4 * speed + 0.2 * np.tanh(speed / 0.01)
    command = -0.03 * np.gradient(speed, time_s) + braked
    rng = np.random.default_rng(9)
    command += 0.05 * np.convolve(rng.normal(size=8000), np.hanning(200) / 9.0, "same")
    data = Measured(
        source="a.csv", axis="x", sample_rate_hz=200.0, time_s=time_s,
        position=1e-6 * np.rint(position / 1e-6), command=command,
        usable=np.ones(8000, dtype=np.bool_),
    )  # fmt: skip
    notes = diagnose_axis(data, C1).notes
    assert any("friction brakes, so no sign is reversed" in note for note in notes), notes
    assert not any("may be reversed" in note for note in notes)
