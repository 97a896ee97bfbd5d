"""Columns that were recorded apart, each with its own times, and stand in one file row by row."""

import numpy as np
import pytest

from motorctl.errors import DataError
from motorctl.log import read_recording

DESCRIPTION = """\
file: a.csv
time: {column: __time}
axes:
  trolley:
    position: {column: /position/data, unit: m}
    command: {column: /voltage/data, unit: V}
    reference: {column: /sent_to/data, unit: m}
"""
EPOCH_S = 1.7e9
RATE_HZ = 50.0


def place(time_s):
    return 0.3 * np.sin(2.0 * time_s)


def voltage(time_s):
    return np.floor(7.0 * np.cos(2.0 * time_s))


def written(folder, together=False, gone=()):
    """Write three messages a period, a row each, and describe them; return the description."""
    count = np.arange(200)
    streams = {
        "/position/data": (count / RATE_HZ, place),
        "/voltage/data": (count / RATE_HZ + (0.0 if together else 0.004), voltage),
        "/sent_to/data": (count[::2] / RATE_HZ + 0.011, place),
    }
    rows = {}
    for column, (times, of) in streams.items():
        for k, t in enumerate(times):
            if (column, k) not in gone:
                rows.setdefault(round(t, 6), {})[column] = of(t)
    lines = ["__time," + ",".join(streams)]
    for t in sorted(rows):
        cells = (f"{rows[t][c]:.9f}" if c in rows[t] else "" for c in streams)
        lines.append(f"{EPOCH_S + t:.6f}," + ",".join(cells))
    (folder / "a.csv").write_text("\n".join(lines) + "\n")
    (folder / "a.yaml").write_text(DESCRIPTION)
    return folder / "a.yaml"


def test_each_position_has_the_command_that_was_held_when_it_was_recorded(tmp_path):
    recording = read_recording(written(tmp_path))
    axis = recording.axes["trolley"]
    at = recording.time_s - EPOCH_S
    assert recording.sample_rate_hz == pytest.approx(RATE_HZ, rel=1e-5)
    np.testing.assert_allclose(axis.position, place(at), atol=1e-6)
    last_told = np.floor((at - 0.004) * RATE_HZ + 1e-3) / RATE_HZ + 0.004
    np.testing.assert_allclose(axis.command, voltage(last_told), atol=1e-9)
    np.testing.assert_allclose(axis.reference, place(at), atol=2e-3)


def test_a_command_that_was_written_only_when_it_changed_holds_to_the_end(tmp_path):
    gone = {("/voltage/data", k) for k in range(200) if k not in (1, 40, 90)}
    recording = read_recording(written(tmp_path, gone=gone))
    at = recording.time_s - EPOCH_S
    assert at[-1] > 3.9
    sent = np.array([1, 40, 90]) / RATE_HZ + 0.004
    last = sent[np.searchsorted(sent, at, side="right") - 1]
    np.testing.assert_allclose(recording.axes["trolley"].command, voltage(last), atol=1e-9)


@pytest.mark.parametrize("changes", [12, 16, 40])
def test_a_command_that_last_changed_in_the_middle_holds_to_the_end(tmp_path, changes):
    rng = np.random.default_rng(changes)
    kept = np.sort(rng.choice(np.arange(1, 100), changes, replace=False))
    gone = {("/voltage/data", k) for k in range(200) if k not in kept}
    recording = read_recording(written(tmp_path, gone=gone))
    assert recording.time_s[-1] - EPOCH_S > 3.9
    assert any(f"in {changes} others" in note for note in recording.notes)


def test_rows_before_every_column_has_begun_are_left_out_and_it_is_told(tmp_path):
    recording = read_recording(written(tmp_path))
    assert recording.time_s[0] - EPOCH_S > 0.011
    assert "'/position/data' stands in 200 of" in recording.notes[0]
    assert "as they were held" in recording.notes[0]


def test_a_column_that_was_recorded_with_the_others_and_has_blanks_is_refused(tmp_path):
    gone = {("/voltage/data", k) for k in range(20, 120)}
    path = written(tmp_path, together=True, gone=gone)
    path.write_text(DESCRIPTION.replace("    reference: {column: /sent_to/data, unit: m}\n", ""))
    with pytest.raises(DataError, match="is empty or not a number"):
        read_recording(path)
