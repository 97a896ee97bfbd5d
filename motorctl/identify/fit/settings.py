"""How a recording is filtered and regressed: the choices of `fit`, as plain data."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import yaml
from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from motorctl.errors import DataError, UsageError
from motorctl.identify.columns.filters import Derivative, FilterKind

SETTINGS_FOLDER = Path(__file__).parent / "shipped"

Side = Literal["acceleration", "command"]
Estimator = Literal["least_squares", "instruments"]


def _ascending(span: tuple[float, float]) -> tuple[float, float]:
    if not span[0] < span[1]:
        raise ValueError("the end must lie after the beginning")
    return span


Segment = Annotated[tuple[float, float], AfterValidator(_ascending)]
PositiveFloat = Annotated[float, Field(gt=0)]


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class FitOptions:
    """Every choice of the identification; None is chosen from the recording and stated.

    The defaults are: one zero-phase low pass over all columns after the nonlinear terms are
    formed, the zero-order hold aligned, the input delay estimated, the acceleration on the left,
    and instruments where there is a reference.
    """

    filter_target: Literal["columns", "position"] = "columns"
    """Filter every column alike, or the position before it is differentiated."""
    filter_kind: FilterKind = "butterworth"
    filter_order: Annotated[int, Field(ge=1, le=12)] = 4
    filter_hz: PositiveFloat | None = None
    zero_phase: bool = True
    """Filter forward and backward; else forward only (all columns alike)."""
    derivative: Derivative = "second_difference"
    discard_start: Annotated[int, Field(ge=0)] | None = None
    """Samples dropped at the start, where the filter has not settled."""
    discard_end: Annotated[int, Field(ge=0)] | None = None
    """Where only one of the two is given, the other is zero."""
    decimation: Annotated[int, Field(ge=1)] | None = None
    """Keep every so many samples."""
    decimation_order: Annotated[int, Field(ge=0, le=12)] = 0
    """Order of the Chebyshev low pass before decimation; 0: the first filter is enough."""
    left: Side = "acceleration"
    """Which column the others are regressed on by least squares."""
    estimator: Estimator | Literal["auto"] = "auto"
    """Where the values come from; auto: instruments built from the reference, which an undeclared
    effect biases least, where there is one that excites every parameter; else, or with the command
    on the left, least squares."""
    hold_alignment: bool = True
    coulomb_slope_s_m: PositiveFloat | None = None
    """Overrides the slope of every friction's sign function; infinite: sign(v)."""
    friction_velocity: Literal["auto", "reference", "measured"] = "auto"
    """Whose sign friction takes: the measured velocity, smoothed, is closest to the truth; auto
    takes the reference's where the two differ by measurement noise alone."""
    friction_hz: PositiveFloat | None = None
    """Band of that velocity: by default as wide as noise allows beside the slope at rest."""
    rest_velocity: Annotated[float, Field(ge=0)] | None = None
    """Rows slower than this are left out, for friction at rest is not a function of velocity; by
    default, where Sf reaches 0.87, but no more than a twentieth of the top speed."""
    estimate_delay: bool = True
    input_delay_s: float = 0.0
    """The delay that is taken where none is estimated; positive: the command acts later."""
    delay_range_s: Segment | None = None
    """Where the delay is sought; by default from three samples early to 5 ms late."""
    fit_segments: tuple[Segment, ...] | None = None
    """Spans of time_s that are fitted; None: those of the recording, else all of it."""
    held_out_segments: tuple[Segment, ...] | None = None

    def with_changes(self, **changes: object) -> FitOptions:
        """Give a checked copy; raises UsageError where a value is out of range."""
        merged = {name: getattr(self, name) for name in self.__dataclass_fields__} | changes
        return _checked(merged, "options of fit")

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
        return replace(
            self,
            filter_hz=self.filter_hz or filter_hz,
            decimation=self.decimation or decimation,
            discard_start=start or 0,
            discard_end=end or 0,
            friction_velocity=friction_velocity,
            friction_hz=self.friction_hz or friction_hz,
            rest_velocity=rest_velocity if self.rest_velocity is None else self.rest_velocity,
        )


_ADAPTER = TypeAdapter(FitOptions)


def shipped_settings() -> tuple[str, ...]:
    """Name the settings that come with motorctl."""
    return tuple(sorted(path.stem for path in SETTINGS_FOLDER.glob("*.yaml")))


def load_settings(name_or_path: str) -> FitOptions:
    """Read options from a YAML file, or from the settings of that name that motorctl brings.

    Raises UsageError where there are none, DataError where they cannot be used.
    """
    path = Path(name_or_path)
    if name_or_path in shipped_settings():
        path = SETTINGS_FOLDER / f"{name_or_path}.yaml"
    elif not path.is_file():
        known = ", ".join(shipped_settings())
        raise UsageError(f"no settings '{name_or_path}': neither a file nor one of {known}")
    try:
        content = yaml.safe_load(path.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise DataError(f"{path}: cannot be read as YAML: {error}") from error
    if not isinstance(content, dict):
        raise DataError(f"{path}: expected a table of options, found {type(content).__name__}")
    return _checked(content, str(path))


def _checked(values: dict[str, object], where: str) -> FitOptions:
    try:
        return _ADAPTER.validate_python(values)
    except ValidationError as error:
        lines = [
            f"{where}: {'.'.join(str(part) for part in item['loc']) or 'options'}: "
            f"{item['msg']} (found {item['input']!r})"
            for item in error.errors()
        ]
        raise UsageError("\n".join(lines)) from error
