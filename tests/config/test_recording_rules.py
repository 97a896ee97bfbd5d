"""The part `recording`: nonsense is refused with its arithmetic; `check` tells what it means."""

import pytest
from config_bench import line_of, machine, problems, write

from motorctl.config import load
from motorctl.config.recording_keys import DiskSettings, RecordingKeys, RetentionSettings
from motorctl.config.summary import summarise

# 2000 rows a second of 56 bytes and of one axis with five parameters: 192 bytes, 23 MB a minute
ROW_BYTES = 56 + 96 + 5 * 8
MB_H = ROW_BYTES * 2000 * 3600 / 1e6

MISTAKES = [
    ({"rotate": {"max_size_mb": 10}}, "rotate.max_size_mb", ["found 10", "26 s", "23 MB a minute"]),
    ({"rotate": {"max_duration_h": 0.01}}, "rotate.max_duration_h", ["0.01", "0.0166"]),
    ({"rotate": {"max_size": 10}}, "rotate.max_size", ["unknown key", "'max_size_mb'"]),
    (
        {"retention": {"max_total_size_mb": 10}},
        "retention.max_total_size_mb",
        ["all logs would hold 26 s"],
    ),
    (
        {"rotate": {"max_size_mb": 1000}, "retention": {"max_total_size_mb": 1500}},
        "retention.max_total_size_mb",
        ["found 1500", "at least 2000", "2 times the largest log", "1000 MB"],
    ),
    (
        {"retention": {"max_age_days": 0.02}},
        "retention.max_age_days",
        ["0.02 (0.48 h)", "rotate.max_duration_h: 1"],
    ),
    (
        {"retention": {"min_free_mb": 400}, "disk": {"stop_below_mb": 500}},
        "retention.min_free_mb",
        ["found 400", "more than disk.stop_below_mb: 500", "stop before anything is removed"],
    ),
    (
        {"rotate": {"max_size_mb": None, "max_duration_h": None}, "retention": {"max_age_days": 9}},
        "retention.max_age_days",
        ["found 9", "nothing could be removed", "never removed"],
    ),
    ({"retention": {"max_age_days": 0}}, "retention.max_age_days", ["found 0", "greater than 0"]),
    ({"while_off": "puase"}, "while_off", ["did you mean 'pause'?"]),
    ({"disk": {"warn_below_h": -1}}, "disk.warn_below_h", ["-1"]),
]


@pytest.mark.parametrize(("recording", "key", "parts"), MISTAKES)
def test_nonsense_is_refused_with_line_key_and_arithmetic(tmp_path, recording, key, parts):
    (told,) = problems(tmp_path, machine(recording=recording))
    assert told.key == f"recording.{key}"
    assert all(part in told.message for part in parts), told.message
    assert told.line == line_of(tmp_path / "machine.yaml", key.rpartition(".")[2])


def test_the_defaults_remove_nothing(tmp_path):
    recording = load(write(tmp_path, machine())).recording
    assert all(limit is None for _, limit in recording.retention)
    assert recording.while_off == "record"


def test_of_a_small_disk_less_is_left_free():
    assert RecordingKeys().reserve_mb(256_000) == 500
    assert RecordingKeys().reserve_mb(2_000) == 100
    kept = RetentionSettings(min_free_mb=80.0)
    assert RecordingKeys(retention=kept).reserve_mb(2_000) == 40
    assert RecordingKeys(disk=DiskSettings(stop_below_mb=5.0)).reserve_mb(2_000) == 5


def test_check_tells_megabytes_an_hour_and_how_long_logs_are_kept(tmp_path):
    keys = {"rotate": {"max_size_mb": 500}, "retention": {"max_total_size_mb": 10_000}}
    told = summarise(load(write(tmp_path, machine(recording=keys))))["recording"]
    assert told["row_bytes"] == ROW_BYTES
    assert told["recorded_mb_h"] == pytest.approx(MB_H)
    assert told["log_h"] == pytest.approx(500 / MB_H)
    assert told["kept_days"] == pytest.approx(9500 / (24 * told["closed_mb_h"]))
    by_age = {**keys, "retention": {"max_total_size_mb": 10_000, "max_age_days": 0.5}}
    assert (
        summarise(load(write(tmp_path, machine(recording=by_age))))["recording"]["kept_days"] == 0.5
    )


def test_the_bytes_of_a_row_are_those_that_reach_the_disk(tmp_path):
    """Measured with two axes of the log's own tests, beside what the rules reckon with."""
    from recorded_rows import AXES, make_rows

    from motorctl.log import LogWriter
    from motorctl.log.sample import row_bytes

    writer = LogWriter(tmp_path / "run.parquet", {}, AXES)
    head = writer.size_bytes
    writer.append(*make_rows(8192))
    writer.flush()
    reckoned = row_bytes((len(a.theta_names), a.dual_drive, a.learning) for a in AXES)
    assert (writer.size_bytes - head) / 8192 == pytest.approx(reckoned, rel=0.01)
    writer.close()


def test_what_will_surprise_is_noted(tmp_path):
    never = {"rotate": {"max_size_mb": None, "max_duration_h": None}}
    notes = summarise(load(write(tmp_path, machine(recording=never))))["notes"]
    assert any("without rotate a run is one log" in note for note in notes)
    large = {"rotate": {"max_size_mb": 100_000, "max_duration_h": None}}
    notes = summarise(load(write(tmp_path, machine(recording=large))))["notes"]
    assert any("100000 MB needs" in note for note in notes)
