"""A supply whose voltage ends: what the motor induces at speed is missing for its current."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from numba import njit
from pydantic import Field

from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.parameter import Parameter

LEVELS = (0.3, 0.45, 0.6, 0.75, 0.9, 1.25, 1.75, 2.5)
"""Limits at standstill that are tried, as multiples of the largest command, which may be given at
speed. Closer ones take time, wider ones start the refinement too far away. Chosen by hand."""
SPEEDS = (1.1, 1.6, 2.5, 5.0, 20.0)
"""Speeds without load that are tried, as multiples of the top speed: at the last the limit hardly
depends on speed. Closer ones take time, wider ones start the refinement too far away. Chosen by
hand."""
AT_SPEED = 0.95
"""Limit at the top speed over the largest command, beyond which a form is not tried: hardly any
command is lost to it. Larger takes time, smaller misses faint ones. Chosen by hand."""
LARGEST_SHARE = 0.9
"""Of what is beyond the limit, that is lost: where all of it is, the map stands still and has no
inverse. Larger leaves none, smaller compensates less. Arithmetic: the slope there is 1 - q."""


class VoltageClippingOptions(EffectOptions):
    """The line between standstill and the speed without load."""

    limit_v: float = Field(
        ge=1e-9, allow_inf_nan=False, description="U: largest command that acts at standstill"
    )
    no_load_m_s: float = Field(
        ge=1e-9, allow_inf_nan=False, description="v_0: speed at which nothing of it is left"
    )


class VoltageClipping(Effect):
    """v(u) = u - q (u - clip(u, -U (1 + x'/v_0), U (1 - x'/v_0))).

    A current or a force that an amplifier is asked for ends where its voltage does, and the motor's
    own induced voltage takes a part of that in the direction of motion: the line of torque over
    speed in the data sheet of every motor.
    """

    name = "voltage_clipping"
    kind = "input"
    varies = True
    varies_with_velocity = True
    title = "Limit of the supply's voltage"
    formula = "v(u) = u - q (u - clip(u, -U (1 + x'/v_0), U (1 - x'/v_0)))"
    compensated = "inversion of the input map at the desired velocity, as far as there is voltage"
    identified = "linear in q; limit and speed without load by a scan"
    visible_in = "the hardest accelerations that are used, up to the top speed, in both directions"
    scan_shows_part = True
    # a limit of current does not depend on speed
    refuted_at_end = MappingProxyType({"no_load_m_s": "neither"})
    revealed_by = ("two_accelerations", "two_speeds")
    usual = MappingProxyType({"share": 1.0})  # a supply has no more than its voltage
    Options = VoltageClippingOptions
    options: VoltageClippingOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """q: the part of what is beyond the limit that is lost."""
        return (Parameter("share", "q", "1", 0.0, LARGEST_SHARE, 0.0, 0.1),)

    @property
    def constants(self) -> tuple[float, ...]:
        """U [V] and what of it each m/s takes, U/v_0 [V*s/m]."""
        return self.options.limit_v, self.options.limit_v / self.options.no_load_m_s

    @property
    def picture(self) -> Picture:
        """The commands that act, over velocity."""
        return Picture(
            "limit_over_speed",
            "Commands over velocity: those beyond the limit, and what of them acts.",
        )

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return limits below the largest command, at speeds without load above the top speed."""
        if not (spans.command_v > 0.0 and spans.speed_m_s > 0.0):
            return ()
        return [
            cls(
                VoltageClippingOptions(
                    limit_v=max(level * spans.command_v, 1e-9),
                    no_load_m_s=max(speed * spans.speed_m_s, 1e-9),
                )
            )
            for level in LEVELS
            for speed in SPEEDS
            if level * (1.0 - 1.0 / speed) < AT_SPEED
        ]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine both."""
        return {
            "limit_v": 0.1 * self.options.limit_v,
            "no_load_m_s": 0.2 * self.options.no_load_m_s,
        }

    def contradicted_by(self, spans: Spans) -> str | None:
        """Return that the axis runs faster than the speed at which nothing is left to drive it."""
        if self.options.no_load_m_s >= spans.speed_m_s:
            return None
        return (
            f"its no_load_m_s, {self.options.no_load_m_s:.3g}, is the speed at which no command "
            f"acts any more, and the axis runs at {spans.speed_m_s:.3g}"
        )


@njit(inline="always")
def column(j: int, u: float, x: float, vs: float, t: float, c: tuple[float, ...]) -> float:
    """Return minus what is beyond the limit [V]; within it nothing, and nothing without command."""
    taken = c[1] * vs
    if u > 0.0:
        return min(max(c[0] - taken, 0.0) - u, 0.0)
    return max(-max(c[0] + taken, 0.0) - u, 0.0)


@njit(inline="always")
def slope(j: int, u: float, x: float, vs: float, t: float, c: tuple[float, ...]) -> float:
    """Return its derivative."""
    taken = c[1] * vs
    beyond = u > max(c[0] - taken, 0.0) if u > 0.0 else u < -max(c[0] + taken, 0.0)
    return -1.0 if beyond else 0.0
