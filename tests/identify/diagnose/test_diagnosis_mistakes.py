"""Mistakes that users' recordings come with are told, and sound recordings are left in peace."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1, C2
from other_plant import SHAPES, OtherPlant
from sums_of_sines import sum_of_sines

from motorctl.errors import DataError
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.columns.usual_mistakes import check_columns
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.verdict.late_command import late_command
from motorctl.identify.diagnose.verdict.recording_mistakes import check_explains
from motorctl.identify.fit.recording import fit_axis
from motorctl.model import EffectList, known_effects, make_effect


@pytest.fixture(
    scope="module",
    params=[
        SHAPES[0],
        pytest.param(SHAPES[1], marks=pytest.mark.slow),
        *(pytest.param(s, marks=[pytest.mark.slow, pytest.mark.long]) for s in SHAPES[2:]),
    ],
)
def run(request):
    """A sound recording by another author's plant, whatever the shape of its friction."""
    return OtherPlant(shape=request.param, width_m_s=2e-3).run(seed=3, duration_s=12.0)


def heard(data):
    """Return the declared model over the band in which motion outweighs the noise."""
    return check_explains(data, make_signals(data, slope_s_m=900.0), C1)


def test_a_sound_recording_has_no_mistake(run):
    check_columns(run)
    assert late_command(heard(run)) is None


@pytest.mark.parametrize("share", [0.3, 0.55, 0.8])
def test_an_encoder_that_freezes_in_motion_is_told_with_its_time(run, share):
    speed = np.abs(np.diff(run.position))
    first = int(share * len(speed))
    moving = speed > 0.3 * speed.max()
    at = first + int(np.argmax(moving[first:]))
    position = run.position.copy()
    position[at:] = position[at]
    with pytest.raises(DataError, match=r"the position freezes at") as refusal:
        check_columns(replace(run, position=position))
    told = float(str(refusal.value).partition("freezes at ")[2].partition(" s")[0])
    assert told == pytest.approx(run.time_s[at], abs=2e-3)


