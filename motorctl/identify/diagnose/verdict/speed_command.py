"""A command that is a speed: it is followed at once, and no force is needed to change it."""

from __future__ import annotations

from motorctl.identify.diagnose.result import AxisDiagnosis

AT_ONCE = 0.5
"""Time that the axis takes to follow, in samples, below which none is seen. Larger doubts light
axes with much friction, smaller misses speeds that are followed late. Arithmetic: a command acts
half a sample late by being held."""
FOLLOWS = 0.2
"""Error of the declared model over the command, up to which the axis follows. Larger tells it of
motion that something else drives, smaller misses noisy speeds. Chosen by hand: real servos leave
0.01."""

DRY = 0.05
"""Dry friction over the command, above which a force or voltage drives the axis: a drive that is
sent a speed makes it whatever the friction. Larger tells it of voltages that overcome dry friction,
smaller misses drives that are slow at the turn. Chosen by hand: a robot's wheel at a voltage has
0.18, real servos 0.01 and less."""


def speed_told(axis: AxisDiagnosis) -> str | None:
    """Return a note that the command may be a speed that a drive was sent to, or None.

    Inertia over viscous friction is the time in which an axis comes up to speed. Where it is below
    what the samples show, the command is the velocity in another unit.
    """
    inertia, viscous, dry = (
        axis.declared.coefficient(axis.declared_theta, signal)
        for signal in ("acceleration", "velocity", "direction")
    )
    if axis.declared.index_of("acceleration") is None or not viscous > 0.0:
        return None
    period_s = axis.data.period_s
    follows = axis.error.held_out_before_rms < FOLLOWS * axis.error.command_rms
    is_driven = abs(dry) > DRY * axis.error.command_rms
    at_once = abs(inertia) < AT_ONCE * period_s * viscous
    if is_driven or not (follows and at_once):
        return None
    return (
        f"the axis follows its command within {1e3 * abs(inertia) / viscous:.2g} ms, a sample is "
        f"{1e3 * period_s:.3g} ms: the command is its speed, and no inertia can be seen. Where the "
        "column is a speed that a drive was sent to, it is not what drives the axis, and nothing "
        "found here is of the machine: give the drive's current, torque or voltage instead"
    )
