"""Columns that are late against each other are no lag of the machine where they say why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.identify.columns.held_samples import without_held
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search.option_ranges import at_bound
from motorctl.model import effect_class, make_effect

RATE_HZ = 1000.0


@pytest.fixture(scope="module")
def run() -> Measured:
    """A sound recording by another author's plant, as a logger of 1 kHz writes it."""
    data = OtherPlant(width_m_s=2e-3).run(seed=3, duration_s=8.0)
    k = round(data.sample_rate_hz / RATE_HZ)
    return replace(
        data, sample_rate_hz=RATE_HZ, time_s=data.time_s[::k], position=data.position[::k],
        command=data.command[::k], usable=data.usable[::k], reference=None,
    )  # fmt: skip


@pytest.mark.parametrize("every", [2, 7, 20])
@pytest.mark.parametrize("first", [0, 1])
def test_a_sensor_slower_than_the_log_is_read_at_its_own_rate(run, every, first):
    position = run.position.copy()
    new = np.maximum((np.arange(len(position)) - first) // every * every + first, 0)
    taken, note = without_held(replace(run, position=position[new]))
    assert note is not None
    assert f"every {every}th row" in note
    assert taken.sample_rate_hz == pytest.approx(RATE_HZ / every)
    index = np.searchsorted(run.time_s, taken.time_s - 1e-9)
    assert np.array_equal(taken.position, run.position[index])
    assert taken.command[5] == pytest.approx(run.command[index[5] : index[5] + every].mean())


@pytest.mark.parametrize(
    "apart", [(4,) * 40 + (5,), (4,) * 90 + (3,), (4,) * 90 + (1, 3), (8, 9, 10, 10, 10, 11, 12)]
)
def test_the_rows_of_a_new_position_may_slip(run, apart):
    """Sensor and log have clocks of their own, or the logger does not wait for the sensor."""
    new = np.cumsum(np.resize(apart, 1000))
    new = np.concatenate([[0], new[new < len(run.position)]])
    held = np.repeat(run.position[new], np.diff(np.append(new, len(run.position))))
    taken, note = without_held(replace(run, position=held))
    assert note is not None
    assert taken.sample_rate_hz == pytest.approx(RATE_HZ / np.median(apart), rel=0.01)
    index = np.searchsorted(run.time_s, taken.time_s - 1e-9)
    changed = np.flatnonzero(np.diff(held)) + 1
    assert np.mean(np.isin(changed[:-1], index)) > 0.98
    assert len(list(taken.stretches(100))) == 1
    assert np.array_equal(taken.position, held[index])
    assert taken.command[5] == pytest.approx(run.command[index[5] : index[6]].mean())


def test_a_slow_sensor_is_seen_beside_a_hole_that_is_filled_in(run):
    position, usable = np.repeat(run.position[::4], 4), run.usable.copy()
    usable[2000:7000] = False
    position[2000:7000] = np.linspace(position[1999], position[7000], 5000)
    taken, note = without_held(replace(run, position=position, usable=usable))
    assert note is not None
    assert taken.sample_rate_hz == pytest.approx(RATE_HZ / 4)
    assert np.mean(taken.usable) == pytest.approx(np.mean(usable), abs=0.002)


@pytest.mark.parametrize("counts", [3000, 300, 100])
def test_the_counts_of_a_coarse_encoder_are_no_slow_sensor(run, counts):
    count = np.ptp(run.position) / counts
    coarse = replace(run, position=count * np.rint(run.position / count), resolution=count)
    assert without_held(coarse) == (coarse, None)


@pytest.mark.slow
def test_a_position_that_the_log_repeats_is_no_lag_of_the_machine(run):
    held = replace(run, position=np.repeat(run.position[::10], 10))
    named = {effect.name for effect in diagnose_axis(held, C1).effects}
    assert named == set()


@pytest.mark.parametrize("name", ["input_delay", "input_lag"])
def test_a_lateness_at_the_end_of_what_is_tried_is_another_one(run, name):
    spans = spans_of(make_signals(run))
    cls = effect_class(name)
    tried = [*cls.trials(spans), *cls.trials_beyond(spans)]
    longest = max(effect.options.time_s for effect in tried)
    assert not at_bound(make_effect(effect_class(name), {"time_s": longest}), spans)
    assert at_bound(make_effect(effect_class(name), {"time_s": 1.5 * longest}), spans)


@pytest.mark.slow
def test_a_delay_longer_than_is_tried_gets_no_wrong_name(run):
    late = replace(run, command=np.concatenate([run.command[40:], np.full(40, run.command[-1])]))
    named = {e.name for e in diagnose_axis(late, C1).effects if e.confidence >= 0.5}
    assert named <= {"input_delay"}


@pytest.mark.slow
def test_a_long_delay_that_looks_like_a_slow_spring_is_told_as_what_it_is(run):
    late = replace(run, command=np.concatenate([run.command[80:], np.full(80, run.command[-1])]))
    (found,) = diagnose_axis(late, C1).effects
    assert found.name == "input_delay"
    assert found.effect.options.time_s == pytest.approx(0.08, rel=0.02)
