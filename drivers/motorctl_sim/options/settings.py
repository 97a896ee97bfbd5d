"""What all option tables share: strictness, number types, tabulated profiles, harmonics."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

MAX_HARMONICS = 12

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, le=0.9)]


class Settings(BaseModel):
    """Base of every option table: unknown keys, infinities and NaN are errors."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


class MergedSettings(Settings):
    """A table that is merged with the preset's: a file need not write the keys that stay."""

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Return the schema of the table as it stands in a file: no key is required."""
        described = handler(schema)
        handler.resolve_ref_schema(described).pop("required", None)
        return described


class Profile(MergedSettings):
    """Any smooth function of position: a cubic spline through knots, constant beyond its ends."""

    position_m: tuple[float, ...] = Field(min_length=2, max_length=64)
    """Knots, increasing."""
    force_v: tuple[float, ...] = Field(min_length=2, max_length=64)
    """Value at each knot."""

    @model_validator(mode="after")
    def _increasing_and_equally_long(self) -> Self:
        if len(self.position_m) != len(self.force_v):
            raise ValueError(
                f"position_m has {len(self.position_m)} knots, force_v {len(self.force_v)}; "
                "they need one value each"
            )
        pairs = zip(self.position_m, self.position_m[1:], strict=False)
        if any(after <= before for before, after in pairs):
            raise ValueError("position_m must increase from knot to knot")
        return self


class Harmonic(Settings):
    """One harmonic of a force that repeats with a pitch: amplitude sin(2 pi order x/P + phase)."""

    order: int = Field(ge=1, le=100)
    """k: how often it repeats in a pitch."""
    amplitude_v: float
    """Its amplitude [V]."""
    phase_rad: float = 0.0
    """Its phase at x = 0 [rad]."""


class RelativeHarmonic(Settings):
    """One harmonic of a relative change: amplitude sin(2 pi order x/P + phase)."""

    order: int = Field(ge=1, le=100)
    """k: how often it repeats in a pitch."""
    amplitude: float = Field(ge=-0.5, le=0.5)
    """Share of the thrust."""
    phase_rad: float = 0.0
    """Its phase at x = 0 [rad]."""
