"""A fleet looked at without an engine: its steps one after the other, in this process."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from motorctl.fleet.findings import Refusal, Row, table_of_log
from motorctl.fleet.head import Declared, LogHead
from motorctl.fleet.job import steps_of
from motorctl.fleet.look import look_at_head
from motorctl.fleet.store import Store, key_of, open_store


def head_of(log: Path, model: str | None = "C1") -> LogHead:
    head = look_at_head(str(log), Declared(model))
    assert isinstance(head, LogHead), head
    return head


def looked_at(
    log: Path, declared: Declared | None = None, diagnoses: int = 0
) -> list[Row] | Refusal:
    declared = declared or Declared("C1")
    head = look_at_head(str(log), declared)
    if not isinstance(head, LogHead):
        return head[0]
    steps = steps_of(head, declared, diagnoses)
    results = None
    while True:
        try:
            tasks = steps.send(results)  # type: ignore[arg-type]
        except StopIteration as end:
            return end.value
        assert tasks, "an engine would wait for ever"
        results = [task.call(*task.arguments) for task in tasks]


def store_of(folder: Path, logs: Iterable[Path]) -> Store:
    store = open_store(folder, create=True)
    for log in logs:
        head, rows = head_of(log), looked_at(log)
        assert not isinstance(rows, Refusal), rows
        key = key_of(head.log_id, head.model_id, 0)
        store.write(key, head.begin_utc, table_of_log(head, key, rows))
    return store