def test_a_jump_is_no_motion_that_freezes(run):
    """So begin recordings whose first rows still have the position of a run before."""
    position = run.position.copy()
    rest = np.full(len(position) // 8, position[0])
    before = np.full(20, position[0] + 10.0 * np.ptp(position))
    damaged = np.concatenate([before, rest, position])
    still = np.concatenate([np.zeros(len(before) + len(rest)), run.command])
    time_s = run.period_s * np.arange(len(damaged))
    data = replace(
        run, time_s=time_s, position=damaged, command=still, reference=None,
        reference_velocity=None, saturated=None, usable=np.ones(len(damaged), dtype=bool),
    )  # fmt: skip
    check_columns(data)


@pytest.mark.slow
def test_what_lies_outside_the_segments_is_not_looked_at(run):
    freezes = run.position.copy()
    at = int(0.8 * len(freezes))
    at += int(np.argmax(np.abs(np.diff(freezes[at:]))))
    freezes[at:] = freezes[at]
    damaged, at_s = replace(run, position=freezes), run.time_s[at]
    with pytest.raises(DataError, match=r"segments: \{fit: \[") as refusal:
        diagnose_axis(damaged, C1)
    end_s = float(str(refusal.value).rpartition(", ")[2].partition("]")[0])
    assert end_s == pytest.approx(at_s, abs=2e-2)
    assert end_s < at_s
    parts = {"fit": (run.time_s[0], end_s)}
    assert diagnose_axis(damaged, C1, segments=parts).verdict == "complete"


@pytest.mark.parametrize(("still_s", "told"), [(0.3, False), (1.5, True)])
def test_an_encoder_that_freezes_in_slow_motion_is_told_once_it_is_no_rest(run, still_s, told):
    omega = 2.0 * np.pi * 2.0
    position = 0.1 * np.sin(omega * run.time_s)
    # 3 ms of this speed is three times what such a swing changes in 3 ms
    at_s = (2.0 * np.pi * 4.0 + np.arccos(3.0 * omega * 3e-3)) / omega
    first, last = np.searchsorted(run.time_s, (at_s, at_s + still_s))
    position[first:last] = position[first]
    data = replace(run, position=position, reference=None)
    if told:
        with pytest.raises(DataError, match=r"the position freezes at"):
            check_columns(data)
    else:
        check_columns(data)


@pytest.mark.slow
def test_friction_and_offset_of_one_way_motion_are_told_as_their_sum():
    random = np.random.default_rng(1)
    time_s = np.arange(10_000) / 1000.0
    tones = [(f, random.uniform(0.0, 6.3)) for f in (0.7, 1.3, 2.9, 4.1)]
    x = 0.8 * time_s + sum(0.01 / f * np.sin(2 * np.pi * f * time_s + p) for f, p in tones)
    v = np.gradient(x, 1e-3)
    assert v.min() > 0.1
    u = 0.2 * np.gradient(v, 1e-3) + 0.3 * v + 0.15 + 0.4 + 0.01 * random.standard_normal(10_000)
    turned = Measured(
        source="one way", axis="x", sample_rate_hz=1000.0, time_s=time_s, usable=time_s >= 0.0,
        position=0.5e-6 * np.round(x / 0.5e-6), command=u, resolution=0.5e-6,
    )  # fmt: skip
    told = diagnose_axis(turned, C1)
    assert "one way" in told.dropped["offset"]
    fitted = dict(zip(told.declared.names, told.declared_theta, strict=True))
    assert fitted["coulomb_friction"] == pytest.approx(0.55, abs=0.05)
    assert fitted["viscous_friction"] == pytest.approx(0.3, abs=0.05)


def test_a_reference_of_the_other_sign_is_told(run):
    with pytest.raises(DataError, match=r"runs against the position .* scale: -1"):
        check_columns(replace(run, reference=-run.reference))


@pytest.mark.parametrize(
    ("factor", "told"),
    [
        (1e3, "millimetres for metres"),
        (180.0 / np.pi, "degrees for radians"),
        (1e-3, "millimetres for metres"),
        (2.0, "the pitch of one of the two is wrong"),
    ],
)
def test_a_position_in_another_unit_than_its_reference_is_told(run, factor, told):
    scaled = replace(run, position=factor * run.position)
    with pytest.raises(DataError, match=told) as refusal:
        check_columns(scaled)
    said = float(str(refusal.value).partition("position is ")[2].partition(" times")[0])
    assert said == pytest.approx(factor, rel=0.02)


@pytest.mark.parametrize("bandwidth_hz", [0.5, 2.0, 8.0])
def test_an_axis_that_follows_softly_has_no_wrong_unit(bandwidth_hz):
    check_columns(OtherPlant(bandwidth_hz=bandwidth_hz).run(seed=3, duration_s=12.0))


def test_exchanged_position_and_command_are_told(run):
    exchanged = replace(
        run, position=run.command, command=run.position, reference=None, reference_velocity=None,
        saturated=None, resolution=None,
    )  # fmt: skip
    with pytest.raises(DataError, match=r"command seem to be exchanged: .* (9\d|100) % of"):
        heard(exchanged)


@pytest.mark.parametrize("late_ms", [3.0, 6.0, 10.0])
def test_a_late_command_is_told_with_its_time(run, late_ms):
    samples = round(late_ms * 1e-3 * run.sample_rate_hz)
    command = np.concatenate([np.full(samples, run.command[0]), run.command[:-samples]])
    hint = late_command(heard(replace(run, command=command)))
    assert hint is not None
    told_ms = float(hint.told().partition("command ")[2].partition(" ms")[0])
    assert told_ms == pytest.approx(late_ms, abs=0.6)


@pytest.mark.parametrize("moves_s", [0.08, 0.1, 0.12])
def test_of_two_short_moves_a_late_command_is_asked_of_the_rows_that_there_are(moves_s):
    rng = np.random.default_rng(2)
    time_s = np.arange(3000) / 1000.0
    rising = np.clip((time_s - 1.0) / moves_s, 0.0, 1.0)
    falling = np.clip((time_s - 2.0) / moves_s, 0.0, 1.0)
    x = 0.05 * (rising - np.sin(2 * np.pi * rising) / (2 * np.pi))
    x = x - 0.05 * (falling - np.sin(2 * np.pi * falling) / (2 * np.pi))
    v = np.gradient(x, time_s)
    command = np.gradient(v, time_s) + 5.0 * v + 2.0 * np.tanh(v / 1e-3)
    data = Measured(
        source="a.csv", axis="x", sample_rate_hz=1000.0, time_s=time_s,
        position=x + 1e-7 * rng.standard_normal(3000),
        command=command + 0.01 * rng.standard_normal(3000), usable=np.ones(3000, dtype=np.bool_),
    )  # fmt: skip
    assert late_command(heard(data)) is None


@pytest.mark.parametrize(("wave_hz", "delay_ms"), [(60.0, 4.0), (55.0, 5.0)])
def test_a_wave_that_comes_late_answers_to_no_earlier_period_of_the_command(wave_hz, delay_ms):
    """Half a period less what a command of one frequency is late by looks early."""
    rate_hz = 1000.0
    time_s = np.arange(8000) / rate_hz
    rng = np.random.default_rng(1)
    swell = 1.0 + 0.3 * np.sin(2.5 * time_s) + 0.12 * np.sin(10.7 * time_s)

    def force(at_s):
        return np.interp(at_s, time_s, swell) * np.sin(2.0 * np.pi * wave_hz * at_s)

    acceleration = force(time_s - 1e-3 * delay_ms)
    velocity = np.cumsum(acceleration) / rate_hz
    position = np.cumsum(velocity - velocity.mean()) / rate_hz
    data = Measured(
        source="a.csv", axis="x", sample_rate_hz=rate_hz, time_s=time_s,
        position=position + 1e-8 * rng.standard_normal(len(time_s)),
        command=force(time_s), usable=np.ones(len(time_s), dtype=bool),
    )  # fmt: skip
    assert late_command(heard(data)) is None


def test_a_joint_under_gravity_is_no_reversed_sign_for_fit_either():
    joint = OtherPlant(inertia=0.05, gravity=6.0, travel=2.5, peak_velocity=1.5, resolution=1e-5)
    data = replace(joint.run(seed=1, duration_s=12.0), position_unit="rad", command_unit="A")
    with pytest.raises(DataError, match=r"a force of the place, such as a weight") as refusal:
        fit_axis(data, C1)
    assert "sign" not in str(refusal.value)


ARM = OtherPlant(
    inertia=0.05, gravity=6.0, travel=2.5, peak_velocity=1.5, bandwidth_hz=6.0, resolution=1e-5
)


def test_exchanged_commands_of_two_axes_are_told_with_the_other_axis():
    own = OtherPlant(width_m_s=2e-3).run(seed=5, duration_s=8.0)
    beside = OtherPlant(width_m_s=2e-3).run(seed=6, duration_s=8.0)
    exchanged = replace(own, command=beside.command)
    others = {"y": replace(beside, axis="y", command=own.command)}
    with pytest.raises(DataError, match=r"that of axis y does: .* exchange the two columns"):
        check_explains(exchanged, make_signals(exchanged), C1, others=others)


def test_an_axis_that_others_may_load_is_not_refused_beside_them():
    own = OtherPlant(width_m_s=2e-3).run(seed=5, duration_s=8.0)
    beside = OtherPlant(width_m_s=2e-3).run(seed=6, duration_s=8.0)
    loaded = replace(own, command=np.roll(own.command, 7000))
    with pytest.raises(DataError, match=r"record them beside it"):
        check_explains(loaded, make_signals(loaded), C1)
    check_explains(loaded, make_signals(loaded), C1, others={"y": replace(beside, axis="y")})


IN_DEGREES = "degrees are declared as radians"


@pytest.mark.slow
def test_a_weight_that_a_motor_holds_while_a_hand_moves_it_is_gravity():
    moved = ARM.run(seed=4, duration_s=12.0)
    noise = 0.01 * np.random.default_rng(1).standard_normal(len(moved.position))
    held = replace(
        moved, command=3.3 * np.sin(moved.position) + noise, reference=None,
        position_unit="rad", command_unit="N*m",
    )  # fmt: skip
    found = diagnose_axis(held, C1)
    assert [effect.name for effect in found.effects] == ["gravity"]
    assert found.effects[0].theta == pytest.approx([3.3, 0.0], abs=0.01)
    assert not [note for note in found.notes if IN_DEGREES in note]
    # no inertia: neither model can be simulated
    assert found.error.simulated_position_before_rms is None


@pytest.mark.slow
def test_degrees_that_are_declared_as_radians_are_told_beside_the_arms_weight():
    moved, scale = ARM.run(seed=4, duration_s=12.0), 180.0 / np.pi
    recorded = replace(
        moved, position=scale * moved.position, resolution=scale * 1e-5, reference=None,
        position_unit="rad", command_unit="N*m",
    )  # fmt: skip
    found = diagnose_axis(recorded, C1)
    assert [effect.name for effect in found.effects] == ["gravity"]
    assert len([note for note in found.notes if IN_DEGREES in note]) == 1


@pytest.mark.slow
def test_a_torque_that_does_not_change_tells_nothing_and_says_so():
    moved = ARM.run(seed=4, duration_s=12.0)
    noise = 0.001 * np.random.default_rng(1).standard_normal(len(moved.position))
    held = replace(
        moved, command=1.0 + noise, reference=None, position_unit="rad", command_unit="N*m"
    )
    found = diagnose_axis(held, C1)
    assert (found.verdict, found.effects) == ("insufficient_data", ())
    assert "the command stays at 1 N*m but for 0.1 %" in found.sentence


def refusal(data):
    """Return why a recording is refused; nothing where it is not."""
    try:
        heard(data)
    except DataError as error:
        return str(error)
    return ""


def test_a_torque_that_is_held_is_never_called_reversed():
    moved = ARM.run(seed=4, duration_s=12.0)
    noise = 0.02 * np.random.default_rng(1).standard_normal(len(moved.position))
    pushed = -0.02 * np.gradient(np.gradient(moved.position, 2e-4), 2e-4)
    smooth = np.convolve(pushed, np.ones(500) / 500, "same")
    held = replace(moved, command=1.0 + noise + smooth, reference=None, position_unit="rad")
    assert "reversed" not in refusal(held)


def driven(x, command, rate_hz, resolution=1e-5):
    """Return an axis of a joint [rad] with its torque."""
    return Measured(
        source="a joint", axis="x", sample_rate_hz=rate_hz, time_s=np.arange(len(x)) / rate_hz,
        usable=np.ones(len(x), bool), position=resolution * np.round(x / resolution),
        command=command, resolution=resolution, position_unit="rad", command_unit="N*m",
    )  # fmt: skip


def one_slow_move(rate_hz=1000.0):
    """Return a move one way at a steady speed, and its acceleration."""
    time_s = np.arange(round(3.0 * rate_hz)) / rate_hz
    v = 0.37 * np.clip(np.minimum(time_s / 0.2, (3.0 - time_s) / 0.2), 0.0, 1.0)
    return np.cumsum(v) / rate_hz - 0.52, np.gradient(v, 1.0 / rate_hz)


@pytest.mark.parametrize("weight_n_m", [-3.5, -0.4, 0.4])
@pytest.mark.parametrize("friction_n_m", [0.1, 0.25])
def test_a_weight_on_one_move_one_way_is_no_reversed_sign(weight_n_m, friction_n_m):
    x, a = one_slow_move()
    noise = 0.15 * np.random.default_rng(0).standard_normal(len(x))
    command = 0.015 * a + friction_n_m + weight_n_m * np.sin(x) + noise
    assert "reversed" not in refusal(driven(x, command, 1000.0))


def hoisted(way_back_n_m, rate_hz=20.0, drum_kg_m2=0.002):
    """Return an axis that lowers a load slowly and comes back quickly, resting in between."""
    rest, down, up = (np.zeros(round(s * rate_hz)) for s in (1.0, 4.0, 1.0))
    once = np.concatenate([rest, down + 5.0, rest, up - 20.0])
    v = np.tile(once, 8)
    v = np.convolve(np.pad(v, 3, mode="edge"), np.ones(7) / 7, "valid")
    load = np.where(v < -0.5, -way_back_n_m, -17.0)
    noise = 0.3 * np.random.default_rng(0).standard_normal(len(v))
    command = drum_kg_m2 * np.gradient(v, 1.0 / rate_hz) + 1.0 * np.tanh(v) + load + noise
    return driven(np.cumsum(v) / rate_hz, command, rate_hz)


@pytest.mark.parametrize("way_back_n_m", [11.0, 4.0, 0.5])
def test_a_hoist_that_comes_back_without_its_load_is_no_reversed_sign(way_back_n_m):
    assert "reversed" not in refusal(hoisted(way_back_n_m))


def wound_up(late_s, rate_hz=200.0):
    """Return a held shaft that a torque winds stair by stair over the middle of what holds it.

    It passes each place once and rests there; its torque is written later than it acts.
    """
    time_s = np.arange(round(60.0 * rate_hz)) / rate_hz
    stairs = np.floor(time_s / 1.5) + np.clip((time_s % 1.5) / 0.12, 0.0, 1.0)
    x = 0.5 * (stairs / stairs.max()) - 0.25
    late = np.interp(time_s - late_s, time_s, x)
    noise = 0.02 * np.random.default_rng(0).standard_normal(len(x))
    return driven(x, 0.8 - 25.0 * late**2 + noise, rate_hz, 4e-4)


@pytest.mark.parametrize("late_s", [0.1, 0.15])
def test_a_held_shaft_that_is_wound_up_is_no_reversed_sign(late_s):
    assert "reversed" not in refusal(wound_up(late_s))


def test_an_axis_that_carries_a_load_and_moves_briskly_shows_a_reversed_sign(run):
    load = 4.0 * float(np.std(run.command))
    assert "reversed" in refusal(replace(run, command=load - run.command))


def test_a_command_that_is_the_position_is_told(run):
    noise = (
        0.01
        * float(np.ptp(run.position))
        * np.random.default_rng(3).standard_normal(len(run.position))
    )
    for factor in (1.0, 180.0 / np.pi, 1e3):
        sent = replace(run, command=factor * (run.position + noise))
        with pytest.raises(DataError, match=r"the command is the position .* as its reference"):
            check_columns(sent)


def test_a_stage_that_a_stiff_spring_holds_is_told_of_and_can_be_declared(run):
    """A piezo of 1 V/um that is driven slowly: the voltage is the position in micrometres."""
    held = replace(run, command=1e6 * run.position, reference=None)
    with pytest.raises(DataError, match=r"a stiff spring holds.* declare a force of the position"):
        check_columns(held, C1)
    check_columns(held, EffectList([*C1.effects, make_effect(known_effects()["position_force"])]))


def test_a_weight_in_proportion_to_the_place_is_not_taken_for_the_position(run):
    check_columns(replace(run, command=3.3 * run.position))
    check_columns(replace(run, command=run.position + 0.1 * float(np.ptp(run.position))))


def test_a_command_without_its_sign_is_told():
    geared = OtherPlant(inertia=0.01, viscous=0.6, coulomb=0.5).run(seed=3, duration_s=8.0)
    heard(geared)
    with pytest.raises(DataError, match=r"it is a magnitude"):
        heard(replace(geared, command=np.abs(geared.command)))


def test_a_positive_column_that_drives_nothing_is_no_magnitude():
    """Given the velocity's sign, it would be all dry friction."""
    geared = OtherPlant(inertia=0.01, viscous=0.6, coulomb=0.5).run(seed=3, duration_s=8.0)
    slow = np.random.default_rng(2).normal(0.0, 0.02, len(geared.command) // 100 + 1)
    torque = np.repeat(0.1 + np.abs(slow), 100)[: len(geared.command)]
    with pytest.raises(DataError, match=r"explains none of the acceleration"):
        heard(replace(geared, command=torque))


@pytest.mark.slow
@pytest.mark.parametrize("ripple_hz", [25.0, 150.0])
def test_ripple_of_a_steady_speed_is_no_change_of_speed(ripple_hz):
    x, a = one_slow_move()
    ripple = 2e-4 * np.sin(2.0 * np.pi * ripple_hz * np.arange(len(x)) / 1000.0)
    noise = 0.05 * np.random.default_rng(0).standard_normal(len(x))
    moved = driven(x + ripple, 0.1 * a + 0.5 + noise, 1000.0)
    told = diagnose_axis(moved, C1)
    assert (told.verdict, told.effects) == ("insufficient_data", ())
    assert "only twice" in told.sentence


def test_an_axis_that_rests_nearly_all_of_the_time_is_not_called_noise():
    """A torque grows until friction gives way: one short move in the end, behind coarse counts."""
    count = 6.3e-4
    time_s = np.arange(3000) / 1000.0
    position = count * np.rint(30.0 * np.exp((time_s - 3.0) / 0.25) / count)
    ramp = Measured(
        source="a.csv", axis="x", sample_rate_hz=1000.0, time_s=time_s, position=position,
        command=time_s / 60.0, usable=np.ones(3000, dtype=np.bool_), position_unit="rad",
    )  # fmt: skip
    with pytest.raises(DataError, match=r"too little motion: it moves over 29\.\d rad, but rests"):
        diagnose_axis(ramp, C1)


def test_trials_that_begin_in_motion_are_not_told_to_rest():
    """Each trial is one move from its first sample on, then a rest; between them are gaps."""
    time_s = np.arange(100) / 25.0
    one = 0.5 * (1.0 - np.exp(-time_s / 0.15))
    count = 2e-4
    position = np.concatenate([count * np.rint(way * one / count) for way in [1.0, -1.0] * 15])
    clock = np.concatenate([7.0 * k + time_s for k in range(30)])
    trials = Measured(
        source="a.csv", axis="x", sample_rate_hz=25.0, time_s=clock, position=position,
        command=position - 0.5, usable=np.ones(3000, dtype=np.bool_), position_unit="rad",
    )  # fmt: skip
    with pytest.raises(DataError, match=r"lie within 1\.6 s of where a stretch without a gap"):
        diagnose_axis(trials, C1)


@pytest.mark.slow
def test_a_speed_that_a_drive_was_sent_to_is_not_taken_for_what_drives_it():
    """The drive follows within a millisecond, and is recorded every 20 ms."""
    time_s = np.arange(3000) / 50.0
    position, speed = sum_of_sines(5, time_s, np.arange(0.1, 4.0, 0.1), 0.02)
    servo = Measured(
        source="a.csv", axis="x", sample_rate_hz=50.0, time_s=time_s,
        position=3e-6 * np.rint(position / 3e-6), command=1.6 * speed,
        usable=np.ones(3000, dtype=np.bool_),
    )  # fmt: skip
    told = "the command is its speed, and no inertia can be seen"
    light = servo.command + 0.01 * np.gradient(speed, time_s)
    voltage = replace(servo, command=light + 0.02 * np.sign(speed))
    for command in (servo.command, light):
        axis = replace(servo, command=command)
        assert any(told in note for note in diagnose_axis(axis, C1).notes)
    assert not any(told in note for note in diagnose_axis(voltage, C1).notes)


@pytest.mark.parametrize("declared", ["C1", "C2"])
def test_a_late_command_is_told_beside_declared_effects_of_the_command(run, declared):
    """They would explain the command as it was recorded, whenever it acted."""
    late = round(12e-3 * run.sample_rate_hz)
    command = np.concatenate([np.full(late, run.command[0]), run.command[:-late]]) + 20.0
    data = replace(run, command=command)
    model = {"C1": C1, "C2": C2}[declared]
    told = late_command(check_explains(data, make_signals(data, slope_s_m=900.0), model))
    assert told is not None
    assert told.late_s == pytest.approx(12e-3, abs=6e-4)
