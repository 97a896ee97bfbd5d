"""What came after a request that still waits: a stop is not followed by what was asked before it.

A motion is planned, a driver opened, an amplifier enabled while other requests are answered. Each
request that has to wait looks here before it orders anything.
"""

from __future__ import annotations

from collections.abc import Iterable

from motorctl.daemon.protocol import Code, RefusedError


class Stops:
    """Counts the stops that were asked for, by axis, and the emergency stops."""

    def __init__(self, names: Iterable[str]) -> None:
        self.of_axis = dict.fromkeys(names, 0)
        self.emergencies = 0

    def begin(self, do: str) -> Begun:
        """Note that a request begins now; `do` is what it is called."""
        return Begun(self, do)


class Begun:
    """A request, and the stops there had been when it began."""

    def __init__(self, stops: Stops, do: str) -> None:
        self._stops = stops
        self._do = do
        self._of_axis = dict(stops.of_axis)
        self._emergencies = stops.emergencies

    def insist(self, *names: str) -> None:
        """Raise RefusedError where a stop of one of these axes, or an emergency stop, came since.

        Without names an emergency stop only.
        """
        if self._stops.emergencies != self._emergencies:
            raise self._overtaken("an emergency stop")
        for name in names:
            if self._stops.of_axis[name] != self._of_axis[name]:
                raise self._overtaken(f"a stop of axis {name}")

    def _overtaken(self, by: str) -> RefusedError:
        message = (
            f"{self._do} was overtaken by {by} that came while it waited; what was left of it is "
            "not done: ask again if it is still meant"
        )
        return RefusedError(Code.OVERTAKEN, message)
