"""What the campaign sees of a case: the device's side, tick by tick, from the fault on."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from motorctl.log.sample import AxisState
from motorctl.loop import Reply, Verb
from motorctl_benchmarks.safety.prepare import Ready

Array = NDArray[np.float64]

STANDS_M_S = 2e-3
STANDS_S = 0.02
REST_S = 4.0
"""An axis that coasts has come to rest within that, as friction brakes it."""


@dataclass
class Watch:
    """Steps a stand and keeps what its device was asked for, and where its carriages were."""

    made: Ready
    first: int = 0
    """Row of the first tick that is kept."""
    asked_v: list[Array] = field(default_factory=list)
    enabled: list[Array] = field(default_factory=list)
    places_m: list[Array] = field(default_factory=list)
    speeds_m_s: list[Array] = field(default_factory=list)

    def begin(self) -> None:
        """Keep everything from the next tick on."""
        self.first = self.made.stand.steps

    def step(self, elapsed: int = 1, *, overran: bool = False, beat: bool = True) -> None:
        """Do one tick and keep what it did."""
        stand = self.made.stand
        stand.step(elapsed, overran=overran, beat=beat)
        device = stand.device
        self.asked_v.append(device.asked_v.copy())
        self.enabled.append(device.enabled.astype(np.float64))
        self.places_m.append(device.places_m)
        self.speeds_m_s.append(device.speeds_m_s)

    def ask(self, verb: Verb, axis: str) -> Reply | None:
        """Give a command and return the answer of the tick that took it."""
        memory = self.made.stand.memory
        number = memory.post(verb, self.made.stand.names.index(axis))
        self.step()
        return memory.reply(number)

    @property
    def faulty(self) -> bool:
        """Whether the axis under test has tripped, or is ramped down for it."""
        return int(self.made.stand.status(self.made.axis)["fault"]) != 0

    def state(self) -> AxisState:
        """Return the state of the axis under test."""
        return self.made.stand.state(self.made.axis)

    def until_rest(self) -> None:
        """Tick until nothing moves or is being stopped any more; at most REST_S."""
        stand = self.made.stand
        rate, still = stand.machine.rate_hz, 0
        for _ in range(round(REST_S * rate)):
            moves = float(np.abs(stand.device.speeds_m_s).max()) > STANDS_M_S
            still = 0 if moves else still + 1
            if still >= STANDS_S * rate and not any(
                stand.state(name) is AxisState.STOPPING for name in stand.names
            ):
                return
            self.step()
