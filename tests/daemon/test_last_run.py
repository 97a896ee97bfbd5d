"""The next start says how the last run ended, and what has changed in the configuration since."""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from daemon_rig import bench_config
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from motorctl.config import Machine, load
from motorctl.daemon.config_watch import ConfigWatch, named_files
from motorctl.daemon.last_run import LastRun


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Machine:
    return configured(tmp_path_factory.mktemp("config"))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "state" / "runs" / "bench.json"


def configured(folder: Path, old: str = "", new: str = "") -> Machine:
    config = folder / "bench.yaml"
    config.write_text(bench_config().replace(old, new))
    return load(config)


def of_a_dead_process(path: Path, boot: str | None = None) -> None:
    """Let the file be that of a process that is gone, perhaps in another life of the computer."""
    run = json.loads(path.read_text())
    pid, began, life = run["process"].split()
    run["process"] = f"{pid} {int(began) + 1} {boot or life}"
    path.write_text(json.dumps(run))


def test_the_first_run_and_one_after_an_orderly_end_have_nothing_to_tell(
    machine: Machine, path: Path
) -> None:
    for _ in range(3):
        run = LastRun(machine, path)
        assert run.begin() == []
        assert run.end("") == []
    assert [file.name for file in path.parent.iterdir()] == ["bench.json"]


def test_a_run_that_was_killed_is_told_with_when_it_began(machine: Machine, path: Path) -> None:
    LastRun(machine, path).begin()
    began = json.loads(path.read_text())["started"]
    of_a_dead_process(path)
    (told,) = LastRun(machine, path).begin()
    assert told.startswith(
        f"the last run (since {began}) did not end in order: its supervisor and its loop process "
        "were killed"
    )
    of_a_dead_process(path, boot="another-life")
    (told,) = LastRun(machine, path).begin()
    assert told.endswith("the computer went down, or was restarted")


def test_a_loop_that_stopped_after_its_supervisor_was_killed_is_not_told_as_killed(
    machine: Machine, path: Path
) -> None:
    def killed() -> str:
        of_a_dead_process(path)
        (told,) = LastRun(machine, path).begin()
        return told

    run = LastRun(machine, path)
    run.begin()
    of_a_dead_process(path)
    note = run.loop_note
    assert note is not None
    # The run's file names the process as the note does.
    dataclasses.replace(note, words=json.loads(path.read_text())["process"]).leave()
    (told,) = LastRun(machine, path).begin()
    assert told.endswith("its supervisor was killed; its loop process then stopped every axis and "
                         "ended")  # fmt: skip
    assert "its loop process were killed" in killed()  # a note counts for its own run alone


def test_a_run_of_a_version_whose_loop_left_no_note_tells_of_its_supervisor_alone(
    machine: Machine, path: Path
) -> None:
    LastRun(machine, path).begin()
    of_a_dead_process(path)
    run = json.loads(path.read_text())
    del run["loop_tells"]
    path.write_text(json.dumps(run))
    (told,) = LastRun(machine, path).begin()
    assert told.endswith("did not end in order: its supervisor was killed")


@pytest.mark.slow
def test_a_run_that_a_process_really_left_by_sigkill_is_told(machine: Machine, path: Path) -> None:
    begin = (
        "import os, signal, sys\nfrom pathlib import Path\nfrom motorctl.config import load\n"
        "from motorctl.daemon.last_run import LastRun\n"
        "LastRun(load(sys.argv[1]), Path(sys.argv[2])).begin()\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", begin, str(machine.source), str(path)], check=False
    )
    assert done.returncode == -9
    (told,) = LastRun(machine, path).begin()
    assert "did not end in order: its supervisor and its loop process were killed" in told


@pytest.mark.parametrize("process", ["", "motorctl 0 {life}", "999999999 0 {life}"])
def test_a_process_or_a_note_that_makes_no_sense_is_taken_for_one_that_is_gone(
    machine: Machine, path: Path, process: str
) -> None:
    LastRun(machine, path).begin()
    run = json.loads(path.read_text())
    run["process"] = process.format(life=run["process"].split()[2])
    path.write_text(json.dumps(run))
    path.with_name(f"{path.name}.loop").write_bytes(b"\xff\x00")
    (told,) = LastRun(machine, path).begin()
    assert "did not end in order" in told


def test_a_run_that_is_under_way_is_not_called_dead(machine: Machine, path: Path) -> None:
    """Two daemons of one name on two sockets share the file."""
    LastRun(machine, path).begin()
    assert LastRun(machine, path).begin() == []


