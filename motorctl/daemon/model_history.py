"""Which models a machine ran, and why: a line for each change, kept from run to run."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from motorctl.config.machine import Machine
from motorctl.config.model_keys import MODEL_KEYS, model_of
from motorctl.state_folder import state_folder

MOST_LINES = 1000
"""So many changes are kept of a machine; older ones are forgotten. By hand: years of them."""

What = Literal["applied", "proven", "reverted", "fell_back"]


class ModelChange(BaseModel):
    """One change of an axis' model."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    time_utc: str
    axis: str
    what: What
    source: str
    """The configuration that it came with."""
    added: list[str]
    """Effects that the model before had not."""
    removed: list[str]
    changed: list[str]
    """Keys whose values differ, such as gains.ks_v_s_m."""
    story: list[str]
    """What the configuration says of how it was found: recording, effects, errors."""
    log: str | None
    """The first log of it."""
    why: str | None = None
    """Of one that fell back: what tripped."""


class ModelHistory:
    """The file of a machine's changes.

    Parameters
    ----------
    machine
        Its name.
    folder
        Of the files; None: motorctl's state folder.
    """

    def __init__(self, machine: str, folder: Path | None = None) -> None:
        self._path = (folder or state_folder() / "models") / f"{machine}.jsonl"

    def read(self) -> list[ModelChange]:
        """Return every change that can be read, oldest first; damaged lines are left out.

        Raises OSError where the file is there and cannot be read.
        """
        changes = []
        for line in self._lines():
            with suppress(ValidationError):  # of a later version, or cut short
                changes.append(ModelChange.model_validate_json(line))
        return changes

    def add(self, changes: list[ModelChange]) -> None:
        """Bring changes onto the disk: the old file or the new one, never a part.

        Lines that cannot be read stay. Raises OSError where that fails.
        """
        new = [change.model_dump_json().encode() for change in changes]
        kept = [*self._lines(), *new][-MOST_LINES:]
        self._path.parent.mkdir(parents=True, exist_ok=True)
        draft = self._path.with_name(f"{self._path.name}.{os.getpid()}.tmp")
        try:
            with draft.open("wb") as file:
                file.writelines(line + b"\n" for line in kept)
                file.flush()
                os.fsync(file.fileno())
            draft.replace(self._path)
        finally:
            draft.unlink(missing_ok=True)

    def _lines(self) -> list[bytes]:
        try:
            return self._path.read_bytes().splitlines()
        except FileNotFoundError:
            return []


def changes_between(
    before: Machine,
    after: Machine,
    sources: Mapping[str, str],
    axes: Collection[str],
    what: What,
    *,
    story: list[str],
    log: str | None,
    why: str | None = None,
) -> list[ModelChange]:
    """Return a line of history for each of these axes, which ran another model before."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    told = []
    for axis in axes:
        old, new = model_of(before, axis), model_of(after, axis)
        told.append(
            ModelChange(
                time_utc=now,
                axis=axis,
                what=what,
                source=sources[axis],
                added=[name for name in new["model"] if name not in old["model"]],
                removed=[name for name in old["model"] if name not in new["model"]],
                changed=sorted(_changed(old, new)),
                story=story,
                log=log,
                why=why,
            )
        )
    return told


def _changed(old: dict[str, dict[str, object]], new: dict[str, dict[str, object]]) -> set[str]:
    """Return the keys of both whose values differ; of an effect its name alone."""
    changed = set()
    for part in MODEL_KEYS:
        if not isinstance(old[part], dict):
            changed |= {part} if old[part] != new[part] else set()
            continue
        for key in old[part].keys() & new[part].keys():
            if old[part][key] != new[part][key]:
                changed.add(key if part == "model" else f"{part}.{key}")
    return changed
