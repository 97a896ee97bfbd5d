"""Choices that several commands offer."""

from enum import StrEnum


class ControllerChoice(StrEnum):
    """The law with (C2) or without (C1) the electromagnetic effects."""

    C1 = "C1"
    C2 = "C2"
