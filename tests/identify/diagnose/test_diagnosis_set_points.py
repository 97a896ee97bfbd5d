"""A column that an axis was sent to is told, and so is a command whose gain was changed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant
from scipy import signal

from motorctl.errors import DataError
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search.search import nothing_sought, with_final
from motorctl.identify.diagnose.verdict.gain_step import without_gain_step
from motorctl.identify.diagnose.verdict.set_point import check_no_set_point
from motorctl.model import EffectList, effect_class, make_effect

RATE_HZ = 1000.0
CHANGED_S = 5.0


def slower(data: Measured) -> Measured:
    """Return a recording as a logger of 1 kHz writes it, without a reference."""
    k = round(data.sample_rate_hz / RATE_HZ)
    return replace(
        data, sample_rate_hz=RATE_HZ, time_s=data.time_s[::k], position=data.position[::k],
        command=data.command[::k], usable=data.usable[::k], reference=None,
    )  # fmt: skip


@pytest.fixture(scope="module")
def run() -> Measured:
    """A sound recording by another author's plant."""
    return slower(OtherPlant(width_m_s=2e-3).run(seed=3, duration_s=10.0))


def sent_to(run: Measured, derivative: int, loop_hz: float) -> Measured:
    """Return a recording with what a loop of second order was sent to as its command.

    Seen from the motion, that is the motion and what the loop takes to follow.
    """
    smooth = signal.butter(4, 30.0, fs=RATE_HZ, output="sos")
    motion = [signal.sosfiltfilt(smooth, run.position)]
    for _ in range(3):
        motion.append(np.gradient(motion[-1], run.period_s))
    omega = 2.0 * np.pi * loop_hz
    asked = motion[derivative] + 1.4 / omega * motion[derivative + 1]
    if derivative + 2 < len(motion):
        asked = asked + motion[derivative + 2] / omega**2
    return replace(run, command=asked)


@pytest.mark.parametrize("loop_hz", [2.0, 4.0])
@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_a_place_that_the_axis_was_sent_to_is_no_spring(run, loop_hz, unit):
    sent = sent_to(run, 0, loop_hz)
    with pytest.raises(DataError, match=r"it is the position that the axis was sent to") as told:
        diagnose_axis(replace(sent, command=unit * sent.command), C1)
    said = float(str(told.value).partition("command is ")[2].partition(" times")[0])
    assert said == pytest.approx(unit, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "is_told"), [(1.14 * 180.0 / np.pi, True), (100.0, False)])
def test_a_soft_loops_set_point_in_degrees_is_told_as_what_it_may_be(run, factor, is_told):
    sent = sent_to(run, 0, 4.0)
    velocity = np.gradient(run.position, run.period_s)
    dry = 0.04 * np.std(run.position) * np.tanh(velocity / 1e-3)
    soft = replace(sent, command=factor * (sent.command + dry - 0.03), position_unit="rad")
    axis = diagnose_axis(soft, C1)
    assert {effect.name for effect in axis.effects} <= {"position_force"}
    assert any("may say where the axis was sent to" in note for note in axis.notes) == is_told


@pytest.mark.parametrize("loop_hz", [3.0, 8.0, 50.0])
@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_of_an_axis_that_a_speed_was_sent_to_nothing_is_named(run, loop_hz, unit):
    sent = sent_to(run, 1, loop_hz)
    axis = diagnose_axis(replace(sent, command=unit * sent.command), C1)
    assert (axis.verdict, axis.effects) == ("insufficient_data", ())
    said = float(axis.sentence.partition("command is ")[2].partition(" times the velocity")[0])
    assert said == pytest.approx(unit, rel=0.02)


def test_a_declared_spring_may_follow_its_command(run):
    signals = make_signals(sent_to(run, 0, 4.0))
    with pytest.raises(DataError, match="declare a force of the position in its model"):
        check_no_set_point(signals, C1)
    spring = make_effect(effect_class("position_force"))
    assert check_no_set_point(signals, EffectList([*C1.effects, spring])) is None


def held_softly(run: Measured, factor: float, friction: float, weight: float) -> Measured:
    """Return a recording with what a loop without an integral was sent to as its command.

    It stands off by friction and weight, here over the spread of the position.
    """
    sent = sent_to(run, 0, 4.0)
    velocity = np.gradient(sent.command, run.period_s)
    stands_off = friction * np.tanh(velocity / 1e-2) + weight
    return replace(sent, command=factor * sent.command + stands_off * np.std(run.position))


