"""An amplifier whose two halves differ: it pushes more than it pulls."""

from __future__ import annotations

from numba import njit

from motorctl.model import Effect, Parameter, Picture


class PushPull(Effect):
    """v(u) = u + d |u|."""

    name = "push_pull"
    kind = "input"
    title = "Amplifier with unlike halves"
    formula = "v(u) = u + d * |u|"
    compensated = "inversion of the input map"
    identified = "linear in d"
    visible_in = "large commands of both signs"
    revealed_by = ("two_accelerations",)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """d."""
        return (Parameter("", "d", "1", -0.5, 0.5, 0.0, 0.1),)

    @property
    def picture(self) -> Picture:
        """What acts for a command."""
        return Picture("acting_command", "What acts, for a command.", scale=1.0)


@njit(inline="always")
def column(j: int, u: float, c: tuple[float, ...]) -> float:
    """Return the size of the command."""
    return abs(u)


@njit(inline="always")
def slope(j: int, u: float, c: tuple[float, ...]) -> float:
    """Return its derivative."""
    return 1.0 if u > 0.0 else -1.0
