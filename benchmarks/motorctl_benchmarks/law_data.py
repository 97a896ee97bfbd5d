"""Data to time the control law on: a recorded stretch of motion in which the estimator learns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.config.machine import Machine
from motorctl.errors import RunError
from motorctl.log.sample import SampleFlag
from motorctl.loop import VirtualMachine
from motorctl.model import EffectList

Array = NDArray[np.float64]

LONGEST_WAIT_S = 10.0


@dataclass(frozen=True)
class LawData:
    """A stretch of ticks of one axis, and the law's records as they stood before it."""

    model: EffectList
    settings: NDArray[np.void]
    """Shape (1,), of law_settings."""
    start: NDArray[np.void]
    """Shape (1,), of law_state."""
    time_s: Array
    position_m: Array
    reference_m: Array
    reference_velocity_m_s: Array
    reference_acceleration_m_s2: Array
    command_v: Array
    """What the law gave, shape (steps,)."""
    theta_hat: Array
    """What it had learned after each step, shape (steps, n)."""
    projected: int
    """In how many of the steps the estimate was projected."""

    @property
    def steps(self) -> int:
        """How many ticks it holds."""
        return len(self.time_s)

    @property
    def motion(self) -> tuple[Array, Array, Array, Array]:
        """Position and desired position, velocity and acceleration."""
        return (
            self.position_m,
            self.reference_m,
            self.reference_velocity_m_s,
            self.reference_acceleration_m_s2,
        )


def record_law(machine: Machine, axis: str, steps: int) -> LawData:
    """Run a machine in virtual time until an axis learns, then record `steps` ticks of it.

    Parameters
    ----------
    machine
        A simulated machine with programs.
    axis
        Whose law to record.
    steps
        Number of ticks.

    Raises
    ------
    RunError
        The axis does not learn throughout.
    """
    index = list(machine.axes).index(axis)
    rows: list[tuple[NDArray[np.void], NDArray[np.void]]] = []
    with VirtualMachine(machine, lambda ticks, samples: rows.append((ticks, samples))) as virtual:
        virtual.start()
        virtual.follow_programs(machine.followed_programs)
        for _ in range(round(LONGEST_WAIT_S * machine.rate_hz)):
            virtual.advance(1)
            if rows[-1][1]["flags"][0, index] & SampleFlag.ADAPTING:
                break
        settings = virtual.tick.law_settings[index : index + 1].copy()
        start = virtual.tick.laws[index : index + 1].copy()
        rows.clear()
        virtual.advance(steps)
        virtual.raise_faults()
    ticks = np.concatenate([ticks for ticks, _ in rows])
    samples = np.concatenate([samples[:, index] for _, samples in rows])
    if not (samples["flags"] & SampleFlag.ADAPTING).all():
        raise RunError(f"axis {axis} of {machine.name} does not learn for {steps} ticks on end")
    n = len(machine.axes[axis].model)
    return LawData(
        model=machine.axes[axis].model,
        settings=settings,
        start=start,
        time_s=ticks["time_s"].copy(),
        position_m=samples["position_m"].copy(),
        reference_m=samples["reference_m"].copy(),
        reference_velocity_m_s=samples["reference_velocity_m_s"].copy(),
        reference_acceleration_m_s2=samples["reference_acceleration_m_s2"].copy(),
        command_v=samples["command_v"].copy(),
        theta_hat=samples["theta_hat"][:, :n].copy(),
        projected=int(np.count_nonzero(samples["flags"] & SampleFlag.PROJECTED)),
    )
