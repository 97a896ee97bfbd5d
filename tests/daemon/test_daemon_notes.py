"""What a driver notes while it is opened reaches whoever runs the daemon or asks for its status."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from daemon_rig import Daemon, bench_config, raw_status

from motorctl.loop import LoopMemory
from motorctl_sim import SimDriver

pytestmark = pytest.mark.wall_clock(lanes=3)

HERE = Path(__file__).parent
SUPPORT = HERE.parent / "support"


class Noting(SimDriver):
    """Its port does not take a setting."""

    def open(self) -> None:
        super().open()
        self.notes = ("port /dev/ttyX: low_latency is refused;\n 16 ms", "and it is old")


@pytest.mark.slow
def test_a_note_is_one_line_of_the_daemon_and_stands_in_the_status(tmp_path: Path) -> None:
    config = bench_config().replace("type: sim", "type: 'test_daemon_notes:Noting'")
    path = os.pathsep.join((str(HERE), str(SUPPORT), os.environ.get("PYTHONPATH", "")))
    with Daemon(tmp_path, config, PYTHONPATH=path) as daemon:
        notes = [
            "drivers.gantry: port /dev/ttyX: low_latency is refused; 16 ms",
            "drivers.gantry: and it is old",
        ]
        assert raw_status(daemon)["loop"]["degraded"][-2:] == notes
        assert f"! {notes[1]}" in daemon.cli("status").stdout
        lines = daemon.said.splitlines()
        for note in notes:
            assert sum(line.endswith(note) for line in lines) == 1
        assert daemon.end() == 0, daemon.said


@pytest.mark.parametrize("letter", ["n", "ß"])
def test_notes_beyond_all_measure_are_cut(letter: str) -> None:
    memory = LoopMemory.create(["x"], 6, 200.0)
    try:
        memory.status["notes"][0] = f"a{letter * 10_000}".encode()
        (note,) = memory.notes
        assert 2000 < len(note) <= 4096
        assert note.startswith(f"a{letter * 2000}")
    finally:
        memory.close()
