"""The simulated gantry with faults between it and the loop, begun and ended from outside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.hal import Channel, DriverOptions, Inputs, Outputs
from motorctl_sim import SimDriver


@dataclass(frozen=True)
class DeviceFault:
    """What a broken device does with its channels, until it is repaired."""

    channels: tuple[int, ...] = ()
    bits: int = 0
    """Of `motorctl.hal.Status`, reported with every read."""
    masks: int = 0
    """Bits that are never reported."""
    freezes: bool = False
    """The count stays what it was before."""
    offset_counts: int = 0
    noise_counts: float = 0.0
    """White, rms."""
    once: bool = False
    """The read in which it begins is the only one that is wrong."""
    gain: float = 1.0
    """Of the output stage, which says nothing: 0 is dead, -1 reversed."""
    output_v: float | None = None
    """The output stage gives this, whatever it is asked for, as long as it is enabled."""
    output_off: bool = False
    """No volts, as of a device that switched itself off."""
    force_v: float = 0.0
    """Pushes the carriage from the fault's first write on, for `force_ticks`."""
    force_ticks: int = 0


class FaultyGantry(SimDriver):
    """Breaks when it is told to, and keeps what the loop asked of its amplifiers."""

    def __init__(
        self, options: DriverOptions, channels: Sequence[Channel], period_s: float
    ) -> None:
        super().__init__(options, channels, period_s)
        count = len(channels)
        self.asked_v = np.zeros(count)
        """What the last write asked of each channel; 0 where it is not enabled."""
        self.enabled = np.zeros(count, np.uint8)
        self._fault: DeviceFault | None = None
        self._reads = 0
        self._before = np.zeros(count, np.int64)
        self._passed_on = Outputs(count)
        self._random = np.random.default_rng(0)

    def break_down(self, fault: DeviceFault, seed: int = 0) -> None:
        """Let a fault begin with the next read."""
        self._fault, self._reads = fault, 0
        self._random = np.random.default_rng(seed)

    def repair(self) -> None:
        """Let everything be in order from the next read on; a place that was lost stays lost."""
        if self._fault is not None and self._fault.offset_counts and not self._fault.once:
            self._fault = DeviceFault(self._fault.channels, offset_counts=self._fault.offset_counts)
        else:
            self._push(0.0)
            self._fault = None

    def read(self, inputs: Inputs) -> None:
        """Read the gantry, and say of it what a broken device would."""
        super().read(inputs)
        fault = self._fault
        if fault is None or (fault.once and self._reads > 0):
            self._before[:] = inputs.counts
            return
        if fault.force_v:
            self._push(fault.force_v if self._reads < fault.force_ticks else 0.0)
        self._reads += 1
        for k in fault.channels:
            if fault.freezes:
                inputs.counts[k] = self._before[k]
            count = int(inputs.counts[k]) + fault.offset_counts
            if fault.noise_counts:
                count += round(self._random.normal(0.0, fault.noise_counts))
            inputs.counts[k] = _wrapped(count, self.channels[k].counter_bits)
            inputs.status[k] = (int(inputs.status[k]) | fault.bits) & ~fault.masks

    def _push(self, force_v: float) -> None:
        """Let a force act on the broken carriages from now on, where the fault is one."""
        fault = self._fault
        if fault is not None and fault.force_v:
            for k in fault.channels:
                self._states["fault_force"][k] = force_v

    def write(self, outputs: Outputs) -> None:
        """Keep what is asked for, and pass on what a broken output stage would give."""
        np.multiply(outputs.volts, outputs.enable != 0, out=self.asked_v)
        self.enabled[:] = outputs.enable
        passed = self._passed_on
        passed.volts[:] = outputs.volts
        passed.enable[:] = outputs.enable
        fault = self._fault
        if fault is not None and not fault.once:
            for k in fault.channels:
                passed.volts[k] *= fault.gain
                if fault.output_v is not None:
                    passed.volts[k] = fault.output_v
                if fault.output_off:
                    passed.enable[k] = 0
        super().write(passed)

    @property
    def places_m(self) -> NDArray[np.float64]:
        """Where the carriages truly are."""
        places: NDArray[np.float64] = self._states["position"].copy()
        return places

    @property
    def speeds_m_s(self) -> NDArray[np.float64]:
        """How fast the carriages truly are."""
        speeds: NDArray[np.float64] = self._states["velocity"].copy()
        return speeds


def _wrapped(count: int, bits: int) -> int:
    half = 1 << (bits - 1)
    return (count + half) % (2 * half) - half
