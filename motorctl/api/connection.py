"""A running machine, from a script or a notebook."""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

from motorctl.api import orders
from motorctl.api.orders import AT_REST, STOP_TIMEOUT_S, Motion, OnWait, Reset, Started
from motorctl.api.status import AxisStatus, MachineStatus
from motorctl.daemon.client import Client

if TYPE_CHECKING:
    from motorctl.api.samples import Subscription

PERIOD_S = 0.1
"""Between two looks of a subscription [s], unless told otherwise."""


class Connection(Client):
    """A connection to a daemon, as `connect` returns it; use it as a context manager.

    Every method waits for its answer. A daemon that still gets ready and an axis that still moves
    are waited for; `on_wait` is told why. `ask` sends any other request of the control socket.
    What can go wrong with each of them:

    - `DaemonRefusedError`: the daemon said no; `code` and message tell why.
    - `AxisFaultError`: an axis that was waited for tripped; `cause` and message tell why, and what
      to do.
    - `NotReachedError`, which is a `TimeoutError`: the time is over.
    - `RunError`: the daemon is gone, or did not answer in time. Nothing more is sent then, nor
      after Ctrl-C while an answer was waited for: connect anew.
    """

    def status(self) -> MachineStatus:
        """Return states, positions and errors of all axes, at this moment."""
        return self.carry_out(orders.status())

    def axis_status(self, axis: str) -> AxisStatus:
        """Return the status of one axis."""
        return self.carry_out(orders.axis_status(axis))

    def start(self, axis: str, *, hold: bool = False, on_wait: OnWait | None = None) -> Started:
        """Enable an axis without a bump; it follows its program, or holds where it has none.

        A program over several axes begins when the last of them is started. With `hold` it holds,
        whatever program it has.
        """
        return self.carry_out(orders.start(axis, hold, on_wait))

    def stop(
        self, axis: str, *, timeout_s: float = STOP_TIMEOUT_S, on_wait: OnWait | None = None
    ) -> AxisStatus:
        """Ramp an axis down and disable it; returns when it is off."""
        return self.carry_out(orders.stop(axis, timeout_s, on_wait))

    def stop_all(
        self, *, timeout_s: float = STOP_TIMEOUT_S, on_wait: OnWait | None = None
    ) -> tuple[str, ...]:
        """Ramp every enabled axis down at once; returns their names when all are off."""
        return self.carry_out(orders.stop_all(timeout_s, on_wait))

    def home(
        self, axis: str, *, timeout_s: float | None = None, on_wait: OnWait | None = None
    ) -> AxisStatus:
        """Find an axis' zero; returns when it is found. An axis that is off is enabled first."""
        return self.carry_out(orders.home(axis, timeout_s, on_wait))

    def move(
        self,
        axis: str,
        position_m: float | None = None,
        *,
        by_m: float | None = None,
        velocity_m_s: float | None = None,
        acceleration_m_s2: float | None = None,
        on_wait: OnWait | None = None,
    ) -> Motion:
        """Begin to move an axis that holds to a position; `wait` waits for the end.

        The whole move is checked against every limit before anything moves.

        Parameters
        ----------
        axis
            Its name.
        position_m
            Where to [m].
        by_m
            Instead: how far from where it holds [m].
        velocity_m_s, acceleration_m_s2
            At most; None: a quarter of the axis' limit, and that of the stop ramp.
        on_wait
            Told why, where the request has to wait.
        """
        return self.carry_out(
            orders.move(axis, position_m, by_m, velocity_m_s, acceleration_m_s2, on_wait)
        )

    def program(
        self, axis: str, name_or_file: str | os.PathLike[str], *, on_wait: OnWait | None = None
    ) -> Motion:
        """Let an axis that holds follow a program: its name in the configuration, or a file.

        It is led to the program's start first. All axes of the program must hold.
        """
        return self.carry_out(orders.program(axis, name_or_file, on_wait))

    def wait(
        self,
        axis: str,
        states: str | Collection[str] = AT_REST,
        *,
        timeout_s: float | None = None,
    ) -> AxisStatus:
        """Return once an axis is in a state, or in one of several; else once its motion has ended.

        Parameters
        ----------
        axis
            Its name.
        states
            Which; by default it holds again, or is off.
        timeout_s
            How long at most [s]; None: for ever.
        """
        return self.carry_out(orders.wait(axis, states, timeout_s))

    def subscribe(
        self, *, period_s: float = PERIOD_S, history_s: float = 0.0, restarts: bool = False
    ) -> Subscription:
        """Read every row of the loop as it comes: ``for samples in machine.subscribe():``.

        Parameters
        ----------
        period_s
            Between two looks [s]; rows wait for about 8 s.
        history_s
            Begin with rows that are so old [s], as far as they are there and of the models that
            run now.
        restarts
            Go on with the next daemon after this one has ended.

        Returns
        -------
        Subscription
            Iterate over it, or call `read`; each time `Samples`, whose columns are arrays (N,)
            under the names that logs have. Close it, or use it as a context manager.
        """
        from motorctl.api.samples import Subscription

        return Subscription(self.path, period_s=period_s, history_s=history_s, restarts=restarts)

    def reset(self, axis: str, *, on_wait: OnWait | None = None) -> Reset:
        """Clear an axis' fault once its cause is gone; a lost driver is opened anew."""
        return self.carry_out(orders.reset(axis, on_wait))

    def reset_all(self, *, on_wait: OnWait | None = None) -> tuple[Reset, ...]:
        """Clear the fault of every axis that has one; returns what was done to each."""
        return self.carry_out(orders.reset_all(on_wait))

    def estop(self) -> tuple[str, ...]:
        """Zero and disable every axis at once and return their names; each is in fault then."""
        return self.carry_out(orders.estop())

    def _repr_html_(self) -> str:
        return self.status()._repr_html_()


def connect(socket: str | os.PathLike[str] | None = None) -> Connection:
    """Connect to a running daemon.

    Parameters
    ----------
    socket
        Its control socket; None: the user's own daemon, else root's, else the only service's.

    Returns
    -------
    Connection
        Use it as a context manager, or close it. Not from two threads at once.

    Raises
    ------
    RunError
        Where no daemon answers there.
    UsageError
        Where the socket that nobody named is another user's, or several services run.
    """
    return Connection(None if socket is None else Path(socket))
