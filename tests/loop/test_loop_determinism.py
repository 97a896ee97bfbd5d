"""In virtual time the same machine gives the same rows, bit for bit."""

import numpy as np
import pytest
from loop_bench import Rig, gantry

from motorctl.errors import UsageError
from motorctl.loop.simulation import with_seed


def bytes_of(rows: np.ndarray) -> dict[str, bytes]:
    """Return the bytes of every field; those between the fields mean nothing."""
    return {name: rows[name].tobytes() for name in rows.dtype.names}


def rows_of(machine) -> tuple[dict[str, bytes], dict[str, bytes]]:
    with Rig(machine) as rig:
        rig.start()
        rig.follow_programs(["published_x", "published_y"])
        rig.seconds(1.0)
        ticks = np.concatenate([ticks for ticks, _ in rig.chunks])
        samples = np.concatenate([samples for _, samples in rig.chunks])
        return bytes_of(ticks), bytes_of(samples)


def test_two_runs_give_the_same_bytes():
    first, second = rows_of(gantry()), rows_of(gantry())
    assert first == second


def test_another_seed_gives_other_rows():
    ticks, samples = rows_of(gantry())
    other_ticks, other_samples = rows_of(with_seed(gantry(), 2))
    assert ticks == other_ticks
    assert samples != other_samples


def test_a_seed_that_is_none_is_refused():
    with pytest.raises(UsageError, match="--seed -1: should be 0 or above"):
        with_seed(gantry(), -1)
