"""The YAML file that describes a foreign recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    ValidationError,
    model_validator,
)
from pydantic_core import ErrorDetails

from motorctl.axis_units import PositionUnit
from motorctl.errors import ConfigError, DataError, Problem
from motorctl.located_yaml import Document, read_document
from motorctl.log.recording import ForcePerCommand
from motorctl.log.units import (
    COMMAND_UNITS,
    FORCE_UNITS,
    POSITION_UNITS,
    TIME_UNITS,
    VELOCITY_UNITS,
    CommandUnit,
    usual_spelling,
)


def _unit(known: tuple[str, ...]) -> AfterValidator:
    def check(unit: str) -> str:
        usual = usual_spelling(unit)
        if usual not in known:
            raise ValueError(f"unknown unit; known: {', '.join(known)}")
        return usual

    return AfterValidator(check)


Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


def _turns_something(scale: float) -> float:
    if scale == 0.0:
        raise ValueError("must not be 0: it multiplies the column")
    return scale


Scale = Annotated[FiniteFloat, AfterValidator(_turns_something)]
"""What a column is multiplied by: -1 turns its sign. `late_s` is how much later than it happened a
column was recorded [s]."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class TimeColumn(_Part):
    """A column of times."""

    column: str
    unit: Annotated[str, _unit(tuple(TIME_UNITS))] = "s"
    scale: Positive = 1.0
    """How many units one number of the column is: the ticks of a clock."""

    @property
    def seconds(self) -> float:
        """What one number of the column is in seconds."""
        return self.scale * TIME_UNITS[self.unit]


class _Signal(_Part):
    column: str
    file: str | None = None
    """Relative to the description, where the column stands in another file than the first."""
    scale: Scale = 1.0
    late_s: FiniteFloat = 0.0


class PositionColumn(_Signal):
    """A column of positions; counts need a resolution."""

    unit: Annotated[str, _unit((*POSITION_UNITS, "count"))]
    resolution: Positive | None = None
    """One count, in `resolution_unit`."""
    resolution_unit: Annotated[str, _unit(tuple(POSITION_UNITS))] = "m"
    period: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    """After how many of its units the column begins anew; 0: it does not; None: it is found."""

    @model_validator(mode="before")
    @classmethod
    def _spellings(cls, data: Any) -> Any:
        """Take resolution_m, resolution_rad and resolution: {value, unit} as well."""
        if not isinstance(data, dict):
            return data
        data = dict(data)
        for unit in ("m", "rad"):
            if f"resolution_{unit}" in data and "resolution" not in data:
                data["resolution"] = data.pop(f"resolution_{unit}")
                data["resolution_unit"] = unit
        if isinstance(value := data.get("resolution"), dict) and set(value) == {"value", "unit"}:
            data |= {"resolution": value["value"], "resolution_unit": value["unit"]}
        return data

    @model_validator(mode="after")
    def _counts_need_a_resolution(self) -> PositionColumn:
        if self.unit == "count" and self.resolution is None:
            raise ValueError("unit count needs resolution: one count in m (or resolution_rad)")
        return self

    @property
    def factor(self) -> float:
        """What one unit of the column is in `base_unit`."""
        if self.unit == "count":
            assert self.resolution is not None
            return self.scale * self.resolution * POSITION_UNITS[self.resolution_unit][0]
        return self.scale * POSITION_UNITS[self.unit][0]

    @property
    def base_unit(self) -> PositionUnit:
        """Metres or radians."""
        return POSITION_UNITS[self.resolution_unit if self.unit == "count" else self.unit][1]

    @property
    def count(self) -> float | None:
        """One count of the encoder in `base_unit`, where it is told."""
        if self.resolution is None:
            return None
        return abs(self.scale) * self.resolution * POSITION_UNITS[self.resolution_unit][0]


class VelocityColumn(_Signal):
    """A column of velocities, for an axis whose position was not recorded."""

    unit: Annotated[str, _unit(tuple(VELOCITY_UNITS))]

    @property
    def factor(self) -> float:
        """What one unit of the column is in `base_unit` per second."""
        return self.scale * VELOCITY_UNITS[self.unit][0]

    @property
    def base_unit(self) -> PositionUnit:
        """Metres or radians."""
        return VELOCITY_UNITS[self.unit][1]


class CommandColumn(_Signal):
    """A column of commands."""

    unit: Annotated[str, _unit(tuple(COMMAND_UNITS))]

    @property
    def factor(self) -> float:
        """What one unit of the column is in `base_unit`."""
        return self.scale * COMMAND_UNITS[self.unit][0]

    @property
    def base_unit(self) -> CommandUnit:
        """V, A, N, N*m or %."""
        return COMMAND_UNITS[self.unit][1]


