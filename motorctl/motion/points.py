"""Motion through recorded points of one or more axes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PrivateAttr, ValidationInfo, field_validator

from motorctl.errors import ConfigError
from motorctl.motion.fit import fit_points
from motorctl.motion.program import Cycles, Positive, ProgramModel, check_cycles
from motorctl.motion.table import PointTable, read_points
from motorctl.motion.trajectory import JOINT_TOLERANCE, Trajectory


class Points(ProgramModel):
    """Follow the columns ``time_s`` and ``<axis>_m`` of a CSV file.

    The points must start and end at rest. Otherwise `ease_s` adds a lead-in from rest and a
    lead-out to rest of that duration, outside the points.
    """

    kind: Literal["points"] = Field(default="points", description="recorded points from a CSV file")
    axes: Annotated[tuple[str, ...], Field(min_length=1)] = Field(
        description="names of the axes that it moves"
    )
    file: Path = Field(
        description="CSV with time_s and <axis>_m; from the folder of the file that names it"
    )
    ease_s: Positive | None = Field(
        default=None,
        description="lead-in from rest and lead-out to rest of this duration, outside the points",
    )
    cycles: Cycles = Field(default=1, description="how many times it is repeated")
    _one_cycle: dict[str, Trajectory] = PrivateAttr(default_factory=dict)

    @field_validator("axes")
    @classmethod
    def _distinct(cls, axes: tuple[str, ...]) -> tuple[str, ...]:
        if len(set(axes)) != len(axes):
            raise ValueError("names an axis twice")
        return axes

    @field_validator("file")
    @classmethod
    def _found_from_directory(cls, file: Path, info: ValidationInfo) -> Path:
        directory: Path = (info.context or {}).get("directory", Path())
        return directory / file

    def model_post_init(self, context: object) -> None:
        """Read the points and fit them; raises ConfigError with file, line and column."""
        table = read_points(self.file, self.axes)
        for axis in self.axes:
            cycle = fit_points(table, axis, self.ease_s)
            self._check_repetition(cycle, table, axis)
            self._one_cycle[axis] = cycle

    @property
    def period_s(self) -> float | None:
        """The duration of the points, where they are repeated."""
        return self._one_cycle[self.axes[0]].duration_s if self.cycles > 1 else None

    def trajectories(self) -> dict[str, Trajectory]:
        """Make all cycles."""
        return {axis: cycle.repeat(self.cycles) for axis, cycle in self._one_cycle.items()}

    def _check_repetition(self, cycle: Trajectory, table: PointTable, axis: str) -> None:
        start, end = cycle.start_m, cycle.end_m
        if self.cycles > 1 and abs(end - start) > JOINT_TOLERANCE[0]:
            message = f"ends at {end:.9g} m but starts at {start:.9g} m, so it cannot be repeated"
            raise ConfigError([table.problem(table.last_line, axis, message)])
        try:
            check_cycles(self.cycles, len(cycle.segments))
        except ValueError as error:
            raise ConfigError([table.problem(None, axis, str(error))]) from error
