"""Positions that begin anew: counted on where that is plainly a counter, else left, and told."""

import numpy as np
import pytest

from motorctl.errors import DataError
from motorctl.log import read_recording

RESOLUTION_RAD = 1.5e-5  # of a motor's encoder, at the output of its gear
GEARED = f"unit: count, resolution_rad: {RESOLUTION_RAD}"


def read(folder, position, unit, reference=None, more="", sent_more=""):
    """Read columns that stand in a text file."""
    columns = {"q": position, "u": np.cos(np.arange(len(position)))}
    if reference is not None:
        columns["r"] = reference
    cells = ["" if np.isnan(x) else f"{x:.12g}" for x in np.column_stack([*columns.values()]).flat]
    rows = [",".join(cells[k : k + len(columns)]) for k in range(0, len(cells), len(columns))]
    (folder / "a.csv").write_text("\n".join([",".join(columns), *rows]) + "\n")
    text = (
        "file: a.csv\nsample_rate_hz: 1000\naxes:\n  x:\n"
        f"    position: {{column: q, {unit}{more}}}\n    command: {{column: u, unit: A}}\n"
    )
    if reference is not None:
        text += f"    reference: {{column: r, {unit}{sent_more}}}\n"
    (folder / "d.yaml").write_text(text)
    recording = read_recording(folder / "d.yaml")
    return recording.axes["x"], recording.notes


def one_way(period, per_second, rows=3000):
    """Return whole counts of an axis whose speed has a ripple."""
    t = np.arange(rows) / 1000.0
    ripple = 0.3 * np.sin(2.0 * np.pi * 20.0 * t) / (2.0 * np.pi * 20.0)
    return np.floor(per_second * period * (t + ripple))


@pytest.mark.parametrize("bits", [12, 14, 16, 32])
@pytest.mark.parametrize("per_second", [1.0, 20.0])
@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_an_encoders_counts_go_on_to_the_count(tmp_path, bits, per_second, noise):
    whole = one_way(2**bits, per_second)
    whole += np.rint(noise * np.random.default_rng(0).normal(size=len(whole)))
    axis, notes = read(tmp_path, whole % 2**bits, GEARED)
    moved = np.diff(axis.position) / RESOLUTION_RAD
    np.testing.assert_allclose(moved, np.diff(whole), atol=0.5)
    assert f"begins anew after {2**bits} count" in notes[0]
    assert "axes.x.position.period: 0 leaves it as it is" in notes[0]


def test_a_counter_of_other_lines_goes_on_where_the_axis_turns_round(tmp_path):
    whole = np.floor(25_000 * np.sin(np.arange(3000) / 400.0))
    axis, _ = read(tmp_path, whole % 10_000, GEARED)
    np.testing.assert_allclose(np.diff(axis.position) / RESOLUTION_RAD, np.diff(whole), atol=0.5)


def test_a_sensor_that_reads_a_little_beyond_a_turn_begins_anew_after_a_turn(tmp_path):
    whole = 1.37 * np.arange(2000)
    axis, notes = read(tmp_path, whole % 360.0 * 361.0 / 360.0 - 0.5, "unit: deg")
    assert np.ptp(np.rad2deg(axis.position)) == pytest.approx(np.ptp(whole), abs=1.0)
    assert "after a turn" in notes[0]


@pytest.mark.parametrize("behind", [-8, 40, 2100])
def test_position_and_reference_keep_together_though_each_begins_anew_by_itself(tmp_path, behind):
    sent = one_way(4096, 20.0) + 10
    noise = np.rint(3.0 * np.random.default_rng(3).normal(size=len(sent)))
    axis, _ = read(tmp_path, (sent + behind + noise) % 4096, GEARED, sent % 4096)
    error = (axis.position - axis.reference) / RESOLUTION_RAD
    off = behind if abs(behind) < 2048 else behind - 4096
    np.testing.assert_allclose(error, off + noise, atol=0.5)


def test_a_reference_of_many_turns_stays_and_the_position_comes_to_it(tmp_path):
    sent = np.linspace(-3.0, 9.0, 2000) ** 2  # turns; its position tells one
    axis, _ = read(tmp_path, (sent - 0.01) % 1.0, "unit: turns", sent)
    np.testing.assert_allclose(axis.reference, 2.0 * np.pi * sent, rtol=1e-8)
    np.testing.assert_allclose(axis.reference - axis.position, 2.0 * np.pi * 0.01, atol=1e-6)


SCAN = 0.1 * (np.arange(2000) % 100)
FEED = np.tile(np.linspace(0.0, 200.0, 20), 30)


