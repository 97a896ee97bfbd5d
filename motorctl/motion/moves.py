"""A list of point-to-point moves, each with limits and a dwell of its own."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator

from motorctl.motion.move import point_to_point
from motorctl.motion.program import LEAST, Cycles, OneAxisProgram, check_cycles
from motorctl.motion.segments import rest_segment
from motorctl.motion.trajectory import JOINT_TOLERANCE, Trajectory

# Strict: of numbers within a list only the pydantic model says that text is none.
StrictCoordinate = Annotated[float, Field(ge=-1e6, le=1e6, strict=True)]
StrictPositive = Annotated[float, Field(gt=LEAST, le=1e9, strict=True)]
Duration = Annotated[float, Field(ge=0, le=1e6, strict=True)]

# Seven phases and a dwell.
SEGMENTS_A_MOVE = 8
# Shorter dwells are none: far below a tick, and above where powers of times vanish.
NEGLIGIBLE_S = 1e-9


class Move(BaseModel):
    """One move to rest at `target_m`, as fast as its limits allow, and the rest after it."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    target_m: StrictCoordinate = Field(description="position at its end, at rest")
    max_velocity_m_s: StrictPositive = Field(description="speed that is not exceeded")
    max_acceleration_m_s2: StrictPositive = Field(description="acceleration that is not exceeded")
    max_jerk_m_s3: StrictPositive = Field(description="jerk that is not exceeded")
    dwell_s: Duration = Field(default=0.0, description="rest after it")


class Moves(OneAxisProgram):
    """Moves from rest to rest, one after the other; repeated only where they end at `start_m`."""

    kind: Literal["moves"] = Field(
        default="moves", description="a list of jerk-limited moves with dwells"
    )
    start_m: StrictCoordinate = Field(description="position at its begin, at rest")
    moves: tuple[Move, ...] = Field(description="one after the other")
    cycles: Cycles = Field(
        default=1, validate_default=True, description="how many times the list is repeated"
    )

    @field_validator("moves")
    @classmethod
    def _moves(cls, moves: tuple[Move, ...]) -> tuple[Move, ...]:
        # Not by min_length, which would complain again wherever a single move is wrong.
        if not moves:
            raise ValueError("must have at least one move")
        return moves

    @field_validator("cycles")
    @classmethod
    def _can_be_repeated(cls, cycles: int, info: ValidationInfo) -> int:
        if "moves" not in info.data or "start_m" not in info.data:  # told of already
            return cycles
        start_m, moves = info.data["start_m"], info.data["moves"]
        check_cycles(cycles, SEGMENTS_A_MOVE * len(moves))
        end_m = moves[-1].target_m
        if cycles > 1 and abs(end_m - start_m) > JOINT_TOLERANCE[0]:
            raise ValueError(
                f"the moves end at {end_m:.9g} m but start at {start_m:.9g} m, so they cannot be "
                "repeated"
            )
        return cycles

    @property
    def period_s(self) -> float | None:
        """The duration of all moves, where they are repeated."""
        return self._one_cycle().duration_s if self.cycles > 1 else None

    def trajectories(self) -> dict[str, Trajectory]:
        """Plan all moves of all cycles."""
        return {self.axis: self._one_cycle().repeat(self.cycles)}

    def _one_cycle(self) -> Trajectory:
        stops_m = [self.start_m, *(move.target_m for move in self.moves)]
        parts = []
        for (start_m, target_m), move in zip(pairwise(stops_m), self.moves, strict=True):
            plan = point_to_point(
                start_m,
                target_m,
                move.max_velocity_m_s,
                move.max_acceleration_m_s2,
                move.max_jerk_m_s3,
            )
            parts.append(plan.segments)
            if move.dwell_s > NEGLIGIBLE_S:
                parts.append(rest_segment(target_m, move.dwell_s))
        segments = np.concatenate(parts)
        # A move to where the axis stands leaves nothing to play.
        lasting = segments[segments["duration_s"] > 0]
        return Trajectory(lasting if len(lasting) else segments[:1])
