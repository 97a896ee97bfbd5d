"""Friction of unknown shape: a smooth function of velocity, or of position and velocity."""

from __future__ import annotations

import math
from collections.abc import Sequence

from numba import njit
from pydantic import Field

from motorctl.model.bspline import Knots, basis
from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.knowledge import Spans
from motorctl.model.parameter import Parameter

SPEED_RANGE = 300.0
"""Top speed over the speed below which velocities are told apart best. Larger spends functions on
speeds within noise, smaller draws what friction does near rest too coarsely. Chosen by hand."""
BEYOND_TOP = 1.05
"""Highest speed of the map over the recording's top speed. Nearer to 1 leaves a slightly faster
motion on the map's constant continuation, larger spends functions where nothing was recorded.
Chosen by hand."""
VELOCITY_FUNCTIONS = 24
"""Functions of the map over velocity alone. More follows noise and makes the tick longer, fewer
draws too coarsely. Chosen by hand."""
MAP_FUNCTIONS = 7
"""Functions of the map over each of position and velocity. More makes the tick longer with their
square, fewer draws too coarsely. Chosen by hand: 7 times 7 less the offset are 48 parameters, as
many as the tick should bear."""


class ResidualMapOptions(EffectOptions):
    """Where the splines' functions stand."""

    fine_velocity_m_s: float = Field(
        ge=1e-9, allow_inf_nan=False, description="speed below which velocities are told apart best"
    )
    top_velocity_m_s: float = Field(ge=1e-9, allow_inf_nan=False, description="highest speed")
    velocity_functions: int = Field(default=12, ge=5, le=32, description="functions over velocity")
    knots: Knots | None = Field(default=None, description="functions over position; none: constant")


class ResidualMap(Effect):
    """Cubic splines over asinh(v / v_fine), times splines over position."""

    name = "residual_map"
    kind = "state"
    title = "Map of what no known effect explains"
    formula = "sum of c_ij B_i(x) B_j(asinh(v / v_fine))"
    compensated = "feedforward at the desired motion"
    identified = "linear in the height of every function"
    visible_in = "motion through every speed, at every position, that is to be compensated"
    groups = frozenset({"friction"})
    Options = ResidualMapOptions
    options: ResidualMapOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Heights, the places over velocity running fastest; the last of them is the offset."""
        places = 1 if self.options.knots is None else self.options.knots[2]
        count = places * self.options.velocity_functions - 1
        return tuple(
            Parameter(f"height_{i + 1}", f"c{i + 1}", "V", -1e3, 1e3, 0.0, 1.0)
            for i in range(count)
        )

    @property
    def constants(self) -> tuple[float, ...]:
        """1/v_fine, first place and cells over asinh, functions; the same over position."""
        options = self.options
        reach = math.asinh(options.top_velocity_m_s / options.fine_velocity_m_s)
        count = float(options.velocity_functions)
        over_velocity = (1.0 / options.fine_velocity_m_s, -reach, (count - 3.0) / (2.0 * reach))
        if options.knots is None:
            return (*over_velocity, count, 0.0, 0.0, 0.0)
        low, high, places = options.knots
        return (*over_velocity, count, low, (places - 3.0) / (high - low), float(places))

    @property
    def is_spline(self) -> bool:
        """Always."""
        return True

    @classmethod
    def smooth_function(cls, variables: Sequence[str], spans: Spans) -> Effect | None:
        """Return splines over velocity, or over position and velocity."""
        options = ResidualMapOptions(
            fine_velocity_m_s=spans.speed_m_s / SPEED_RANGE,
            top_velocity_m_s=spans.speed_m_s * BEYOND_TOP,
            velocity_functions=VELOCITY_FUNCTIONS,
        )
        if set(variables) == {"velocity"}:
            return cls(options)
        if set(variables) != {"position", "velocity"}:
            return None
        over_both = {
            "knots": (*spans.position_m, MAP_FUNCTIONS),
            "velocity_functions": MAP_FUNCTIONS,
        }
        return cls(ResidualMapOptions.model_validate(options.model_dump() | over_both))

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return no form: it explains everything and names nothing."""
        return ()


@njit(error_model="numpy")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return the product of one function over velocity and one over position."""
    functions = int(c[3])
    height = basis(j % functions, math.asinh(vs * c[0]), c[1], c[2], c[3])
    if c[6] > 0.0 and height != 0.0:
        height *= basis(j // functions, x, c[4], c[5], c[6])
    return height
