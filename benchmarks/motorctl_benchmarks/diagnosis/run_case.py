"""One case from drawing to answer: record, diagnose, compare with peers, close the loop."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from motorctl.identify.columns.measured import read_measured
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.diagnose.result import RecordingDiagnosis
from motorctl.identify.fit.declared_models import declared_models
from motorctl.log import Recording
from motorctl_benchmarks.diagnosis.answer import Answer, answer_of, in_one_line
from motorctl_benchmarks.diagnosis.cases import Case, plain
from motorctl_benchmarks.diagnosis.closed_loop import ClosedLoop, close_loop
from motorctl_benchmarks.diagnosis.groups import CaseKey, draw
from motorctl_benchmarks.diagnosis.peers import PeerAnswer, ask_peers
from motorctl_benchmarks.diagnosis.record import record_case
from motorctl_benchmarks.diagnosis.score import RULES, Truth


@dataclass(frozen=True)
class Task:
    """A case, and what is done with it besides its diagnosis."""

    key: CaseKey
    close_loop: bool = False
    ask_peers: bool = False
    logs: Path | None = None
    """Where its log is kept; else it goes when the case is done."""


@dataclass(frozen=True)
class Outcome:
    """A case and its results."""

    key: CaseKey
    title: str
    axis: str
    truth: Truth
    case: Mapping[str, Any]
    """As plain data."""
    answer: Answer
    record_s: float | None
    """What recording took by the clock."""
    peers: Mapping[str, PeerAnswer] = field(default_factory=dict)
    """By the peer's name; empty where none was asked."""
    closed_loop: ClosedLoop | None = None
    closed_loop_failure: str = ""

    @property
    def right(self) -> bool:
        """Whether the answer is right by the rule of its group."""
        return RULES[self.key.group](self.truth, self.answer)

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            "group": self.key.group,
            "case": dict(self.case),
            "answer": self.answer.document(),
            "right": self.right,
            "record_s": self.record_s,
            "peers": {name: peer.document() for name, peer in self.peers.items()},
            "closed_loop": None if self.closed_loop is None else self.closed_loop.document(),
            "closed_loop_failure": self.closed_loop_failure or None,
        }


def run_task(task: Task) -> Outcome:
    """Record and diagnose a case; a failure is its outcome, so that the campaign goes on."""
    case = draw(task.key)
    with tempfile.TemporaryDirectory(prefix="motorctl-") as scratch:
        return _run(task, case, Path(scratch))


def _run(task: Task, case: Case, scratch: Path) -> Outcome:
    began = time.monotonic()
    diagnosis: RecordingDiagnosis | None = None
    recording: Recording | None = None
    record_s = None
    try:
        log = record_case(case, task.logs or scratch)
        record_s = time.monotonic() - began
        began, processor = time.monotonic(), time.process_time()
        recording = read_measured(log)
        models = declared_models(recording, None, case.axis)
        diagnosis = diagnose_recording(recording, models)
        taken = time.monotonic() - began, time.process_time() - processor
        answer = answer_of(diagnosis.axes[case.axis], *taken)
    except Exception as error:  # whatever it is, it is this case's answer
        answer = Answer("failed", failure=in_one_line(error))
    peers: Mapping[str, PeerAnswer] = {}
    if task.ask_peers and recording is not None:
        peers = ask_peers(recording, case.axis)
    closed, failure = None, ""
    if task.close_loop:
        try:
            if diagnosis is None:
                failure = "there is no diagnosis"
            else:
                closed = close_loop(case, diagnosis, scratch)
        except Exception as error:  # as above
            failure = in_one_line(error)
    return Outcome(
        key=task.key,
        title=case.title,
        axis=case.axis,
        truth=case.truth,
        case=plain(case),
        answer=answer,
        record_s=record_s,
        peers=peers,
        closed_loop=closed,
        closed_loop_failure=failure,
    )
