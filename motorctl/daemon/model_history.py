"""Which models a machine ran, and why: a line for each change, kept from run to run."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from motorctl.config.machine import Machine
from motorctl.config.model_keys import MODEL_KEYS, axes_with_other_models, model_of
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
        """Return every change that can be read, oldest first; damaged lines are left out."""
        try:
            lines = self._path.read_bytes().splitlines()
        except OSError:
            return []
        changes = []
        for line in lines:
            try:
                changes.append(ModelChange.model_validate_json(line))
            except ValidationError:
                continue  # cut short by a computer that died
        return changes

    def add(self, changes: list[ModelChange]) -> None:
        """Bring changes onto the disk: the old file or the new one, never a part.

        Raises OSError where that fails.
        """
        kept = [*self.read(), *changes][-MOST_LINES:]
        self._path.parent.mkdir(parents=True, exist_ok=True)
        draft = self._path.with_name(f"{self._path.name}.{os.getpid()}.tmp")
        try:
            with draft.open("w", encoding="utf-8") as file:
                file.writelines(f"{change.model_dump_json()}\n" for change in kept)
                file.flush()
                os.fsync(file.fileno())
            draft.replace(self._path)
        finally:
            draft.unlink(missing_ok=True)


def changes_between(
    before: Machine,
    after: Machine,
    what: What,
    *,
    source: str,
    story: list[str],
    log: str | None,
    why: str | None = None,
) -> list[ModelChange]:
    """Return a line of history for each axis that runs another model afterwards."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    told = []
    for axis in axes_with_other_models(before, after):
        old, new = model_of(before, axis), model_of(after, axis)
        told.append(
            ModelChange(
                time_utc=now,
                axis=axis,
                what=what,
                source=source,
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
