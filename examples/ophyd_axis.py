"""An axis of motorctl as a device of ophyd-async, for plans of bluesky.

    pip install 'motorctl[bluesky]'

`Axis` is movable, readable and locatable; `StandstillNoise` is a detector that reads every row of
the loop while it is triggered. `bluesky_scan.py` beside this file scans with both.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import numpy as np
from bluesky.protocols import Location, Stoppable, Triggerable
from ophyd_async.core import (
    DEFAULT_TIMEOUT,
    AsyncLocatable,
    AsyncStatus,
    LazyMock,
    StandardReadable,
    WatchableAsyncStatus,
    WatcherUpdate,
    soft_signal_r_and_setter,
)
from ophyd_async.core import StandardReadableFormat as Format

import motorctl
from motorctl.api.status import AxisStatus
from motorctl.axis_units import PositionUnit

WATCH_S = 0.05
"""Between two looks at an axis that moves [s]."""
MEASURED_S = 0.2
"""So long a trigger of `StandstillNoise` measures [s]."""


class OfMachine(StandardReadable):
    """What shares a connection to a running daemon."""

    def __init__(self, socket: str, axis: str, unit: PositionUnit, name: str = "") -> None:
        self._axis = axis
        self._unit: PositionUnit = unit
        self._machine = motorctl.connect_async(socket)
        super().__init__(name)

    async def connect(
        self,
        mock: bool | LazyMock[Any] = False,
        timeout: float = DEFAULT_TIMEOUT,
        force_reconnect: bool = False,
    ) -> None:
        """Connect to the daemon, and to nothing where `mock` is.

        An axis whose positions are in another unit is refused.
        """
        if not mock:
            await self._machine
            told = (await self._machine.axis_status(self._axis)).position_unit
            if told != self._unit:
                raise ValueError(f"axis {self._axis} is in {told}: give unit={told!r}")
        await super().connect(mock, timeout, force_reconnect)


class Axis(OfMachine, AsyncLocatable[float], Stoppable):
    """An axis; its positions are in `unit`, rad of a rotary one.

    Staging enables it, and it holds from then on.
    """

    def __init__(self, socket: str, axis: str, name: str = "", unit: PositionUnit = "m") -> None:
        # Uncached: they are asked for when they are read, and nobody pushes them.
        with self.add_children_as_readables(Format.HINTED_UNCACHED_SIGNAL):
            self.position, _ = soft_signal_r_and_setter(
                float, units=unit, precision=6, getter=self._position_m
            )
        with self.add_children_as_readables(Format.UNCACHED_SIGNAL):
            self.reference, _ = soft_signal_r_and_setter(
                float, units=unit, precision=6, getter=self._reference_m
            )
        super().__init__(socket, axis, unit, name)

    @AsyncStatus.wrap
    async def stage(self) -> None:
        """Enable the axis without a bump; it holds where it stands."""
        await super().stage()
        await self._machine.start(self._axis, hold=True)

    @WatchableAsyncStatus.wrap
    async def set(self, value: float) -> AsyncIterator[WatcherUpdate[float]]:
        """Move to a position [m or rad]; done when the axis holds there.

        A move beyond a limit is refused before anything moves, and an axis that trips on the way
        fails the status, each with its reason.
        """
        began = await self._machine.axis_status(self._axis)
        await self._machine.move(self._axis, value)
        while (now := await self._machine.axis_status(self._axis)).state == "running":
            yield WatcherUpdate(
                current=_known(now.position_m),
                initial=_known(began.position_m),
                target=value,
                name=self.name,
                unit=self._unit,
            )
            await asyncio.sleep(WATCH_S)
        ended = await self._machine.wait(self._axis)
        if ended.state != "idle":
            raise RuntimeError(
                f"axis {self._axis} was stopped on its way to {value:g} {self._unit}"
            )

    async def stop(self, success: bool = True) -> None:
        """Ramp an axis that moves down and disable it; one that holds goes on holding.

        Bluesky stops what it has moved at the end of every plan, and when one is aborted.
        """
        if (await self._status()).state == "running":
            await self._machine.stop(self._axis)

    async def locate(self) -> Location[float]:
        """Return where the axis is sent to and where it is [m or rad]."""
        now = await self._status()
        return Location(setpoint=_known(now.reference_m), readback=_known(now.position_m))

    async def _status(self) -> AxisStatus:
        return await self._machine.axis_status(self._axis)

    async def _position_m(self) -> float:
        return _known((await self._status()).position_m)

    async def _reference_m(self) -> float:
        return _known((await self._status()).reference_m)


class StandstillNoise(OfMachine, Triggerable):
    """Root mean square of an axis' following error while it holds, over every row of the loop."""

    def __init__(self, socket: str, axis: str, name: str = "", unit: PositionUnit = "m") -> None:
        with self.add_children_as_readables(Format.HINTED_SIGNAL):
            self.rms, self._tell = soft_signal_r_and_setter(float, units=unit, precision=9)
        super().__init__(socket, axis, unit, name)

    @AsyncStatus.wrap
    async def trigger(self) -> None:
        """Measure for a while."""
        with await self._machine.subscribe() as samples:
            await asyncio.sleep(MEASURED_S)
            error_m = samples.read()[f"{self._axis}.following_error_m"]
        self._tell(float(np.sqrt(np.mean(error_m**2))))


def _known(position_m: float | None) -> float:
    """Return a position, not a number where nobody knows it."""
    return np.nan if position_m is None else position_m