@pytest.mark.parametrize(
    ("motion", "unit"),
    [
        (SCAN, "unit: um"),
        (SCAN - 4.95, "unit: um"),
        (SCAN - 4.95, "unit: deg"),
        (33.0 * SCAN, "unit: deg"),
        (14.3 * (SCAN - 4.95), "unit: rad"),
        (FEED, "unit: mm"),
        (np.concatenate([np.zeros(50), FEED[19:]]), "unit: mm"),  # from rest to the other end
        (40 * (np.arange(2000) % 100), "unit: count, resolution: 1e-6"),
    ],
)
@pytest.mark.parametrize("sent", [False, True])
def test_a_motion_that_flies_back_within_a_sample_stays_one_and_is_told(
    tmp_path, motion, unit, sent
):
    axis, notes = read(tmp_path, motion, unit, motion if sent else None)
    scale = np.ptp(axis.position) / np.ptp(motion)
    np.testing.assert_allclose(axis.position, motion * scale, atol=1e-9 * scale)
    if sent:
        np.testing.assert_allclose(axis.reference, axis.position)
    assert "jumps from one end to the other" in notes[0]
    assert "axes.x.position.period should be what it begins anew after; 0" in notes[0]


def test_a_motion_that_flies_back_both_ways_stays_where_the_reference_jumps_with_it(tmp_path):
    motion = np.concatenate([FEED, FEED[::-1]])
    axis, notes = read(tmp_path, motion, "unit: mm", motion)
    np.testing.assert_allclose(axis.position, 1e-3 * motion)
    assert "the reference jumps with it" in notes[0]


def test_an_angle_that_begins_anew_after_less_than_a_turn_stays_and_is_told(tmp_path):
    """A motor's turn before its gear, or a sensor that is blind for most of one: who knows."""
    place = (3000.0 * np.sin(np.arange(2000) / 300.0)) % 200.0
    axis, notes = read(tmp_path, place, "unit: deg")
    np.testing.assert_allclose(np.rad2deg(axis.position), place, atol=1e-6)
    assert "that is less than a turn" in notes[0]


def test_a_motion_over_all_counts_stays_where_the_reference_jumps_with_it(tmp_path):
    motion = (64.0 * np.arange(2000)) % 4096
    axis, notes = read(tmp_path, motion, "unit: count, resolution: 1e-6", motion)
    np.testing.assert_allclose(axis.position, 1e-6 * motion)
    assert "the reference jumps with it" in notes[0]


def test_the_description_tells_what_a_column_begins_anew_after(tmp_path):
    motion = FEED % 200.0
    axis, notes = read(tmp_path, motion, "unit: mm", more=", period: 0")
    np.testing.assert_allclose(axis.position, 1e-3 * motion)
    assert notes == ()
    whole = one_way(10_000, 5.0)
    axis, notes = read(tmp_path, whole % 10_000, GEARED, whole % 10_000, ", period: 10000")
    np.testing.assert_allclose(np.diff(axis.position) / RESOLUTION_RAD, np.diff(whole), atol=0.5)
    np.testing.assert_allclose(axis.reference, axis.position)
    assert "begins anew after 10000 count, 14 times: it is counted on" in notes[0]
    fast = np.floor(0.45 * 10_000 * np.arange(2000))
    axis, _ = read(tmp_path, fast % 10_000, GEARED, more=", period: 10000")
    np.testing.assert_allclose(np.diff(axis.position) / RESOLUTION_RAD, 4500, atol=0.5)
    turns = np.arange(2000) / 300.0
    axis, _ = read(tmp_path, turns % 1.0, "unit: turns", turns % 1.0, ", period: 0", ", period: 1")
    np.testing.assert_allclose(np.diff(axis.reference), 2.0 * np.pi / 300.0, atol=1e-7)
    np.testing.assert_allclose(axis.position, 2.0 * np.pi * (turns % 1.0), atol=1e-7)


@pytest.mark.parametrize(
    ("period", "message"),
    [
        ("360", r"axes\.x\.position\.period: 360 count, but column 'q' spans 4096"),
        ("-1", r"d\.yaml:5: axes\.x\.position\.period: .*greater than or equal to 0"),
        ("often", r"d\.yaml:5: axes\.x\.position\.period: .*number"),
    ],
)
def test_a_period_that_cannot_be_is_refused(tmp_path, period, message):
    with pytest.raises(DataError, match=message):
        read(tmp_path, np.linspace(0, 4096, 50), GEARED, more=f", period: {period}")


def test_a_blank_where_a_position_begins_anew_hides_nothing(tmp_path):
    whole = 0.05 * np.arange(3000)
    wrapped = (whole + 12.5) % 25.0 - 12.5
    behind = np.flatnonzero(np.abs(np.diff(wrapped)) > 20.0) + 1
    wrapped[behind[1]] = wrapped[behind[3] - 1] = np.nan
    axis, notes = read(tmp_path, wrapped, "unit: rad")
    np.testing.assert_allclose(axis.position, whole, atol=1e-6)
    assert "begins anew after 25 rad" in notes[0]
    assert "2 of 3000 values of column 'q' are blank" in notes[1]
