"""A ring that a loop seems to fill, as fast as a test wants, and the log that it goes to."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

from motorctl.config.recording_keys import RecordingKeys
from motorctl.daemon.rotating_log import RotatingLog
from motorctl.log import LogAxis, recover
from motorctl.log.sample import AxisState, row_bytes
from motorctl.loop import LoopMemory

MACHINE = "bench"
AXES = (LogAxis("x", ("inertia", "offset")), LogAxis("y", ("inertia",)))
ROW_BYTES = row_bytes([(2, False, False), (1, False, False)])
MUCH = 1e15
"""Free bytes of a disk that is never full."""


class Ring:
    """The loop's memory, and who fills it."""

    def __init__(self, rate_hz: float = 1000.0) -> None:
        self.rate_hz = rate_hz
        self.memory = LoopMemory.create([axis.name for axis in AXES], 2, rate_hz)

    @property
    def rows(self) -> int:
        """How many were written so far."""
        return int(self.memory.status["ring_head"][0])

    def take(self) -> tuple[NDArray[np.void], NDArray[np.void]]:
        """Return the rows that were not taken yet."""
        ticks, samples, lost = self.memory.drain()
        assert lost == 0
        return ticks, samples

    def run(self, rows: int, state: AxisState = AxisState.RUNNING) -> None:
        """Tick so many times; the tick is the row's number, and so is the position, in mm."""
        memory, head = self.memory, self.rows
        number = np.arange(head, head + rows)
        row = number % memory.ring_rows
        memory.ticks["tick"][row] = number
        memory.ticks["time_s"][row] = number / self.rate_hz
        memory.samples["position_m"][row] = 1e-3 * number[:, None]
        memory.samples["state"][row] = state
        memory.status["ring_head"][0] = head + rows


@contextmanager
def ring(rate_hz: float = 1000.0) -> Iterator[Ring]:
    """Make a ring, and give its memory back."""
    made = Ring(rate_hz)
    try:
        yield made
    finally:
        made.memory.close()


def settings(**keys: Any) -> RecordingKeys:
    """Return the part `recording` of a configuration; no key: no limit of rotation."""
    rotate = {"max_size_mb": None, "max_duration_h": None, **keys.pop("rotate", {})}
    text = json.dumps({"rotate": rotate, **keys})
    return RecordingKeys.model_validate_json(text)


def rotating(
    folder: Path,
    keys: RecordingKeys,
    on_sealed: Callable[[Path], None],
    free: Callable[[Path], float] = lambda _: MUCH,
    lost: Callable[[], int] = lambda: 0,
    now: Callable[[], datetime] = lambda: datetime.now(UTC),
) -> RotatingLog:
    """Return a log of the ring's axes."""
    return RotatingLog(
        folder,
        MACHINE,
        AXES,
        lambda: {"rate_hz": 1000.0},
        lambda: {"rows_lost": lost(), "loop": {}},
        keys,
        on_sealed,
        free,
        now,
    )


def being_recorded(log: RotatingLog) -> Path:
    """Return the file that the next rows go to."""
    return log.path.with_name(log.path.name + ".partial")


def finished(partials: list[Path]) -> list[Path]:
    """Make logs of sealed recordings."""
    return [recover(partial).path for partial in partials]


def ticks_of(paths: list[Path]) -> NDArray[np.int64]:
    """Return the ticks of several logs, one after the other."""
    columns = [pq.read_table(path, columns=["tick"])["tick"].to_numpy() for path in paths]
    return np.concatenate(columns)


def metadata_of(path: Path) -> dict[str, Any]:
    """Return what a log says of itself."""
    found: dict[str, Any] = json.loads(pq.read_schema(path).metadata[b"motorctl"])
    return found
