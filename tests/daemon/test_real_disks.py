"""The recorder on file systems that really become read-only, or are really gone.

Each is mounted in a name space of its own, so that nothing of it is seen outside or stays.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SUPPORT = Path(__file__).parents[1] / "support"
BEGINNING = """
import logging, os, subprocess, sys
from pathlib import Path
from recorded_ring import ring, rotating, settings, finished, ticks_of
from motorctl.daemon.recorder import Recorder
from motorctl.errors import MotorctlError
from motorctl.log.folder import must_be_writable, stored_logs
folder, sealed = Path(sys.argv[1]), []
logging.basicConfig(stream=sys.stderr, format="%(message)s")

def sh(command):
    subprocess.run(command, shell=True, check=True, cwd="/")

def record(recorder, bench, rows):
    bench.run(rows)
    recorder._drain()

def begin(bench, free=lambda _: 1e15):  # nobody warns: the disk itself refuses
    log = rotating(folder, settings(disk={"stop_below_mb": 0}), sealed.append, free=free)
    return log, Recorder(bench.memory, log)
"""

FULL_THEN_READ_ONLY = """
with ring() as bench:
    log, recorder = begin(bench)
    while recorder.failure is None:
        record(recorder, bench, 2000)
    assert "No space left" in recorder.failure, recorder.failure
    kept = recorder.rows_written
    sh(f"rm {folder}/ballast; mount -o remount,ro {folder}")
    for _ in range(3):
        record(recorder, bench, 2000)
        assert "Read-only file system" in recorder.failure, recorder.failure
    assert recorder.rows_lost == bench.rows - kept
    sh(f"mount -o remount,rw {folder}")
    back = bench.rows
    record(recorder, bench, 2000)
    assert recorder.failure is None, recorder.failure
    logs = [*finished(sealed), recorder.finish(dict)]
    assert ticks_of(logs).tolist() == [*range(kept), *range(back, back + 2000)]
    assert len(stored_logs(folder, "bench")) == len(logs) == 2, logs
"""

READ_ONLY_AT_THE_START = """
sh(f"mount -o remount,ro {folder}")
try:
    must_be_writable(folder, "log directory")
except MotorctlError as no:
    assert "no permission to write" in str(no), no
else:
    raise AssertionError("nobody noticed")
with ring() as bench:
    try:
        begin(bench)
    except MotorctlError as no:
        assert "Read-only file system" in str(no), no
    else:
        raise AssertionError("it was opened")
"""

GONE = """
with ring() as bench:
    log, recorder = begin(bench)
    record(recorder, bench, 1000)
    sh(f"umount -l {folder}")
    assert not list(folder.iterdir())  # what lay below the mount
    record(recorder, bench, 1000)
    record(recorder, bench, 1000)
    assert (recorder.rows_lost, recorder.failure) == (0, None), recorder.failure
    last = recorder.finish(dict)
    # What was on the disk is on the disk; the others are where its folder had been.
    assert ticks_of([last]).tolist() == list(range(1000, 3000))
"""

READ_ONLY_UNDER_AN_OPEN_FILE = """
device = os.path.basename(os.popen(f"findmnt -no SOURCE {folder}").read().strip())
with ring() as bench:
    log, recorder = begin(bench)
    record(recorder, bench, 1000)
    sh(f"echo motorctl > /sys/fs/ext4/{device}/trigger_fs_error")
    for _ in range(3):
        record(recorder, bench, 1000)
        assert "Read-only file system" in recorder.failure, recorder.failure
    assert (recorder.rows_written, recorder.rows_lost) == (1000, 3000)
    try:
        recorder.finish(dict)
    except MotorctlError as no:
        assert "Read-only file system" in str(no), no
    partial, = folder.glob("*.partial")
    copy = folder.parent / partial.name
    copy.write_bytes(partial.read_bytes())
    assert ticks_of(finished([copy])).tolist() == list(range(1000))
"""


def on_a_mount(folder: Path, mount: str, script: str, *, real_root: bool = False) -> str:
    """Run a script with a file system mounted on a folder; return what it logged."""
    name_space = ["unshare", "-m" if real_root else "-rm"]
    if shutil.which("unshare") is None or (real_root and os.geteuid() != 0):
        pytest.skip("no name space with mounts can be made here")
    probe = f"{mount} && rm -f {folder}/ballast"
    arguments = [str(folder), sys.executable, BEGINNING + script]
    tried = subprocess.run(
        [*name_space, "sh", "-c", probe, "sh", *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
    if tried.returncode:
        pytest.skip(f"nothing can be mounted here: {tried.stderr.strip()}")
    done = subprocess.run(
        [*name_space, "sh", "-c", f'{mount} && exec "$2" -c "$3" "$1"', "sh", *arguments],
        cwd=SUPPORT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stderr


TMPFS = 'mount -t tmpfs -o size=8m tmpfs "$1" && head -c 4000000 /dev/zero > "$1/ballast"'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "disk"
    made.mkdir()
    return made


@pytest.mark.slow
def test_a_disk_that_is_full_and_then_read_only_costs_what_it_refused(folder: Path) -> None:
    on_a_mount(folder, TMPFS, FULL_THEN_READ_ONLY)


@pytest.mark.slow
def test_a_read_only_disk_is_told_before_anything_starts(folder: Path) -> None:
    on_a_mount(folder, TMPFS, READ_ONLY_AT_THE_START)


@pytest.mark.slow
def test_a_disk_that_is_gone_leaves_its_rows_there_and_the_next_ones_are_kept(
    folder: Path,
) -> None:
    told = on_a_mount(folder, TMPFS, GONE)
    assert told.count("a new log is begun") == 1
    assert "1000 rows" in told


@pytest.mark.slow
def test_a_disk_that_the_kernel_makes_read_only_under_an_open_file(
    folder: Path, tmp_path: Path
) -> None:
    """Ext4 after an error of its own, as of a card that fails: files stay open, and are dead."""
    if shutil.which("mkfs.ext4") is None:
        pytest.skip("no mkfs.ext4")
    image = tmp_path / "image"
    with image.open("wb") as file:
        file.truncate(32 << 20)
    subprocess.run(["mkfs.ext4", "-q", image], check=True, capture_output=True)
    mount = f'mount -o loop,errors=remount-ro {image} "$1"'
    on_a_mount(folder, mount, READ_ONLY_UNDER_AN_OPEN_FILE, real_root=True)
