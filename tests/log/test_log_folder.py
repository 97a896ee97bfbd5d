"""Retention: what is called like a log of the machine may go, the oldest first; nothing else."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from pathlib import Path

from hypothesis import given
from hypothesis import settings as trying
from hypothesis import strategies as st
from recorded_rows import AXES, make_rows

from motorctl.log import LogWriter
from motorctl.log.folder import Retention, free_log_path, remove_outdated, stored_logs

NOW_S = 1_800_000_000.0
DAY_S = 86_400.0
MUCH = 1e15
FOREIGN = (
    "notes.txt",
    "bench.parquet",
    "bench-20260101.parquet",
    "bench-20260101T000000Z.csv",
    "bench-20260101T000000Z.parquet.bak",
    "my-bench-20260101T000000Z.parquet",
    "bench-2-20260101T000000Z.parquet",
    "BENCH-20260101T000000Z.parquet",
    "bench-20260101T000000Z-copy.parquet",
    "bench-99999999T999999Z.parquet",
)


def file(folder: Path, name: str, size: int = 1000, age_s: float = 0.0) -> Path:
    path = folder / name
    path.write_bytes(bytes(size))
    os.utime(path, (NOW_S - age_s, NOW_S - age_s))
    return path


def removed(folder: Path, free: float = MUCH, **limits: float) -> list[str]:
    found = remove_outdated(folder, "bench", Retention(**limits), NOW_S, lambda: free)
    assert not any(gone.path.exists() for gone in found)
    return [gone.path.name for gone in found]


def day(number: int) -> str:
    return f"bench-202601{number:02}T000000Z.parquet"


def test_without_limits_nothing_is_ever_removed(tmp_path: Path) -> None:
    file(tmp_path, day(1), age_s=9999 * DAY_S)
    assert removed(tmp_path, free=0.0) == []


def test_foreign_files_folders_links_and_flight_records_stay(tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    kept = [file(tmp_path, name, age_s=9999 * DAY_S) for name in FOREIGN]
    (tmp_path / "faults").mkdir()
    kept.append(file(tmp_path / "faults", "20260101T000000Z-x-estop.parquet", age_s=9999 * DAY_S))
    kept.append(tmp_path / day(3))
    kept[-1].mkdir()
    kept.append(tmp_path / day(4))
    kept[-1].symlink_to(file(elsewhere, "real.parquet", age_s=9999 * DAY_S))
    file(tmp_path, day(1), age_s=9999 * DAY_S)
    gone = removed(tmp_path, free=0.0, max_age_s=1.0, max_total_bytes=1.0, min_free_bytes=1e12)
    assert gone == [day(1)]
    assert all(path.exists() for path in kept)


def test_age_is_that_of_the_last_row_not_of_the_first(tmp_path: Path) -> None:
    file(tmp_path, day(1), age_s=31 * DAY_S)
    file(tmp_path, day(2), age_s=29 * DAY_S)  # a long one: begun 40 days ago, say
    assert removed(tmp_path, max_age_s=30 * DAY_S) == [day(1)]


def test_a_log_of_a_time_to_come_is_as_old_as_the_next_one_and_keeps_none(tmp_path: Path) -> None:
    first = file(tmp_path, day(1), age_s=-20_000 * DAY_S)  # then the clock was set back
    second = file(tmp_path, day(2), age_s=40 * DAY_S)
    file(tmp_path, day(3), age_s=20 * DAY_S)
    assert removed(tmp_path, max_age_s=30 * DAY_S) == [first.name, second.name]
    file(tmp_path, day(4), age_s=-DAY_S)
    assert removed(tmp_path, max_age_s=30 * DAY_S) == []
    assert removed(tmp_path, max_age_s=10 * DAY_S) == [day(3)]


def test_the_total_counts_unfinished_logs_too(tmp_path: Path) -> None:
    for number in (1, 2, 3):
        file(tmp_path, day(number), 1000)
    file(tmp_path, day(4) + ".partial", 5000)
    file(tmp_path, day(4) + ".tmp", 500)
    assert removed(tmp_path, max_total_bytes=6700) == [day(1), day(2)]


def test_only_as_much_is_removed_as_the_disk_needs(tmp_path: Path) -> None:
    for number in range(1, 6):
        file(tmp_path, day(number), 1000)

    def free() -> float:
        return 10_000.0 - sum(path.stat().st_size for path in tmp_path.iterdir())

    limits = Retention(min_free_bytes=6900)
    gone = remove_outdated(tmp_path, "bench", limits, NOW_S, free)
    assert [each.path.name for each in gone] == [day(1), day(2)]
    assert {each.reason for each in gone} == {"free space"}


def test_a_disk_that_frees_later_costs_no_more_logs_than_one_that_frees_at_once(
    tmp_path: Path,
) -> None:
    for number in range(1, 6):
        file(tmp_path, day(number), 1000)
    assert removed(tmp_path, free=5000.0, min_free_bytes=6900.0) == [day(1), day(2)]


def test_the_newest_log_is_not_removed_for_space_that_it_would_not_make(tmp_path: Path) -> None:
    for number in range(1, 4):
        file(tmp_path, day(number), 1000)
    file(tmp_path, day(4) + ".partial", 1000)
    assert removed(tmp_path, free=0.0, min_free_bytes=1e9) == [day(1), day(2)]


@trying(max_examples=40)
@given(sizes=st.lists(st.integers(1, 50), min_size=1, max_size=12), limit=st.integers(0, 300))
def test_what_is_kept_is_the_youngest_without_a_gap_and_no_less_than_fits(
    tmp_path_factory, sizes: list[int], limit: int
) -> None:
    folder = tmp_path_factory.mktemp("kept")
    names = [file(folder, day(number), size).name for number, size in enumerate(sizes, 1)]
    gone = removed(folder, max_total_bytes=float(limit))
    assert gone == names[: len(gone)]
    left = sizes[len(gone) :]
    assert sum(left) <= limit
    assert not gone or sum(left) + sizes[len(gone) - 1] > limit


def test_logs_that_began_in_one_second_are_in_order(tmp_path: Path) -> None:
    when = datetime(2026, 1, 1, tzinfo=UTC)
    names = []
    for _ in range(12):
        path = free_log_path(tmp_path, "bench", when)
        names.append(path.name)
        file(tmp_path, path.name)
    assert [log.path.name for log in stored_logs(tmp_path, "bench")] == names
    assert names[-1].endswith("Z-12.parquet")


def test_a_name_that_became_free_is_not_given_to_a_later_log(tmp_path: Path) -> None:
    when = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
    first, second = (written(tmp_path, when) for _ in range(2))
    first.unlink()
    third = written(tmp_path, when)
    assert [log.path for log in stored_logs(tmp_path, "bench")] == [second, third]


def test_digits_that_are_no_time_are_in_no_later_name(tmp_path: Path) -> None:
    file(tmp_path, "bench-99999999T999999Z.parquet")
    noon = datetime(2026, 1, 1, 12, tzinfo=UTC)
    assert free_log_path(tmp_path, "bench", noon).name == "bench-20260101T120000Z.parquet"


def written(folder: Path, when: datetime) -> Path:
    """Write a log that begins at a time."""
    path = free_log_path(folder, "bench", when)
    path.write_bytes(b"rows")
    return path


def test_what_is_being_recorded_is_never_removed(tmp_path: Path) -> None:
    writer = LogWriter(tmp_path / day(1), {}, AXES)
    writer.append(*make_rows(30))
    writer.flush()
    file(tmp_path, day(2), age_s=9999 * DAY_S)
    assert removed(tmp_path, free=0.0, max_total_bytes=1.0, min_free_bytes=1e12) == [day(2)]
    assert writer.close({}).exists()


def test_a_closed_recording_that_waits_to_be_made_a_log_goes_in_its_turn(tmp_path: Path) -> None:
    writer = LogWriter(tmp_path / day(1), {}, AXES)
    writer.append(*make_rows(30))
    writer.seal({})
    file(tmp_path, day(2), 10)
    assert removed(tmp_path, max_total_bytes=100.0) == [day(1)]
    assert [path.name for path in tmp_path.iterdir()] == [day(2)]
