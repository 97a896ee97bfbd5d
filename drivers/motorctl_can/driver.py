"""The driver of axes on CAN: one exchange of frames a period."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from typing import ClassVar

import can
import numpy as np

from motorctl.hal import (
    Channel,
    DriverOptions,
    FirstAxis,
    FirstOptions,
    Inputs,
    NetworkInterface,
    Outputs,
    RateBudget,
    RunError,
    Status,
    kernels_cached,
    specialise,
)
from motorctl_can import budget, fits
from motorctl_can.bus import link_settings
from motorctl_can.bus_driver import CLOSED, SAFE_REPEATS, BusDriver
from motorctl_can.checks import missing_from_layout
from motorctl_can.codec_records import channels_of, frames_of, signals_of
from motorctl_can.first_options import first_options
from motorctl_can.layout import Frame
from motorctl_can.link import Link, now_s
from motorctl_can.options import CanOptions

with kernels_cached():
    from motorctl_can import kernels

AGE_PERIODS = 10
MOST_QUIET_PERIODS = 3
UNSENT_PERIODS = 3
"""So many more without room for the commands or SYNC than with it are a bus that is lost."""
OPENING_PERIOD_S = 0.01
EXTENDED = 1 << 29  # above every identifier
BABBLE = int(Status.CORRUPT)


class CanDriver(BusDriver):
    """Amplifiers and encoders on a CAN bus; see `CanOptions` and docs/drivers/can.md."""

    Options: ClassVar[type[DriverOptions]] = CanOptions

    def __init__(
        self, options: DriverOptions, channels: Sequence[Channel], period_s: float
    ) -> None:
        super().__init__(options, channels, period_s)
        assert isinstance(options, CanOptions)
        self._can = options
        self._layout = options.layout
        self.exchange_delay_periods = 0.0 if options.sync else 0.5
        self.longest_wait_s = options.sync.wait_s if options.sync else 0.0
        self.watchdog_s = options.watchdog_s
        self.sampled_apart_s = fits.sampled_apart_s(options, self.channels, period_s)
        age = options.max_age_s
        self._max_age_s = AGE_PERIODS * period_s if age is None else age or float("inf")
        self._took: Callable[..., int] = kernels.take
        self._refuse: Callable[..., None] = kernels.refuse
        self._sync_sent: Callable[..., None] = kernels.sync_sent
        self._settle: Callable[..., None] = kernels.settle
        self._deliver: Callable[..., None] = kernels.deliver
        self._encode: Callable[..., None] = kernels.encode

    @classmethod
    def first_options(cls, axes: Sequence[FirstAxis], period_s: float) -> FirstOptions:
        """Return a layout with a command and a state frame for each axis."""
        return first_options(axes, period_s)

    def rate_budget(self) -> RateBudget:
        """Compute the rate that bus and layout carry; docs/drivers/can.md has the arithmetic."""
        return budget.rate_budget(budget.traffic(self._can, self._layout))

    def problems(self) -> Sequence[tuple[tuple[str | int, ...], str]]:
        """Tell where layout, axes and period do not fit together."""
        return tuple(fits.problems(self._can, self.channels, self.period_s))

    def advice(self) -> Sequence[str]:
        """Tell which signals a layout for a safe machine would have besides."""
        return tuple(missing_from_layout(self._layout))

    def switches(self) -> Sequence[Status]:
        """Tell which switches and marks the layout carries."""
        return fits.switches(self._layout, self.channels)

    def network_interfaces(self) -> Sequence[NetworkInterface]:
        """Tell the SocketCAN interface, and the bit rates that it has to have."""
        if self._can.interface != "socketcan":
            return ()
        settings = link_settings(self._can, self._can.fd, self._can.data_bitrate)
        return (NetworkInterface(self._can.channel, settings),)

    def prepare(self) -> None:
        """Make tables and messages, and compile the codec or take it from the cache."""
        options, layout = self._can, self._layout
        states, commands = layout.states, layout.commands
        self._state_signals = signals_of(states, self.channels, 0.0)
        self._states = frames_of(states)
        self._records = channels_of(layout, self.channels)
        self._command_signals = signals_of(commands, self.channels, options.watchdog_s or 0.0)
        self._commands = frames_of(commands)
        self._numbers = {_key(f.identifier, f.extended): i for i, f in enumerate(states)}
        self._lengths = [frame.length for frame in states]
        self._rows = [np.zeros(frame.length, np.uint8) for frame in states]
        self._views = [row.data for row in self._rows]
        self._all_states = (1 << len(states)) - 1
        self._messages = [self._message(f.identifier, f.extended, f.length) for f in commands]
        self._payloads = [np.frombuffer(m.data, np.uint8) for m in self._messages]
        if options.sync is not None:
            self._sync = self._message(options.sync.id, options.sync.extended, 0)
            self._wait_s = options.sync.wait_s
        self._news = self._records["news"]
        self._nothing = Outputs(len(self.channels))
        self._shown = Inputs(len(self.channels))
        self._compile()
        self._quiet = 0
        self._unsent = 0
        self._asked = True  # SYNC found room in this period, or none was due
        self._late = 0

    def _compile(self) -> None:
        seen, asked = self._shown, self._nothing
        row = np.zeros(1, np.uint8)
        signals, states, records = self._state_signals, self._states, self._records
        self._took = specialise(kernels.take, signals, states, records, 0, row, 0)
        self._refuse = specialise(kernels.refuse, states, 0)
        self._sync_sent = specialise(kernels.sync_sent, states, records)
        self._settle = specialise(kernels.settle, states)
        shown = (seen.counts, seen.index_counts, seen.status)
        self._deliver = specialise(kernels.deliver, states, records, 0, *shown)
        asked_for = (asked.volts, asked.enable, row)
        sent = (self._command_signals, self._commands, 0)
        self._encode = specialise(kernels.encode, *sent, *asked_for)

    def _message(self, identifier: int, extended: bool, length: int) -> can.Message:
        return can.Message(
            arbitration_id=identifier,
            is_extended_id=extended,
            is_fd=self._can.fd,
            bitrate_switch=self._can.data_bitrate is not None,
            data=bytearray(length),
            is_rx=False,
        )

    def _begin(self, link: Link) -> None:
        """Set every amplifier to zero, and wait for the first of every state frame."""
        self.safe()
        self._await_device(link)

    def _linked(self, settle_s: float) -> Link:
        wanted = [(frame.identifier, frame.extended) for frame in self._layout.states]
        options = self._can
        return Link(options, wanted, settle_s, fd=options.fd, data_bitrate=options.data_bitrate)

    def _await_device(self, link: Link) -> None:
        deadline = time.monotonic() + self._can.open_timeout_s
        while True:
            self._send_all(link, self._nothing)
            if self._can.sync is not None:
                link.send(self._sync)
            self._drain_for(link, OPENING_PERIOD_S)
            missing = [
                frame
                for frame, record in zip(self._layout.states, self._states, strict=False)
                if not record["known"]
            ]
            if not missing:
                break
            if time.monotonic() > deadline:
                raise RunError(self._not_there(missing, link))
        # answers to the last SYNC have come or never will
        if self._can.sync is not None:
            self._drain_for(link, OPENING_PERIOD_S)
        self._settle(self._states)
        self._start_over()

    def _drain_for(self, link: Link, time_s: float) -> None:
        deadline = time.monotonic() + time_s
        while (left := deadline - time.monotonic()) > 0:
            message = link.receive(left)
            if message is not None:
                self._take(link, message, kernels.FREE, 0.0)
            elif link.lost:
                time.sleep(min(left, 1e-3))

    def _start_over(self) -> None:
        """Forget marks, news and troubles of the time before the first period."""
        self._records["event"] = 0
        self._records["news"] = 0
        self._records["shown"] = self._records["count"]
        self._states["refused"] = 0
        link = self._link
        assert link is not None
        link.lost = link.passing = 0

    def _not_there(self, missing: Sequence[Frame], link: Link) -> str:
        names = ", ".join(f"'{f.name}' ({f.address}, {f.length} B)" for f in missing)
        came = [f for i, f in enumerate(self._layout.states) if self._states[i]["refused"]]
        why = f"; of a wrong length came {', '.join(f.address for f in came)}" if came else ""
        if link.complaint is not None:
            why += f"; the bus says: {link.complaint}"
        rate = f", at {self._can.bitrate} bit/s" if link_has_rate(self._can) else ""
        sync = f" and answering SYNC 0x{self._can.sync.id:X}" if self._can.sync else ""
        return (
            f"CAN: {self._can.interface} channel '{self._can.channel}': no state frame {names} "
            f"within open_timeout_s = {self._can.open_timeout_s:g} s{why}; is the device "
            f"on{rate}{sync}?"
        )

    def _sent(self) -> Iterable[str]:
        sent = [frame.address for frame in self._layout.commands]
        if self._can.sync is not None:
            sent.append(f"0x{self._can.sync.id:X}")
        return sent

    def read(self, inputs: Inputs) -> None:
        """Fill `inputs` with the newest whole sample of each channel."""
        link = self._link
        if link is None:
            inputs.status[:] = CLOSED
            return
        now = now_s()
        if self._can.sync is None:
            if not self._drain(link, kernels.FREE, now, self._can.max_frames_per_read):
                self._news[:] = 0  # there may be newer ones behind what was taken
        else:
            self._exchange(link, now)
        common = link.status
        link.passing = 0
        self._deliver(
            self._states,
            self._records,
            common,
            inputs.counts,
            inputs.index_counts,
            inputs.status,
        )

    def write(self, outputs: Outputs) -> None:
        """Send every command frame."""
        link = self._link
        if link is not None:
            whole = self._send_all(link, outputs) and self._asked
            self._asked = True
            # A bus that has room now and then is lost as well, only later.
            unsent = self._unsent - 1 if whole else self._unsent + 1
            self._unsent = min(max(unsent, 0), UNSENT_PERIODS)
            if self._unsent == UNSENT_PERIODS:
                link.lose_commands()

    def _send_off(self, link: Link) -> bool:
        whole = [self._send_all(link, self._nothing) for _ in range(SAFE_REPEATS)]
        return any(whole)

    def _send_all(self, link: Link, outputs: Outputs) -> bool:
        whole = True
        volts, enable = outputs.volts, outputs.enable
        for i, message in enumerate(self._messages):
            signals, frames = self._command_signals, self._commands
            self._encode(signals, frames, i, volts, enable, self._payloads[i])
            whole = link.send(message) and whole
        return whole

    def _drain(self, link: Link, phase: int, now: float, room: int) -> int:
        """Take the waiting frames, at most `room`; return how many more may be taken."""
        while room > 0:
            message = link.receive(0)
            if message is not None:
                self._take(link, message, phase, now)
            elif not link.more():
                return room
            room -= 1
        link.passing |= BABBLE
        return 0

    def _exchange(self, link: Link, now: float) -> None:
        """Send SYNC and take the answers."""
        self._late = 0
        room = self._drain(link, kernels.BEFORE_SYNC, now, self._can.max_frames_per_read)
        if self._quiet:
            self._wait_for_quiet()
            return
        self._asked = link.send(self._sync)
        if not self._asked:
            return
        self._sync_sent(self._states, self._records)
        deadline = time.monotonic() + self._wait_s
        missing = self._all_states
        self._late = 0
        while missing:
            if room <= 0:
                link.passing |= BABBLE
                break
            left = deadline - time.monotonic()
            message = link.receive(left if left > 0 else 0)
            if message is not None:
                room -= 1
                missing &= ~self._take(link, message, kernels.AFTER_SYNC, now)
            elif left <= 0 or link.lost:
                break
        if self._late & missing:
            self._quiet = self._patience()

    def _wait_for_quiet(self) -> None:
        """Let a period pass without SYNC: until all is here that was on its way, or none comes."""
        owed = self._patience()
        self._quiet = owed if self._late else min(owed, self._quiet - 1)
        if not self._quiet:
            self._settle(self._states)

    def _patience(self) -> int:
        """Return after how many silent periods the answers still owed count as lost."""
        return min(int(self._states["owed"].max()), MOST_QUIET_PERIODS)

    def _take(self, link: Link, message: can.Message, phase: int, now: float) -> int:
        """Decode one frame; return the bit of its state frame if it brought a sample, else 0."""
        if message.is_error_frame:
            link.error_frame(message)
            return 0
        identifier = message.arbitration_id
        if message.is_extended_id:
            identifier |= EXTENDED
        number = self._numbers.get(identifier)
        if number is None or message.is_remote_frame:
            return 0
        data = message.data
        length = self._lengths[number]
        if len(data) != length or message.dlc != length:
            self._refuse(self._states, number)
            return 0
        stamp = message.timestamp
        if stamp and now - stamp > self._max_age_s:
            self._refuse(self._states, number)
            return 0
        self._views[number][:] = data
        row = self._rows[number]
        found = self._took(self._state_signals, self._states, self._records, number, row, phase)
        if found == kernels.ACCEPTED:
            link.lost = 0
            return 1 << number
        if found == kernels.LATE:
            link.lost = 0
            self._late |= 1 << number
        return 0


def link_has_rate(options: CanOptions) -> bool:
    """Tell whether a wrong bit rate could be why nothing is heard."""
    return options.interface not in budget.HOST_COST_S


def _key(identifier: int, extended: bool) -> int:
    return identifier | EXTENDED if extended else identifier
