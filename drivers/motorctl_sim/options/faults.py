"""Faults to order at a time, so that a test of the reaction is deterministic."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from motorctl_sim.options.settings import NonNegative, Positive, Settings

FaultKind = Literal[
    "encoder_lost",
    "encoder_stuck",
    "encoder_jump",
    "amplifier_fault",
    "communication_lost",
    "estop",
    "force_step",
]


class Fault(Settings):
    """Something that breaks at a time after `open`.

    - ``encoder_lost``: the count stands still, the status says so
    - ``encoder_stuck``: the count stands still, the status does not say so
    - ``encoder_jump``: the count jumps by `jump_m`, for good
    - ``amplifier_fault``, ``communication_lost``, ``estop``: status bit and 0 V; with the
      communication lost the count stands still too
    - ``force_step``: a force of `force_v` pushes the carriage
    """

    kind: FaultKind
    """What breaks."""
    at_s: NonNegative
    """When, after the driver was opened [s]."""
    duration_s: Positive | None = None
    """None: for good."""
    channel: int | None = Field(default=None, ge=0)
    """None: every channel."""
    jump_m: float = 0.0
    """By how much the count jumps [m]; of encoder_jump."""
    force_v: float = 0.0
    """The force that pushes [V]; of force_step."""

    @model_validator(mode="after")
    def _amount_belongs_to_its_kind(self) -> Self:
        for kind, key in (("encoder_jump", "jump_m"), ("force_step", "force_v")):
            amount = getattr(self, key)
            if self.kind == kind and not amount:
                raise ValueError(f"{kind} needs {key}")
            if self.kind != kind and amount:
                raise ValueError(f"{key} belongs to kind: {kind}, not to {self.kind}")
        if self.kind == "encoder_jump" and self.duration_s is not None:
            raise ValueError("encoder_jump is for good: it takes no duration_s")
        return self
