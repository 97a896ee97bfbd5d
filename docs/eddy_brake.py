"""An effect of one's own, complete: as a file in motorctl/model/effects/ every tool knows it.

From a package of its own it is found by its entry point in the group `motorctl.effects`:

    [project.entry-points."motorctl.effects"]
    eddy_brake = "eddy_brake:EddyBrake"

and checked by the suite that every effect passes:

    pytest -p motorctl.model.conformance --pyargs motorctl.model.conformance \\
        --effect eddy_brake:EddyBrake --effect-options '{"peak_velocity_m_s": 0.5}'
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numba import njit
from pydantic import Field

from motorctl.model import Effect, EffectOptions, Parameter, Picture, Spans


class EddyBrakeOptions(EffectOptions):
    """The nonlinear parameter, fixed while running."""

    peak_velocity_m_s: float = Field(default=0.5, gt=0, description="where it brakes most")


class EddyBrake(Effect):
    """Eddy currents brake the carriage, most of all at v_0."""

    name = "eddy_brake"
    kind = "state"
    title = "Eddy-current brake"
    formula = "c * v / (1 + (v/v_0)^2)"
    compensated = "feedforward at the desired velocity"
    identified = "linear in c; the velocity v_0 by a scan"
    visible_in = "travel at several speeds below and above v_0"
    groups = frozenset({"friction"})  # it opposes the motion: what may be taken for it, sums of it
    revealed_by = ("two_speeds",)  # the motion that `diagnose` proposes to tell it from others
    Options = EddyBrakeOptions
    options: EddyBrakeOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """c: name, symbol, unit, widest bounds, start value, covariance."""
        return (Parameter("", "c", "V*s/m", 0.0, 1e3, 0.0, 1.0),)

    @property
    def constants(self) -> tuple[float, ...]:
        """1/v_0 [s/m], which the kernel gets as c."""
        return (1.0 / self.options.peak_velocity_m_s,)

    @property
    def picture(self) -> Picture:
        """How the report draws it: against velocity, and close by around v_0."""
        return Picture(
            "friction_over_velocity",
            "Friction against velocity, with the brake and without.",
            scale=self.options.peak_velocity_m_s,
        )

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return the forms that diagnosis tries first: v_0 from a twentieth of the top speed on.

        None where the recording cannot show the effect: it may be one of an axis that stood still.
        """
        if not spans.speed_m_s > 0.0:
            return ()
        speeds = spans.speed_m_s * np.geomspace(0.05, 2.0, 20)
        return [cls(EddyBrakeOptions(peak_velocity_m_s=float(speed))) for speed in speeds]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Return what diagnosis then refines, with a first step."""
        return {"peak_velocity_m_s": 0.2 * self.options.peak_velocity_m_s}


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return what c multiplies, in the command u = ... + c * column."""
    part = v * c[0]
    return v / (1.0 + part * part)
