"""Reaction of other axes' motion on this one: a tilting frame, a shared beam, a cable."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydantic import Field, field_validator

from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.parameter import Parameter

Array = NDArray[np.float64]


class CrossAxisOptions(EffectOptions):
    """Which axes act on this one."""

    axes: tuple[str, ...] = Field(min_length=1, description="names of the other axes")

    @field_validator("axes")
    @classmethod
    def _differ(cls, axes: tuple[str, ...]) -> tuple[str, ...]:
        if len(set(axes)) < len(axes) or not all(axes):
            raise ValueError("must be different names")
        return axes


class CrossAxis(Effect):
    """m a_other + b v_other of each other axis."""

    name = "cross_axis"
    kind = "state"
    title = "Coupling from another axis"
    formula = "sum over other axes of m * a_other + b * v_other"
    compensated = "feedforward of the other axes' motion"
    identified = "linear in the other axes' acceleration and velocity"
    visible_in = (
        "the other axis moving while this one rests or moves out of step with it; axes that "
        "always move together cannot be told apart"
    )
    groups = frozenset({"coupling"})
    Options = CrossAxisOptions
    options: CrossAxisOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Coupled mass and coupled damping of every other axis."""
        return tuple(
            parameter
            for axis in self.options.axes
            for parameter in (
                Parameter(f"acceleration_{axis}", f"m_{axis}", "V*s^2/m", -1e3, 1e3, 0.0, 0.1),
                Parameter(f"velocity_{axis}", f"b_{axis}", "V*s/m", -1e4, 1e4, 0.0, 1.0),
            )
        )

    @property
    def memory_size(self) -> int:
        """Acceleration and velocity of every other axis."""
        return 2 * len(self.options.axes)

    @property
    def other_axes(self) -> tuple[str, ...]:
        """The axes that act on this one."""
        return self.options.axes

    @property
    def picture(self) -> Picture:
        """Pull of the other axis against its acceleration."""
        return Picture("other_axis", "Pull of the other axis against its acceleration.")

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return each axis that was recorded too."""
        return [cls(CrossAxisOptions(axes=(axis,))) for axis in spans.other_axes]

    def richer(self, spans: Spans) -> Sequence[Effect]:
        """Return one axis more."""
        axes = self.options.axes
        more = [axis for axis in spans.other_axes if axis not in axes]
        return [self.with_options(axes=(*axes, axis)) for axis in more]


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, w: Array, c: tuple[float, ...]
) -> float:
    """Return what `advance` took over, in the order of the parameters."""
    return float(w[j])


@njit
def advance(
    w: Array, x: float, v: float, a: float, dt: float, others: Array, c: tuple[float, ...]
) -> None:
    """Take over acceleration and velocity of the other axes."""
    for i in range(len(others)):
        w[2 * i] = others[i, 2]
        w[2 * i + 1] = others[i, 1]