@pytest.mark.parametrize(("factor", "friction", "weight"), [(1.04, 0.08, 0.33), (0.95, 0.12, -1.5)])
def test_a_place_that_a_soft_loop_was_sent_to_is_neither_weight_nor_spring(
    run, factor, friction, weight
):
    with pytest.raises(DataError, match="it is the position that the axis was sent to") as told:
        diagnose_axis(held_softly(run, factor, friction, weight), C1)
    assert "without any dry friction" not in str(told.value)


def test_much_friction_beside_a_place_is_a_machine_with_a_spring(run):
    assert check_no_set_point(make_signals(held_softly(run, 1.0, 0.6, 0.0)), C1) is None


def waves(run: Measured, place: float, damping: float, inertia: float, *turns: float) -> Measured:
    """Return a recording of sines, rad/s, with a command that motion makes without any friction."""
    t, sines = run.time_s, np.array(turns)[:, None]
    x, v = np.sin(sines * t).sum(axis=0), (sines * np.cos(sines * t)).sum(axis=0)
    a = -(sines**2 * np.sin(sines * t)).sum(axis=0)
    noise = np.random.default_rng(3).normal(0.0, 3e-4, len(t))
    return replace(run, position=x + noise, command=place * x + damping * v + inertia * a)


def test_a_place_that_one_slow_sine_was_sent_to_is_told_though_its_factor_is_a_little_off(run):
    sent = waves(run, 1.0, 0.33, 0.037, 1.0)
    with pytest.raises(DataError, match=r"it is the position that the axis was sent to"):
        diagnose_axis(sent, C1)


def test_a_spring_of_nearly_one_under_several_sines_is_no_set_point(run):
    held = waves(run, 0.95, 0.33, 0.02, 1.0, 4.0)
    assert check_no_set_point(make_signals(held), C1) is None


@pytest.mark.parametrize("viscous", [1.0, 0.3])
def test_a_machine_with_friction_of_just_one_is_no_set_point(viscous):
    plant = OtherPlant(inertia=0.02, viscous=viscous, coulomb=0.05, width_m_s=2e-3)
    assert check_no_set_point(make_signals(slower(plant.run(seed=4, duration_s=8.0))), C1) is None


def found_with_a_load(run: Measured, command: np.ndarray):
    """Return the declared model with a change of the load at a time."""
    found = nothing_sought(make_signals(replace(run, command=command), slope_s_m=500.0), C1)
    load = make_effect(effect_class("payload_change"), {"time_s": CHANGED_S})
    return with_final(found, found.base.plus(load).refreshed())


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.8, 1.25])
def test_a_command_whose_gain_was_changed_is_no_load(run, factor):
    later = run.time_s >= CHANGED_S
    found = found_with_a_load(run, np.where(later, run.command / factor, run.command))
    left, (why,) = without_gain_step(found)
    assert left.final.added == ()
    told_s = float(why.partition("for from ")[2].partition(" s")[0])
    told = float(why.partition("command gives ")[2].partition(" times")[0])
    assert told_s == pytest.approx(CHANGED_S, abs=0.2)
    assert told == pytest.approx(factor, rel=0.01)


@pytest.mark.parametrize("part", [0.3, -0.2])
def test_a_load_that_was_changed_is_no_gain(run, part):
    smooth = signal.butter(4, 60.0, fs=RATE_HZ, output="sos")
    velocity = np.gradient(signal.sosfiltfilt(smooth, run.position), run.period_s)
    inertia = OtherPlant.inertia * np.gradient(velocity, run.period_s)
    later = run.time_s >= CHANGED_S
    found = found_with_a_load(run, run.command + np.where(later, part * inertia, 0.0))
    left, why = without_gain_step(found)
    assert why == ()
    assert left is found


@pytest.mark.slow
def test_where_only_inertia_needs_force_a_load_keeps_its_name():
    plain = replace(OtherPlant(coulomb=0.0, viscous=0.01), width_m_s=2e-3)
    free = slower(plain.run(seed=3, duration_s=10.0))
    smooth = signal.butter(4, 60.0, fs=RATE_HZ, output="sos")
    velocity = np.gradient(signal.sosfiltfilt(smooth, free.position), free.period_s)
    inertia = OtherPlant.inertia * np.gradient(velocity, free.period_s)
    later = free.time_s >= CHANGED_S
    found = found_with_a_load(free, free.command + np.where(later, 0.3 * inertia, 0.0))
    left, why = without_gain_step(found)
    assert why == ()
    assert left is found
