"""A bench for tests of the simulated gantry: run voltages through it, see the true motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.hal import Channel, Inputs, Outputs
from motorctl_sim import SimDriver, SimOptions

PERIOD_S = 0.2e-3

# No force but thrust, so that one effect at a time can be added.
BARE: dict[str, Any] = {
    "inertia_v_s2_m": 0.2,
    "viscous_friction_v_s_m": 0.0,
    "coulomb_friction_v": 0.0,
    "offset_v": 0.0,
    "em_quadratic_1_v": 0.0,
    "em_cubic_1_v2": 0.0,
    "travel_m": [-10.0, 10.0],
    "limit_switches_m": None,
    "home_switch": None,
    "encoder": {"index_marks_m": []},
}
# Too heavy to be moved: position and velocity stay as given, so acceleration times inertia is
# the force at a chosen place and speed.
HEAVY_V_S2_M = 1e7


@dataclass
class Motion:
    """What a run gave, a row a period; row 0 is before the first."""

    time_s: NDArray[np.float64]
    position_m: NDArray[np.float64]
    velocity_m_s: NDArray[np.float64]
    acceleration_m_s2: NDArray[np.float64]
    current_v: NDArray[np.float64]
    counts: NDArray[np.int64]
    index_counts: NDArray[np.int64]
    status: NDArray[np.uint32]


class Bench:
    """A simulated machine in virtual time, all channels enabled."""

    def __init__(
        self,
        *plants: Mapping[str, Any],
        preset: str = "published_gantry_clean",
        resolution_m: float = 1e-9,
        counter_bits: int = 64,
        period_s: float = PERIOD_S,
        **options: Any,
    ) -> None:
        changes = {i: dict(plant) for i, plant in enumerate(plants)}
        data = {"preset": preset, "plants": changes, **options}
        n = max(1, len(plants))
        channels = [Channel(f"axis{i}", i, resolution_m, counter_bits, 10.0) for i in range(n)]
        self.driver = SimDriver(SimOptions.model_validate(data), channels, period_s)
        self.driver.start_virtual_time()
        self.driver.open()
        self.inputs, self.outputs = Inputs(n), Outputs(n)
        self.outputs.enable[:] = 1

    def run(self, volts: Any, periods: int) -> Motion:
        """Apply volts (scalar, one for each channel, or a row a period) for a number of periods."""
        n = len(self.outputs.volts)
        table = np.asarray(volts, float)
        if table.ndim < 2:
            table = np.broadcast_to(table, (periods, n))
        true = self.driver.true_state()
        self.driver.read(self.inputs)
        rows = [(true, *self._seen())]
        for row in table:
            self.outputs.volts[:] = row
            self.driver.write(self.outputs)
            self.driver.advance()
            self.driver.read(self.inputs)
            rows.append((self.driver.true_state(), *self._seen()))
        states, counts, index_counts, status = zip(*rows, strict=True)
        return Motion(
            np.array([state.time_s for state in states]),
            np.array([state.position_m for state in states]),
            np.array([state.velocity_m_s for state in states]),
            np.array([state.acceleration_m_s2 for state in states]),
            np.array([state.current_v for state in states]),
            np.array(counts),
            np.array(index_counts),
            np.array(status),
        )

    def _seen(self) -> tuple[Any, Any, Any]:
        inputs = self.inputs
        return inputs.counts.copy(), inputs.index_counts.copy(), inputs.status.copy()


def bare(**plant: Any) -> dict[str, Any]:
    """Return BARE with additions."""
    return {**BARE, **plant}


def force_at(x: float, v: float, u: float = 0.0, periods: int = 1, **plant: Any) -> float:
    """Measure the force at a position and a speed, V, on a carriage too heavy to be moved.

    The force is the one of the last of the periods, in whose middle the carriage is at x.
    """
    period_s = 20e-6  # one substep
    start = {
        "initial_position_m": x - v * period_s * (periods - 0.5),
        "initial_velocity_m_s": v,
    }
    heavy = {"inertia_v_s2_m": HEAVY_V_S2_M}
    bench = Bench({**BARE, **start, **heavy, **plant}, period_s=period_s)
    motion = bench.run(u, periods)
    return float(motion.acceleration_m_s2[-1, 0]) * HEAVY_V_S2_M
