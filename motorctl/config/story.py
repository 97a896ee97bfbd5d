"""What a configuration's head says of how its models were found."""

from __future__ import annotations

from pathlib import Path

LINES, CHARACTERS = 100, 400
"""As much of it as a daemon keeps with the history of models."""


def story_of(source: Path) -> list[str]:
    """Return the comment at the head of a configuration, line by line."""
    story = []
    for line in source.read_text(encoding="utf-8-sig").splitlines():
        if not line.startswith("#"):
            break
        told = line.removeprefix("#").strip()
        if told and not told.startswith("yaml-language-server"):
            story.append(told[:CHARACTERS])
    return story[:LINES]
