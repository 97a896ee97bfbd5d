"""Whoever reads the ring beside the supervisor: a place of its own, nothing written."""

from __future__ import annotations

import mmap
import os
import subprocess
from pathlib import Path

import pytest
from recorded_ring import Ring, ring

from motorctl.loop.sample_ring import SampleRing


def reader(filled: Ring) -> SampleRing:
    """Attach to a ring by a descriptor that reads only, as another process does."""
    return SampleRing.attach(filled.memory.open_to_read())


def test_a_reader_has_a_place_of_its_own_and_counts_what_it_lost() -> None:
    with ring() as filled:
        beside = reader(filled)
        filled.run(100)
        assert len(filled.take()[0]) == 100
        ticks, samples, lost = beside.drain()
        assert (ticks["tick"].tolist(), lost) == (list(range(100)), 0)
        assert samples["position_m"][99, 0] == pytest.approx(0.099)
        filled.run(beside.ring_rows + 50)
        ticks, _, lost = beside.drain()
        # The oldest row may be the one that is being written.
        assert lost == 51
        assert (ticks["tick"][0], len(ticks)) == (151, beside.ring_rows - 1)
        beside.close()


def test_a_reader_begins_now_or_a_while_ago() -> None:
    with ring() as filled:
        filled.run(500)
        beside = reader(filled)
        beside.skip()
        assert len(beside.drain()[0]) == 0
        beside.skip(keep_rows=20)
        assert beside.drain()[0]["tick"].tolist() == list(range(480, 500))
        filled.memory.status["models_row"][0] = 490
        beside.skip(keep_rows=20)
        assert beside.drain()[0]["tick"].tolist() == list(range(490, 500))
        filled.run(beside.ring_rows)
        beside.skip(keep_rows=10 * beside.ring_rows)
        assert beside.drain()[2] == 0, "what is gone was not asked for, and is not lost"
        beside.close()


def test_a_reader_cannot_write() -> None:
    with ring() as filled:
        descriptor = filled.memory.open_to_read()
        size = os.fstat(descriptor).st_size
        for access in (mmap.PROT_WRITE, mmap.PROT_READ | mmap.PROT_WRITE):
            with pytest.raises(PermissionError):
                mmap.mmap(descriptor, size, prot=access)
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.pwrite(descriptor, b"x", 0)
        with pytest.raises(OSError, match="Invalid argument"):
            os.ftruncate(descriptor, 0)
        beside = SampleRing.attach(descriptor)
        with pytest.raises(ValueError, match="read-only"):
            beside.samples["position_m"][0, 0] = 1.0
        with pytest.raises(ValueError, match="read-only"):
            beside.status["beat"][0] = 1
        beside.close()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may become another user")
def test_another_user_cannot_open_what_it_reads_anew_to_write(tmp_path: Path) -> None:
    with ring() as filled:
        descriptor = filled.memory.open_to_read()
        opened = [
            subprocess.run(
                ["/bin/sh", "-c", f"exec 9{how} /proc/self/fd/{descriptor}"],
                pass_fds=(descriptor,),
                user=65534,
                group=65534,
                extra_groups=[],
                cwd="/",
                capture_output=True,
                text=True,
                check=False,
            )
            for how in ("<>", ">>")
        ]
        os.close(descriptor)
    assert all(done.returncode != 0 for done in opened)
    assert all("Permission denied" in done.stderr for done in opened)