def test_what_went_wrong_at_the_end_is_told(machine: Machine, path: Path) -> None:
    run = LastRun(machine, path)
    run.begin()
    run.end("the loop process ended (killed by SIGKILL)")
    (told,) = LastRun(machine, path).begin()
    assert told.endswith(" ended with: the loop process ended (killed by SIGKILL)")


def test_changed_keys_are_told_with_both_values(
    machine: Machine, path: Path, tmp_path: Path
) -> None:
    run = LastRun(machine, path)
    run.begin()
    run.end("")
    changed = configured(tmp_path, "ks_v_s_m: 30", "ks_v_s_m: 31")
    (told,) = LastRun(changed, path).begin()
    assert told.startswith("the configuration has changed since the last run (since ")
    assert told.endswith("axes.y.gains.ks_v_s_m: 30.0 -> 31.0")
    assert LastRun(changed, path).begin() == []


def test_comments_are_no_change_and_of_many_changes_five_are_named(
    machine: Machine, path: Path, tmp_path: Path
) -> None:
    LastRun(machine, path).begin()
    assert LastRun(configured(tmp_path, "rate_hz", "# a comment\nrate_hz"), path).begin() == []
    (told,) = LastRun(configured(tmp_path, "0.05", "0.04"), path).begin()
    assert told.count(" -> ") == 5
    assert "; and " in told


def test_a_file_that_cannot_be_kept_hinders_nothing_and_is_told(
    machine: Machine, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    run = LastRun(machine, tmp_path / "file" / "bench.json")
    told = run.begin()
    assert any("the next start cannot tell how this run ended" in line for line in told)
    assert len(run.end("")) == 1


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.binary(max_size=200)
    | st.dictionaries(st.text(), st.text()).map(lambda it: json.dumps(it).encode())
    | st.integers(1, 2000).map(lambda cut: b"cut" + bytes([cut % 256]))
)
def test_whatever_stands_in_the_file_is_one_message(
    machine: Machine, tmp_path: Path, content: bytes
) -> None:
    path = tmp_path / "bench.json"
    path.write_bytes(content)
    (told,) = LastRun(machine, path).begin()
    assert told == f"{path}: how the last run ended is not known: it is damaged"
    assert LastRun(machine, path).begin() == []


def test_a_file_that_a_power_cut_left_short_is_one_message(machine: Machine, path: Path) -> None:
    LastRun(machine, path).begin()
    os.truncate(path, path.stat().st_size // 2)
    (told,) = LastRun(machine, path).begin()
    assert "it is damaged" in told


def test_a_file_that_is_edited_removed_and_put_back_is_told_each_time(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    source = tmp_path / "bench.yaml"
    source.write_text("name: bench\n")
    watch = ConfigWatch(source)
    steps = [
        (lambda: None, None, ""),
        (
            lambda: source.write_text("name: other\n"),
            "was changed",
            "was changed since it was read",
        ),
        (lambda: source.write_text("name: third\n"), "was changed", ""),
        (source.unlink, "was removed", "was removed since it was read: the machine goes on"),
        (source.mkdir, "can no longer be read (Is a directory)", "can no longer be read"),
        (source.rmdir, "was removed", "was removed"),
        (lambda: source.write_text("name: bench\n"), None, "is again what this daemon runs"),
    ]
    with caplog.at_level("INFO", "motorctl"):
        for do, difference, told in steps:
            caplog.clear()
            do()
            watch.look()
            watch.look()
            assert watch.difference == difference
            assert len(caplog.messages) == bool(told)
            assert told in caplog.text


def test_files_that_a_configuration_names_are_watched_too(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    points = tmp_path / "points.csv"
    times = [n / 100 for n in range(101)]
    rows = [f"{t},{0.05 * (10 * t**3 - 15 * t**4 + 6 * t**5)}" for t in times]
    points.write_text("\n".join(["time_s,x_m", *rows, ""]))
    text = "programs:\n  drawn: {kind: points, axes: [x], file: points.csv}"
    machine = configured(tmp_path, "programs:", text)
    assert named_files(machine) == [points]
    watch = ConfigWatch(machine.source, named_files(machine))
    watch.look()
    assert watch.difference is None
    points.write_text(points.read_text() + "\n")
    watch.look()
    assert watch.difference == f"names {points}, which was changed"
    assert f"{machine.source} names {points}, which was changed since it was read" in caplog.text
