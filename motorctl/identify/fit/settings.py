"""How a recording is filtered and regressed: the choices of `fit`, as plain data."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from motorctl.config.validation import suggest, validate
from motorctl.errors import UsageError
from motorctl.identify.columns.filters import Derivative, FilterKind
from motorctl.identify.columns.left_side import Side
from motorctl.located_yaml import read_document

SETTINGS_FOLDER = Path(__file__).parent / "shipped"
"""Here ``default.yaml`` says what every key means."""

Estimator = Literal["least_squares", "instruments"]


def _ascending(span: tuple[float, float]) -> tuple[float, float]:
    if not span[0] < span[1]:
        raise ValueError("the end must lie after the beginning")
    return span


Segment = Annotated[tuple[float, float], AfterValidator(_ascending)]
PositiveFloat = Annotated[float, Field(gt=0)]


class FitOptions(BaseModel):
    """Every choice of the identification; None is chosen from the recording and stated.

    ``shipped/default.yaml`` has the same defaults, and says of each key what it means.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    filter_target: Literal["columns", "position"] = "columns"
    filter_kind: FilterKind = "butterworth"
    filter_order: Annotated[int, Field(ge=1, le=12)] = 4
    filter_hz: PositiveFloat | None = None
    zero_phase: bool = True
    derivative: Derivative = "second_difference"
    discard_start: Annotated[int, Field(ge=0)] | None = None
    discard_end: Annotated[int, Field(ge=0)] | None = None
    decimation: Annotated[int, Field(ge=1)] | None = None
    decimation_order: Annotated[int, Field(ge=0, le=12)] = 0
    left: Side = "acceleration"
    estimator: Estimator | Literal["auto"] = "auto"
    hold_alignment: bool = True
    coulomb_slope_s_m: PositiveFloat | None = None
    friction_velocity: Literal["auto", "reference", "measured"] = "auto"
    friction_hz: PositiveFloat | None = None
    rest_velocity: Annotated[float, Field(ge=0)] | None = None
    estimate_delay: bool = True
    input_delay_s: float = 0.0
    delay_range_s: Segment | None = None
    fit_segments: tuple[Segment, ...] | None = None
    held_out_segments: tuple[Segment, ...] | None = None

    def with_changes(self, **changes: object) -> FitOptions:
        """Return a checked copy. Raises UsageError where a value is out of range."""
        try:
            return FitOptions.model_validate(self.model_dump() | changes)
        except ValidationError as error:
            wrong = error.errors()[0]
            key = ".".join(str(part) for part in wrong["loc"])
            message = f"options of fit: {key}: {wrong['msg']} (found {wrong['input']!r})"
            raise UsageError(message) from error

    def resolved(
        self,
        filter_hz: float,
        decimation: int,
        discard: int,
        friction_velocity: Literal["reference", "measured"],
        friction_hz: float,
        rest_velocity: float,
    ) -> FitOptions:
        """Fill in what was left open."""
        start, end = self.discard_start, self.discard_end
        if start is None and end is None:
            start = end = discard
        return self.with_changes(
            filter_hz=self.filter_hz or filter_hz,
            decimation=self.decimation or decimation,
            discard_start=start or 0,
            discard_end=end or 0,
            friction_velocity=friction_velocity,
            friction_hz=self.friction_hz or friction_hz,
            rest_velocity=rest_velocity if self.rest_velocity is None else self.rest_velocity,
        )


def shipped_settings() -> tuple[str, ...]:
    """Return the names of the settings that come with motorctl."""
    return tuple(sorted(path.stem for path in SETTINGS_FOLDER.glob("*.yaml")))


def load_settings(name_or_path: str) -> FitOptions:
    """Return the options of a YAML file, or of the settings of that name that motorctl brings.

    Raises
    ------
    UsageError
        Where there is neither such a file nor such a name.
    ConfigError
        With file, line and key of everything in the file that cannot be used.
    """
    path, known = Path(name_or_path), shipped_settings()
    if name_or_path in known:
        path = SETTINGS_FOLDER / f"{name_or_path}.yaml"
    elif not path.exists():
        hint = suggest(name_or_path, known)
        raise UsageError(
            f"--settings {name_or_path}: there is no such file, and no such name; {hint}"
        )
    document = read_document(path, such_as="filter_hz: 80")
    options, problems = validate(document, (), FitOptions, document.data)
    document.refuse(problems)
    assert options is not None
    return options
