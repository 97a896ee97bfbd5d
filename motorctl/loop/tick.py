"""The tick of wall and virtual time: read all, compute all, check limits, write all, publish."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import partial
from types import ModuleType
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from motorctl.config.dual_drive_keys import SECOND_END
from motorctl.config.hardware import channels_of, wirings_of
from motorctl.config.loop_rules import filter_of
from motorctl.config.machine import Machine
from motorctl.control import fill_settings, fill_state, law_settings, law_state
from motorctl.errors import RunError
from motorctl.hal import Driver, Inputs, Outputs
from motorctl.kernels import (
    SentKernel,
    compiling_told,
    kernels_cached,
    know_arguments,
    packed,
    specialise,
    unpacked,
)
from motorctl.loop.axis_records import AXIS_SETTINGS, AXIS_STATE, fill_axis_settings
from motorctl.loop.clock import NS_PER_S
from motorctl.loop.compiling_time import compiling_words
from motorctl.loop.compose import compose_tick
from motorctl.loop.dual_records import DUAL_SETTINGS, DUAL_STATE, fill_dual_drive
from motorctl.loop.guards.supervision import WATCH
from motorctl.loop.shared import LoopMemory

with kernels_cached():
    from motorctl.loop.publish import publish

T = TypeVar("T")
Move = tuple[Callable[[T], None], T, int]
"""A driver's read or write, its arrays, and the ticks between two of them."""
Step = Callable[[int, int, bool, int, int], bool]
"""step(number, elapsed, overran, scheduled_ns, woke_ns) -> whether the loop may end.

scheduled_ns is the deadline that was missed, `elapsed` - 1 periods ago; 0: there is no clock."""


class Doors(Protocol):
    """What a tick does with a driver."""

    def read(self, inputs: Inputs) -> None:
        """Fill `inputs`."""

    def write(self, outputs: Outputs) -> None:
        """Send `outputs`."""


def make_drivers(machine: Machine, driver_class: type[Driver] | None = None) -> dict[str, Driver]:
    """Make every driver of the machine, not yet opened.

    driver_class stands in for every driver's own class.
    """
    drivers = {}
    wirings = wirings_of(machine.axes.values())
    for name, setup in machine.drivers.items():
        channels = channels_of(name, wirings)
        if channels:
            period_s = machine.period_of_driver(name)
            drivers[name] = (driver_class or setup.cls)(setup.options, channels, period_s)
    return drivers


def axes_beside(machine: Machine) -> NDArray[np.int64]:
    """Return the indices of the axes that each axis' effects name, (axes, most); -1 fills rows."""
    names = list(machine.axes)
    named = [axis.model.other_axes for axis in machine.axes.values()]
    beside = np.full((len(names), max(1, *map(len, named))), -1, np.int64)
    for row, others in zip(beside, named, strict=True):
        row[: len(others)] = [names.index(other) for other in others]
    return beside


