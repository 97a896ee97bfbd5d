"""The faults that a file may order, and what belongs to each of them."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

FaultKind = Literal[
    "delay",
    "jitter",
    "loss",
    "duplicates",
    "reordering",
    "bit_errors",
    "wrong_length",
    "wrong_sequence",
    "babbling",
    "silence",
    "unplug",
    "reset",
    "counter_wrap",
    "counter_jump",
    "amplifier_fault",
    "encoder_lost",
    "drive_silent",
]
Way = Literal["from_device", "to_device", "both"]

# Which keys each kind takes beside kind, at_s and duration_s; those with a star it needs.
_HOW_OFTEN = ("share", "every", "way")
KEYS: dict[str, tuple[str, ...]] = {
    "delay": ("amount_s*", "way"),
    "jitter": ("amount_s*", "way"),
    "loss": _HOW_OFTEN,
    "duplicates": _HOW_OFTEN,
    "reordering": _HOW_OFTEN,
    "bit_errors": (*_HOW_OFTEN, "byte_share"),
    "wrong_length": _HOW_OFTEN,
    "wrong_sequence": ("sequence", "share", "every"),
    "babbling": ("rate_hz*",),
    "silence": ("way",),
    "unplug": (),
    "reset": (),
    "counter_wrap": ("counts*", "channel"),
    "counter_jump": ("counts*", "channel"),
    "amplifier_fault": ("channel",),
    "encoder_lost": ("channel",),
    "drive_silent": ("channel*",),
}
NEEDS_DURATION = ("unplug", "reset")


class Settings(BaseModel):
    """Base: unknown keys are errors, text is no number, every number is finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class FaultOrder(Settings):
    """One fault: what, from when, for how long, how much."""

    kind: FaultKind
    at_s: Annotated[float, Field(ge=0, le=1e6)] | None = Field(
        default=None, description="seconds after the first command that enables an axis"
    )
    duration_s: Annotated[float, Field(gt=0, le=1e6)] | None = Field(
        default=None, description="null: for good"
    )
    amount_s: Annotated[float, Field(gt=0, le=10)] | None = None
    share: Annotated[float, Field(gt=0, le=1)] | None = Field(
        default=None, description="share of the messages that are hit"
    )
    every: Annotated[int, Field(ge=1, le=10**9)] | None = Field(
        default=None, description="hit every nth message"
    )
    byte_share: Annotated[float, Field(gt=0, le=1)] | None = Field(
        default=None, description="share of the bytes that get a wrong bit"
    )
    rate_hz: Annotated[float, Field(gt=0, le=1e5)] | None = None
    counts: Annotated[int, Field(ge=-(2**62), le=2**62)] | None = None
    channel: Annotated[int, Field(ge=0, le=1023)] | None = Field(
        default=None, description="null: every channel"
    )
    sequence: Literal["stuck", "random"] = "stuck"
    way: Way | None = None

    @model_validator(mode="after")
    def _keys_belong_to_the_kind(self) -> Self:
        takes = {key.rstrip("*"): key.endswith("*") for key in KEYS[self.kind]}
        for key in ("amount_s", "share", "every", "byte_share", "rate_hz", "counts", "channel"):
            given = getattr(self, key) is not None
            if given and key not in takes:
                raise ValueError(f"{self.kind} takes no {key}")
            if not given and takes.get(key):
                raise ValueError(f"{self.kind} needs {key}")
        if "way" not in takes and self.way is not None:
            raise ValueError(f"{self.kind} takes no way")
        if "sequence" not in takes and "sequence" in self.model_fields_set:
            raise ValueError(f"{self.kind} takes no sequence")
        often = [key for key in _HOW_MUCH if getattr(self, key) is not None]
        if len(often) > 1:
            raise ValueError(f"give one of {' and '.join(often)}, not both")
        if self.kind == "counter_wrap":
            if self.at_s is not None or self.duration_s is not None:
                raise ValueError("counter_wrap is there from the start: no at_s, no duration_s")
        elif self.at_s is None:
            raise ValueError(f"{self.kind} needs at_s")
        if self.kind in NEEDS_DURATION and self.duration_s is None:
            raise ValueError(f"{self.kind} needs duration_s")
        return self

    def goes(self, way: Literal["from_device", "to_device"]) -> bool:
        """Tell whether messages of this direction are hit."""
        usual: Way = "both" if self.kind == "silence" else "from_device"
        return (self.way or usual) in (way, "both")


_HOW_MUCH = ("share", "every", "byte_share")
