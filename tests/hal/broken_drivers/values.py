"""Drivers that are wrong in counts or volts."""

from __future__ import annotations

from typing import Any

import numpy as np
from wire_driver import CODES, FULL_SCALE_V, WireDriver

from broken_drivers.registry import fails
from motorctl.hal import Inputs, Outputs


@fails("test_arrays_are_filled_in_place")
class ReplacesArrays(WireDriver):
    def read(self, inputs: Inputs) -> None:
        status = inputs.status
        super().read(inputs)
        inputs.status = status.copy()


@fails("test_arrays_are_filled_in_place")
class ClipsInPlace(WireDriver):
    def write(self, outputs: Outputs) -> None:
        np.clip(outputs.volts, -FULL_SCALE_V, FULL_SCALE_V, out=outputs.volts)
        super().write(outputs)


@fails("test_only_its_own_slices_are_touched")
class FillsTheWholeArray(WireDriver):
    def read(self, inputs: Inputs) -> None:
        super().read(inputs)
        if inputs.status.base is not None:
            inputs.status.base[-1] = 0


@fails("test_only_its_own_slices_are_touched")
class KeepsTheFirstArrays(WireDriver):
    first: Any = None

    def read(self, inputs: Inputs) -> None:
        if self.first is None:
            self.first = Inputs(0)
            self.first.counts, self.first.status = inputs.counts, inputs.status
        super().read(self.first)


@fails("test_counts_come_through_over_the_whole_width_of_the_counter")
class KnowsOnly30Bits(WireDriver):
    def decode(self, reply):
        counts = super().decode(reply)
        return counts and [(count + 2**30) % 2**31 - 2**30 for count in counts]


@fails("test_volts_arrive_within_quantisation")
class RoundsCoarsely(WireDriver):
    def code(self, volts: float) -> int:
        code = super().code(volts)
        return code if abs(volts) > 0.1 else code // 8 * 8


@fails("test_outputs_are_zero_and_disabled_until_they_are_written")
class OpensWithTheLastCommand(WireDriver):
    last_sent = ([0, 0], 0)

    def write(self, outputs: Outputs) -> None:
        super().write(outputs)
        if self.device is not None:
            codes = np.round(self.device.volts / FULL_SCALE_V * CODES).astype(int)
            self.last_sent = (codes.tolist(), 3)

    def open(self) -> None:
        super().open()
        self.send(*self.last_sent)


@fails("test_a_disabled_channel_gets_zero_whatever_volts_says")
class ForgetsEnable(WireDriver):
    def permitted(self, on: bool, volts: float) -> tuple[bool, float]:
        return on and bool(np.isfinite(volts)), volts if np.isfinite(volts) else 0.0


@fails("test_volts_beyond_the_range_are_clamped_and_never_wrap")
class WrapsVolts(WireDriver):
    def code(self, volts: float) -> int:
        return (round(volts / FULL_SCALE_V * CODES) + 32768) % 65536 - 32768


@fails("test_volts_that_are_no_number_never_reach_the_amplifier")
class StaysEnabledWithoutANumber(WireDriver):
    def permitted(self, on: bool, volts: float) -> tuple[bool, float]:
        return on, volts if on and np.isfinite(volts) else 0.0


@fails("test_volts_that_are_no_number_never_reach_the_amplifier")
class TurnsInfinityAround(WireDriver):
    def permitted(self, on: bool, volts: float) -> tuple[bool, float]:
        return super().permitted(on, -1e9 if volts == np.inf else volts)


@fails("test_the_status_has_no_bits_but_those_of_the_contract")
class SetsABitOfItsOwn(WireDriver):
    def read(self, inputs: Inputs) -> None:
        super().read(inputs)
        inputs.status |= np.uint32(1 << 31)
