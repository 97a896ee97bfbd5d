"""One axis: diagnosed on the first two thirds of its recording, judged on the last."""

from __future__ import annotations

import math
import tempfile
import traceback
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from motorctl.errors import DataError, UsageError
from motorctl.identify.columns.measured import Measured, measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.fit.declared_models import controller_list
from motorctl.log import Recording, read_recording
from motorctl.model.sign_function import slope_of
from motorctl_benchmarks.diagnosis.answer import Answer, answer_of, in_one_line
from motorctl_benchmarks.real_machines.axes import AXES
from motorctl_benchmarks.real_machines.description import described
from motorctl_benchmarks.real_machines.peer_models import peer_errors
from motorctl_benchmarks.real_machines.readers import Columns
from motorctl_benchmarks.real_machines.real_axis import RealAxis

FITTED = 2.0 / 3.0
"""Part of a recording that is fitted. Convention."""
RELIED_UPON = 0.5
"""Confidence below which a name says itself that it is rather wrong."""


@dataclass(frozen=True)
class AxisTask:
    """An axis, and the folder of all recordings."""

    axis: str
    recordings: Path


@dataclass(frozen=True)
class AxisOutcome:
    """What was said of an axis, and what each model misses of its position [rms]."""

    axis: str
    said: str
    """Verdict and names, or why there is none."""
    false_names: tuple[str, ...] = ()
    """Given with a confidence of a half or more, and not what the machine has."""
    crashed: bool = False
    unit: str = ""
    window_s: float = math.nan
    declared: float = math.nan
    ours: float = math.nan
    """Of the declared model, and with what was found."""
    peers: dict[str, float] = field(default_factory=dict)
    traceback: str = ""
    may_name: tuple[str, ...] = ()
    """Effects that the machine has."""
    answer: Answer | None = None
    """What was said, with what it rests on."""

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        told = None if self.answer is None else self.answer.document()
        return asdict(replace(self, answer=None)) | {"answer": told}


def run_axis(task: AxisTask) -> AxisOutcome:
    """Diagnose and judge one axis; a failure is its outcome, so that the others go on."""
    axis = next(axis for axis in AXES if axis.name == task.axis)
    try:
        with tempfile.TemporaryDirectory() as folder:
            return _judged(axis, axis.read(task.recordings), Path(folder))
    except (DataError, UsageError) as error:
        return AxisOutcome(axis.name, f"refused: {in_one_line(error)}")
    except Exception as error:  # whatever it is, it is this axis' answer
        told = traceback.format_exc()
        return AxisOutcome(axis.name, in_one_line(error), crashed=True, traceback=told)


def _judged(axis: RealAxis, columns: Columns, folder: Path) -> AxisOutcome:
    train, test = (_recording(axis, columns, part, folder) for part in ("first", "last"))
    model = controller_list(None, "C1")
    found = diagnose_recording(train, {"x": model}, evaluate_on=test).axes["x"]
    error = found.error
    names = [f"{e.name} {e.confidence:.2f}" for e in found.effects]
    relied = {e.name for e in found.effects if e.confidence >= RELIED_UPON}
    window_s = math.nan if error.window_s is None else error.window_s
    slope = slope_of(model.effects)
    seen, unseen = (make_signals(_motion(r), slope_s_m=slope) for r in (train, test))
    return AxisOutcome(
        axis=axis.name,
        said=" + ".join(names) or found.verdict,
        false_names=tuple(sorted(relied - set(axis.may_name))),
        unit=found.data.position_unit,
        window_s=window_s,
        declared=_number(error.simulated_position_before_rms),
        ours=_number(error.simulated_position_after_rms),
        peers={} if math.isnan(window_s) else peer_errors(seen, unseen, window_s),
        may_name=axis.may_name,
        answer=answer_of(found, found.seconds, math.nan),
    )


def _recording(axis: RealAxis, columns: Columns, part: str, folder: Path) -> Recording:
    rows = len(columns["time_s"])
    cut = round(FITTED * rows)
    chosen = slice(0, cut) if part == "first" else slice(cut, rows)
    place = folder / part
    place.mkdir()
    return read_recording(described(axis, {k: v[chosen] for k, v in columns.items()}, place))


def _motion(recording: Recording) -> Measured:
    return measured(recording, "x")


def _number(value: float | None) -> float:
    return math.nan if value is None else value
