"""`motorctl jog`: move an axis step by step with the arrow keys."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from motorctl.cli.axis_commands import AxisArgument
from motorctl.cli.say import say
from motorctl.cli.socket_option import SocketOption

if TYPE_CHECKING:
    from rich.text import Text

    from motorctl import Connection
    from motorctl.api.status import AxisStatus
    from motorctl.axis_units import AxisUnits
    from motorctl.cli.keys import Keys

STEPS = {"m": (1e-6, 0.1), "rad": (1e-6, 0.5)}
"""Between these a key changes the step [m, rad]. Shorter: nothing is seen of it; longer: `move`
says what it will do before it does it."""
FIRST_STEP = {"m": 1e-3, "rad": 1e-2}
"""With which it begins [m, rad]."""
SHOWN_S = 0.05
RAMP = "s"
"""The key that ramps the axis down and disables it."""
HINT = "← → step  ↑ ↓ its length  s: ramp down  space: emergency stop  q: leave"


def jog(
    axis: AxisArgument,
    step: Annotated[
        str | None,
        typer.Option(help="Way of one press, with a unit (100um, 1deg); else 1 mm or 10 mrad."),
    ] = None,
    velocity: Annotated[
        str | None,
        typer.Option(help="m/s (rad/s), or with a unit; usual: a quarter of the axis' limit."),
    ] = None,
    socket: SocketOption = None,
) -> None:
    """Move an axis that holds step by step, with the arrow keys.

    A press is one step, checked as any move is; what is pressed while a step runs is dropped, so
    nothing moves after the key is let go but the step that was begun.

    Example: motorctl jog x --step 100um
    """
    from motorctl import connect
    from motorctl.axis_units import units_of
    from motorctl.cli.keys import LEAVE, single_keys
    from motorctl.cli.lengths import length_m, velocity_m_s
    from motorctl.errors import UsageError

    if step is not None:
        length_m(step)
    if velocity is not None:
        velocity_m_s(velocity)
    with (
        connect(socket) as machine,
        connect(socket) as other,
        single_keys(other.estop, LEAVE + RAMP) as keys,
    ):
        if keys is None:
            raise UsageError("jog needs a terminal; elsewhere: motorctl move AXIS --by 1mm")
        status = machine.axis_status(axis)
        state, units = status.state, units_of(status.position_unit)
        step_m = FIRST_STEP[units.position] if step is None else length_m(step, units.position)
        shortest, longest = STEPS[units.position]
        if not shortest <= step_m <= longest:
            ends = f"{shortest * 1e6:g}um to {longest * 1e3:g}mm"
            raise UsageError(f"--step {step}: should be {units.words(ends)}")
        fast_m_s = None if velocity is None else velocity_m_s(velocity, units.position)
        if state not in ("idle", "running"):
            raise UsageError(
                f"axis {axis} is {state}: it has to hold, so `motorctl start {axis} --hold` first"
            )
        session = _Jogging(machine, axis, step_m, fast_m_s, units)
        session.run(keys)
    say(f"axis {axis}: {session.ended}")


class _Jogging:
    """One session: what each key does, and what is shown."""

    def __init__(
        self,
        machine: Connection,
        axis: str,
        step_m: float,
        velocity_m_s: float | None,
        units: AxisUnits,
    ) -> None:
        self._units = units
        self._machine, self._axis = machine, axis
        self._step_m, self._velocity_m_s = step_m, velocity_m_s
        self._told = ""
        self.ended = ""

    def run(self, keys: Keys) -> None:
        """Obey keys until one of them ends it."""
        from rich.live import Live

        from motorctl.cli.terminal import Terminal

        with Live(console=Terminal(), auto_refresh=False, transient=True) as live:
            while not self.ended:
                status = self._machine.axis_status(self._axis)
                live.update(self._view(status), refresh=True)
                try:
                    self._obey(keys.next(SHOWN_S), status)
                except KeyboardInterrupt:
                    self.ended = _left(status)
                if keys.stopped:
                    self.ended = "emergency stop of every axis"

    def _obey(self, key: str | None, status: AxisStatus) -> None:
        from motorctl import DaemonRefusedError
        from motorctl.cli.keys import LEAVE

        if status.fault is not None:
            self.ended = f"fault: {status.fault}"
        elif key == LEAVE:
            self.ended = _left(status)
        elif key == RAMP:
            self._machine.stop(self._axis)
            self.ended = "off"
        elif key in ("up", "down"):
            shortest, longest = STEPS[self._units.position]
            longer = self._step_m * (10.0 if key == "up" else 0.1)
            self._step_m = min(max(longer, shortest), longest)
        elif key in ("left", "right") and status.state == "idle":
            way_m = self._step_m if key == "right" else -self._step_m
            try:
                self._machine.move(self._axis, by_m=way_m, velocity_m_s=self._velocity_m_s)
                self._told = ""
            except DaemonRefusedError as no:
                self._told = str(no)

    def _view(self, status: AxisStatus) -> Text:
        from rich.text import Text

        where = "–" if status.position_m is None else self._units.told(status.position_m)
        return Text.assemble(
            (f"{self._axis} ", "bold"),
            (f"{status.state:8}", "green" if status.state == "running" else "cyan"),
            f"{where:>14}   step {self._units.words(f'{self._step_m * 1e3:g} mm')}   ",
            (self._told, "yellow"),
            "\n",
            (HINT, "dim"),
        )


def _left(status: AxisStatus) -> str:
    return "holds" if status.state == "idle" else "ends its step, then holds"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(jog)