class Force(_Part):
    """The motor's force for one unit of the command."""

    value: FiniteFloat
    unit: Annotated[str, _unit(FORCE_UNITS)]

    @property
    def known(self) -> ForcePerCommand:
        """The same as the recording carries it."""
        return ForcePerCommand(self.value, self.unit)


class AxisDescription(_Part):
    """Where an axis' signals stand: its position, or where there is none its velocity."""

    position: PositionColumn | None = None
    velocity: VelocityColumn | None = None
    command: CommandColumn
    reference: PositionColumn | None = None
    force_per_command: Force | None = None

    @model_validator(mode="after")
    def _units_agree(self) -> AxisDescription:
        if self.position and self.velocity:
            raise ValueError(
                "has a position and a velocity: leave out the velocity, which is found from the "
                "position"
            )
        if self.position is None and self.velocity is None:
            raise ValueError(
                "needs position: {column, unit}, or where it was not recorded "
                "velocity: {column, unit}"
            )
        if self.reference and self.reference.base_unit != self.motion.base_unit:
            raise ValueError(
                f"the reference is in {self.reference.base_unit}, "
                f"but the position in {self.motion.base_unit}"
            )
        force = self.force_per_command
        if force and (force.value == 0 or force.unit.partition("/")[2] != self.command.base_unit):
            raise ValueError(
                f"force_per_command is {force.value:g} {force.unit}; "
                f"should be a number other than 0 per {self.command.base_unit}, "
                "the command's unit"
            )
        return self

    @property
    def motion(self) -> PositionColumn | VelocityColumn:
        """The column that tells the motion."""
        found = self.position or self.velocity
        assert found is not None
        return found

    @property
    def signals(self) -> dict[str, PositionColumn | VelocityColumn | CommandColumn]:
        """Each signal that is described."""
        names = ("position", "velocity", "command", "reference")
        return {name: told for name in names if (told := getattr(self, name)) is not None}

    @property
    def columns(self) -> dict[str, str]:
        """The column of each signal that is described."""
        return {name: told.column for name, told in self.signals.items()}


Span = tuple[FiniteFloat, FiniteFloat]


class Segments(_Part):
    """Begin and end [s] of what is for fitting and what is for testing."""

    fit: Span | None = None
    held_out: Span | None = None

    @model_validator(mode="after")
    def _are_apart(self) -> Segments:
        for begin, end in self.given.values():
            if not begin < end:
                raise ValueError(f"[{begin:g}, {end:g}] s: the end must come after the begin")
        if (
            self.fit
            and self.held_out
            and max(self.fit[0], self.held_out[0]) < min(self.fit[1], self.held_out[1])
        ):
            raise ValueError("fit and held_out overlap; they must be separate")
        return self

    @property
    def given(self) -> dict[Literal["fit", "held_out"], tuple[float, float]]:
        """The segments that are there."""
        found: dict[Literal["fit", "held_out"], tuple[float, float]] = {}
        if self.fit:
            found["fit"] = self.fit
        if self.held_out:
            found["held_out"] = self.held_out
        return found


class Description(_Part):
    """A whole description."""

    file: str
    """Relative to the description."""
    header_line: Annotated[int, Field(ge=1)] | None = None
    """The line of `file`, a text, that has the names of its columns, from 1; None: it is found."""
    sample_rate_hz: Positive | None = None
    time: TimeColumn | None = None
    axes: dict[str, AxisDescription] = Field(min_length=1)
    segments: Segments = Segments()

    @model_validator(mode="after")
    def _one_clock(self) -> Description:
        if (self.sample_rate_hz is None) == (self.time is None):
            raise ValueError("needs either sample_rate_hz or time: {column, unit}")
        return self


def read_description(path: Path) -> Description:
    """Read a description of a foreign recording.

    Raises
    ------
    DataError
        With all problems, each with file, line and key.
    """
    try:
        document = read_document(path, such_as="file: measurement.mat", as_text=True)
        problems: list[Problem] = []
        try:
            description = Description.model_validate(document.data)
        except ValidationError as error:
            problems = [_told(document, problem) for problem in error.errors()]
        document.refuse(problems)
    except ConfigError as error:
        raise DataError(str(error)) from error
    return description


def _told(document: Document, problem: ErrorDetails) -> Problem:
    path = tuple(problem["loc"])
    if problem["type"] == "missing":
        return document.problem(path, "is missing")
    if problem["type"] == "extra_forbidden":
        return document.problem(path, "unknown key")
    message = problem["msg"].removeprefix("Value error, ")
    value = problem["input"]
    told = "" if isinstance(value, dict) else f" (it is {value!r})"
    return document.problem(path, message + told)
