"""What can go wrong in front of a user: one clear message each, and the exit status it means."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


class MotorctlError(Exception):
    """Base of every error that is told to the user without a traceback."""

    exit_status = 1


class UsageError(MotorctlError):
    """A command was used in a way that cannot work."""

    exit_status = 2


class DataError(MotorctlError):
    """A recording or a file cannot be used as it is."""

    exit_status = 2


class RunError(MotorctlError):
    """Something failed while running."""

    exit_status = 1


@dataclass(frozen=True)
class Problem:
    """One thing wrong in a configuration: where it stands, what is there, what would be right."""

    file: str
    line: int | None
    key: str
    message: str

    def __str__(self) -> str:
        where = self.file if self.line is None else f"{self.file}:{self.line}"
        return f"{where}: {self.key}: {self.message}" if self.key else f"{where}: {self.message}"


class ConfigError(MotorctlError):
    """A configuration has one or more problems; all of them are told at once."""

    exit_status = 2

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(p) for p in self.problems))
