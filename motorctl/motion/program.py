"""What a program is: a named motion of one or more axes, frozen before anything moves."""

from __future__ import annotations

from typing import Annotated, Protocol, runtime_checkable

from pydantic import BaseModel, ConfigDict, Field

from motorctl.motion.segments import MOST_SEGMENTS
from motorctl.motion.trajectory import Trajectory

# Beyond any machine, and far from where floating-point powers of them overflow or vanish.
LEAST = 1e-9
"""What limits of a motion have to be above, in any of their units: slower is no motion. By hand."""
Positive = Annotated[float, Field(gt=LEAST, le=1e9)]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Cycles = Annotated[int, Field(ge=1)]


@runtime_checkable
class Program(Protocol):
    """A motion that starts and ends at rest."""

    @property
    def name(self) -> str:
        """Its name in the configuration, or its file's."""

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that it moves, all started in the same tick."""

    @property
    def cycles(self) -> int:
        """How many times the motion is repeated."""

    @property
    def period_s(self) -> float | None:
        """Duration of one cycle where the motion is periodic."""

    def trajectories(self) -> dict[str, Trajectory]:
        """Make the whole motion of each axis, every cycle of it, all of the same duration."""


class ProgramModel(BaseModel):
    """Base of the kinds of programs that YAML can describe; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    name: str = Field(description="its key in the configuration, or its file's name")


def check_cycles(cycles: int, segments: int) -> None:
    """Raise ValueError where `cycles` of that many segments are more than a table may have."""
    if cycles * segments > MOST_SEGMENTS:
        raise ValueError(
            f"{cycles} cycles of {segments} segments are more than the {MOST_SEGMENTS} segments "
            "that a program may have; use fewer cycles"
        )


class OneAxisProgram(ProgramModel):
    """Base of the kinds that move a single axis."""

    axis: str = Field(description="name of the axis that it moves")

    @property
    def axes(self) -> tuple[str, ...]:
        """The one axis."""
        return (self.axis,)