class Tick:
    """Everything that one tick works on, made before the first."""

    def __init__(
        self,
        machine: Machine,
        memory: LoopMemory,
        *,
        virtual: bool = False,
        learned: Mapping[str, Sequence[float]] | None = None,
        driver_class: type[Driver] | None = None,
    ) -> None:
        self.machine = machine
        self.memory = memory
        self.virtual = virtual
        self.waits = machine.loop.waits and not virtual
        """Whether the machine's time stands still while the computer pauses."""
        self.successor: Callable[[int], Tick] | None = None
        """Asked between two ticks, with the number of the next, which tick goes on; None: this."""
        self.drivers = make_drivers(machine, driver_class)
        self.closed: set[str] = set()
        """Drivers that were closed and could not be opened anew."""
        self._doors: dict[str, Doors] = dict(self.drivers)
        axes = list(machine.axes.values())
        parameters = memory.layout["parameters"]
        self.settings = np.zeros(len(axes), AXIS_SETTINGS)
        self.axes = np.zeros(len(axes), AXIS_STATE)
        self.law_settings = np.zeros(len(axes), law_settings(parameters))
        lists = [axis.model for axis in axes]
        remembered = max(model.context_size for model in lists)
        self.beside = axes_beside(machine)
        self.laws = np.zeros(len(axes), law_state(parameters, remembered, self.beside.shape[1]))
        for i, axis in enumerate(axes):
            setup = machine.drivers[axis.driver]
            driver = self.drivers[axis.driver]
            device = driver.exchange_delay_periods, driver.watchdog_s
            fill_axis_settings(self.settings[i], axis, setup, machine.period_s, *device)
            self.settings[i]["group"] = machine.group_of(axis.name)
            self.settings[i]["stops_with_program"] = machine.stop_together is None
            self.axes[i]["slot"] = -1
            self.axes[i]["homed"] = self.settings[i]["absolute"]
            estimates = axis.estimates
            covariance = [e.covariance for e in estimates]
            fill_settings(
                self.law_settings[i],
                axis.model,
                period_s=machine.period_of(axis.name),
                lower=[e.lower for e in estimates],
                upper=[e.upper for e in estimates],
                covariance=covariance,
                given=axis.gains.flat() | axis.limits.flat() | axis.adaptation.flat(),
                travel_m=axis.limits.travel_m,
                command_filter=filter_of(axis.gains, machine.period_of(axis.name)),
            )
            theta = (learned or {}).get(axis.name, [e.initial for e in estimates])
            fill_state(self.laws[i], theta, covariance)
        dual = [i for i, axis in enumerate(axes) if axis.dual_drive is not None]
        self.dual_settings = np.zeros(len(dual), DUAL_SETTINGS)
        self.duals = np.zeros(len(dual), DUAL_STATE)
        for d, i in enumerate(dual):
            own = self.dual_settings[d], self.duals[d]
            fill_dual_drive(axes[i], self.settings[i], *own)
        self.watch = np.zeros(1, WATCH)
        if not virtual:
            silent_limit = round(machine.loop.patience_s * machine.rate_hz)
            self.watch["silent_limit"] = max(silent_limit, 1)  # 0 would be nobody to wait for
            policy = machine.loop.overrun_policy
            sizes = {"count": 0, "leaky_bucket": machine.loop.bucket_size, "stop": 1}
            self.watch["bucket_size"] = sizes[policy]
        self.measured_s = np.zeros((memory.ring_rows, 4))
        """Wall-clock turnaround, read, compute and write of each ring row, in virtual time too."""
        self._channels, self._arrays = self._make_arrays()
        self._in_place = [self._reads_and_writes()]
        # A machine without dual drives has a tick that knows nothing of them, and so with learning.
        self._more: tuple[Any, ...] = (self.dual_settings, self.duals) if dual else ()
        if any(axis.learning for axis in axes):
            self._more += (memory.learned,)
        self._finish = self._make_finish()
        self.go_on: Callable[[], None]
        """Count rows from here on; called between two ticks of which this one's is the second."""
        self.step = self._make_step(self._compiled())

    def _make_arrays(self) -> tuple[tuple[Any, ...], dict[str, tuple[Inputs, Outputs, int]]]:
        """Return the arrays that the tick begins with, and each driver's part of them."""
        count = sum(len(driver.channels) for driver in self.drivers.values())
        counts, index_counts = np.zeros(count, np.int64), np.zeros(count, np.int64)
        words = np.zeros(count, np.uint32)
        volts, enable = np.zeros(count), np.zeros(count, np.uint8)
        arrays: dict[str, tuple[Inputs, Outputs, int]] = {}
        axes = self.machine.axes.values()
        first = 0
        for name, driver in self.drivers.items():
            last = first + len(driver.channels)
            inputs, outputs = Inputs(0), Outputs(0)
            inputs.counts, inputs.index_counts = counts[first:last], index_counts[first:last]
            inputs.status = words[first:last]
            outputs.volts, outputs.enable = volts[first:last], enable[first:last]
            divisor = next(axis.divisor for axis in axes if axis.driver == name)
            arrays[name] = inputs, outputs, divisor
            first = last
        return (counts, index_counts, words, volts, enable), arrays

    def _compose(self) -> ModuleType:
        """Return the generated module."""
        axes = list(self.machine.axes.values())
        order = [channel.axis for driver in self.drivers.values() for channel in driver.channels]
        place = {name: i for i, name in enumerate(order)}
        return compose_tick(
            [axis.model for axis in axes],
            [place[name] for name in self.machine.axes],
            [axis.divisor for axis in axes],
            [place.get(name + SECOND_END) for name in self.machine.axes],
            [axis.learning is not None for axis in axes],
        )

    def _all_arguments(self) -> tuple[Any, ...]:
        """Return what a tick is called with, of the types of every later call."""
        memory = self.memory
        commands = (self.watch, memory.status, memory.mailbox, memory.replies)
        records = (self.settings, self.axes, self.law_settings, self.laws, self.beside)
        programs = (memory.segments, memory.segment_counts, memory.excitations)
        samples = (memory.samples, 0, memory.axis_status_rows)
        return (
            *self._channels,
            *(1, 0, False, 0, 0.0),
            *commands,
            *records,
            *programs,
            *samples,
            *self._more,
        )

    def _compiled(self) -> Callable[..., Any]:
        """Return the compiled tick, of these arguments alone."""
        module = self._compose()
        count = len(self.machine.axes)
        told = (
            f"motorctl: compiling the kernels of {count} {'axis' if count == 1 else 'axes'}, once "
            f"for this configuration: {compiling_words(count)}"
        )
        with compiling_told(told):
            return specialise(module.tick, *self._all_arguments())

    def packed(self) -> SentKernel:
        """Return the compiled tick as it is sent to another process."""
        return packed(self._compose().tick, *self._all_arguments())

    def with_other_models(
        self,
        settings: NDArray[np.void],
        law_settings: NDArray[np.void],
        laws: NDArray[np.void],
        beside: NDArray[np.int64],
        kernel: SentKernel,
    ) -> Tick:
        """Return a tick of the same machine, drivers, states and memory, with other laws.

        Parameters
        ----------
        settings, law_settings, laws, beside
            Its records, of its own.
        kernel
            What another tick of this machine has `packed`.
        """
        after = copy(self)
        after.successor = None
        after.settings, after.law_settings = settings, law_settings
        after.laws, after.beside = laws, beside
        after.step = after._make_step(unpacked(kernel, *after._all_arguments()))
        return after

    def _make_finish(self) -> Callable[..., Any]:
        rows_out = (self.memory.status, self.memory.ticks, self.measured_s)
        return specialise(publish, *rows_out, 0, 0, 0, 0.0, self.virtual, 0, 0, 0, 0, 0)

    def _make_step(self, kernel: Callable[..., Any]) -> Step:
        advances = [
            (driver.advance, self._arrays[name][2]) for name, driver in self.drivers.items()
        ]
        in_place = self._in_place
        memory = self.memory
        # Ordinary machines call it straight, without an argument or a step more.
        compute = partial(_with_more, kernel, self._more) if self._more else kernel
        virtual, finish = self.virtual, self._finish
        counts, index_counts, words, volts, enable = self._channels
        watch, status, mailbox, replies = self.watch, memory.status, memory.mailbox, memory.replies
        settings, axis_records, law_records = self.settings, self.axes, self.law_settings
        laws, beside = self.laws, self.beside
        segments, segment_counts = memory.segments, memory.segment_counts
        excitations = memory.excitations
        samples, ticks, axis_status = memory.samples, memory.ticks, memory.axis_status_rows
        measured, rows = self.measured_s, memory.ring_rows
        period_s, now = self.machine.period_s, time.monotonic_ns
        period_ns = round(period_s * NS_PER_S)
        waits = self.waits
        moves_time = virtual or waits
        written = 0

        def go_on() -> None:
            nonlocal written
            written = int(status["ring_head"][0])

        self.go_on = go_on

        def step(number: int, elapsed: int, overran: bool, scheduled_ns: int, woke_ns: int) -> bool:
            nonlocal written
            row = written % rows
            reads, writes = in_place[0]
            for read, inputs, divisor in reads:
                if divisor == 1 or number // divisor != (number - elapsed) // divisor:
                    read(inputs)
            t1 = now()
            behind = 0  # a machine that waits shows how it is now, however late that is
            if scheduled_ns and not waits:
                behind = (t1 - scheduled_ns) // period_ns - elapsed + 1
            may_end: bool = compute(
                counts, index_counts, words, volts, enable, elapsed, behind, overran, number,
                number * period_s, watch, status, mailbox, replies, settings, axis_records,
                law_records, laws, beside, segments, segment_counts, excitations, samples, row,
                axis_status,
            )  # fmt: skip
            t2 = now()
            for write, outputs, divisor in writes:
                if divisor == 1 or number // divisor != (number - elapsed) // divisor:
                    write(outputs)
            t3 = now()
            written += 1
            finish(
                status, ticks, measured, row, written, number, period_s, virtual,
                scheduled_ns, woke_ns, t1, t2, t3,
            )  # fmt: skip
            if moves_time:
                for advance, divisor in advances:
                    if divisor == 1 or (number + 1) % divisor == 0:
                        advance()
            return may_end

        return step

    def _reads_and_writes(self) -> tuple[Sequence[Move[Inputs]], Sequence[Move[Outputs]]]:
        doors, arrays = self._doors, self._arrays
        reads = [(doors[name].read, arrays[name][0], arrays[name][2]) for name in doors]
        writes = [(doors[name].write, arrays[name][1], arrays[name][2]) for name in doors]
        return reads, writes

    def put_in_place(self, name: str, doors: Doors) -> None:
        """Let the ticks from the next one on read and write there instead.

        It may be called from one other thread: a tick takes what is in place once, at its start.
        """
        self._doors[name] = doors
        self._in_place[0] = self._reads_and_writes()

    def notes_of(self, name: str) -> list[str]:
        """Return what a driver noted as it was opened last, a line each."""
        notes = self.drivers[name].notes
        lines = (notes,) if isinstance(notes, str) else notes or ()
        return [f"drivers.{name}: {' '.join(str(note).split())}" for note in lines]

    def prepare(self) -> None:
        """Do what is slow, for the drivers and for other models, before real time is entered."""
        know_arguments(*self._all_arguments())
        for driver in self.drivers.values():
            driver.prepare()

    def open(self, *, virtual: bool = False) -> None:
        """Open every driver; what was opened is made safe again where one fails."""
        opened: dict[str, Driver] = {}
        try:
            for name, driver in self.drivers.items():
                if virtual or self.waits:
                    driver.start_virtual_time()
                _open(name, driver)
                opened[name] = driver
        except BaseException:
            self.safe()
            _close(opened)
            raise

    def safe(self, *, busy: str | None = None) -> None:
        """Zero and disable every output; a driver that fails at it keeps no other from it."""
        self._make_safe(busy)

    def close(self, *, busy: str | None = None) -> None:
        """Make every output safe and release the devices.

        busy names a driver that another thread is opening: it is left to the end of the process,
        since until it is open its outputs are disabled. Raises RunError where a driver says that
        its outputs could not be zeroed and disabled, unless something else is being raised already.
        """
        raises_already = sys.exception() is not None
        unsafe = self._make_safe(busy)
        spared = {*self.closed, busy}
        try:
            _close({name: d for name, d in self.drivers.items() if name not in spared})
        finally:
            if unsafe and not raises_already:
                raise RunError("\n".join(unsafe))

    def _make_safe(self, busy: str | None) -> list[str]:
        """Return a sentence for each driver whose outputs could not be zeroed and disabled."""
        unsafe = []
        for name, driver in self.drivers.items():
            if name == busy:
                continue
            try:
                driver.safe()
                sent, why = driver.safe_sent, driver.safe_failed
            except Exception as error:  # a driver may break its contract in any way
                sent, why = False, f"{type(error).__name__}: {error}"
            if sent is False:  # one that does not tell is taken at its word
                why = why or "it does not say why"
                unsafe.append(f"driver {name}: the loop could not make its outputs safe: {why}")
        return unsafe


def _with_more(kernel: Callable[..., bool], more: tuple[object, ...], *given: object) -> bool:
    return kernel(*given, *more)


def _open(name: str, driver: Driver) -> None:
    """Open a driver; its error tells which one of the configuration's it is."""
    try:
        driver.open()
    except RunError as error:
        raise RunError(f"drivers.{name}: {error}") from error


def _close(drivers: Mapping[str, Driver]) -> None:
    """Close every driver, then raise the first error that one of them raised."""
    errors = []
    for driver in drivers.values():
        try:
            driver.close()
        except Exception as error:
            errors.append(error)
    if errors:
        raise errors[0]
