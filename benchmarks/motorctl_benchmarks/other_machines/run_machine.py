"""One machine from its generator to the answer: what is recorded, diagnosed with C1 declared."""

from __future__ import annotations

import time
import traceback
import warnings
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from motorctl.errors import DataError, UsageError
from motorctl.identify.columns.measured import Measured
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.fit.declared_models import controller_list
from motorctl.log.units import COMMAND_UNITS, POSITION_UNITS
from motorctl_benchmarks.diagnosis.answer import Answer, answer_of, in_one_line
from motorctl_benchmarks.diagnosis.score import Truth
from motorctl_benchmarks.other_machines.clean_machines import CLEAN_KINDS, unevenly_recorded
from motorctl_benchmarks.other_machines.generators import MachineKey, generator
from motorctl_benchmarks.other_machines.machine_recording import MachineRecording
from motorctl_benchmarks.other_machines.mistakes import (
    ANOTHER_SEED,
    MACHINE,
    MISTAKES,
    MOST_SEEDS,
)
from motorctl_benchmarks.other_machines.truth import OTHERWISE_TOLD, KindTruth, truth_of

Result = Literal["answered", "refused", "crashed", "not recorded"]


@dataclass(frozen=True)
class MachineOutcome:
    """A machine and what was said of it."""

    key: MachineKey
    result: Result
    """Refused: the diagnosis says why it takes no such data. Not recorded: the generator failed."""
    answer: Answer
    """Its failure says why there is none."""
    story: str = ""
    """The machine in a sentence."""
    friction_shape: str = ""
    noise: int | None = None
    """As the recording names it."""
    traceback: str = ""
    """Of what crashed."""

    @property
    def kind(self) -> KindTruth:
        """What may be said of it."""
        return truth_of(self.key.kind, self.key.generator)

    @property
    def truth(self) -> Truth:
        """What was put in."""
        return self.kind.put_in

    @property
    def right(self) -> bool:
        """Whether the answer is right, or right enough."""
        return self.kind.right(self.answer)

    @property
    def false_names(self) -> frozenset[str]:
        """What is named and is neither right nor of the family."""
        return self.kind.false_names(self.answer)

    @property
    def misleads(self) -> bool:
        """Whether a mistake of the recording is taken for another, or for an effect."""
        return bool(self.answer.names) or self.judged == OTHERWISE_TOLD

    @property
    def judged(self) -> str:
        """What the answer is, in a word or two."""
        if self.result == "answered" or (self.kind.mistake and self.result == "refused"):
            return self.kind.judged(self.answer)
        return self.result

    def __str__(self) -> str:
        if self.result == "answered":
            return str(self.answer)
        return f"{self.result}: {self.answer.failure}"

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            "generator": self.key.generator,
            "kind": self.key.kind,
            "seed": self.key.seed,
            "story": self.story,
            "friction_shape": self.friction_shape,
            "noise": self.noise,
            "answer": self.answer.document(),
            "judged": self.judged,
            "right": self.right,
            "traceback": self.traceback,
        }


def run_machine(key: MachineKey) -> MachineOutcome:
    """Record and diagnose a machine; a failure is its outcome, so that the others go on."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # its arithmetic is its own
            recording, measured = _recorded(key)
    except Exception as error:  # whatever it is, it is no fault of the diagnosis
        return MachineOutcome(key, "not recorded", _failed(error), traceback=traceback.format_exc())
    told = recording.story, recording.friction_shape, recording.noise
    began, processor = time.monotonic(), time.process_time()
    try:
        diagnosis = diagnose_axis(measured, controller_list(None, "C1"))
        taken = time.monotonic() - began, time.process_time() - processor
        return MachineOutcome(key, "answered", answer_of(diagnosis, *taken), *told)
    except (DataError, UsageError) as error:
        return MachineOutcome(key, "refused", _failed(error), *told)
    except Exception as error:  # whatever it is, it is this case's answer
        return MachineOutcome(key, "crashed", _failed(error), *told, traceback.format_exc())


def _recorded(key: MachineKey) -> tuple[MachineRecording, Measured]:
    draw = generator(key.generator).machine
    if key.kind in CLEAN_KINDS:
        order = CLEAN_KINDS[key.kind]
        recording = draw(MACHINE, order.seed(key.seed), order.friction, order.noise)
        if not order.is_uneven:
            return recording, measured_of(recording, str(key))
        measured, how = unevenly_recorded(recording, order.seed(key.seed))
        return replace(recording, story=f"{recording.story}; {how}"), measured
    if key.kind not in MISTAKES:
        recording = draw(key.kind, key.seed)
        return recording, measured_of(recording, str(key))
    mistake = MISTAKES[key.kind]
    recording = draw(MACHINE, key.seed)
    for k in range(1, MOST_SEEDS if mistake.needs_reference else 0):
        if recording.reference is not None:
            break
        recording = draw(MACHINE, key.seed + k * ANOTHER_SEED)
    sound = measured_of(recording, str(key))
    return recording, mistake.make(sound, lambda: draw(MACHINE, key.seed + ANOTHER_SEED))


def _failed(error: Exception) -> Answer:
    return Answer("failed", failure=in_one_line(error))


def measured_of(recording: MachineRecording, source: str) -> Measured:
    """Return a recording as the diagnosis takes it: neither kind, story nor friction is in it.

    Parameters
    ----------
    recording
        What a generator made.
    source
        What messages call it.
    """
    count = len(recording.time_s)
    begin_s, end_s = float(recording.time_s[0]), float(recording.time_s[-1])
    rate_hz = (count - 1) / (end_s - begin_s)
    return Measured(
        source=source,
        axis="x",
        sample_rate_hz=float(f"{rate_hz:.9g}"),  # of times that are rounded
        time_s=begin_s + np.arange(count) / rate_hz,
        position=recording.position,
        command=recording.command,
        usable=np.ones(count, dtype=np.bool_),
        reference=recording.reference,
        resolution=recording.resolution,
        position_unit=POSITION_UNITS[recording.position_unit][1],
        command_unit=COMMAND_UNITS[recording.command_unit.replace(" ", "*")][1],
    )
