"""Getting to know the device: HELLO, its answer, what speaks against it, the first sample."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

from numpy.typing import NDArray

from motorctl.hal import Channel, RunError
from motorctl_serial import receiver
from motorctl_serial.frames import frame_of
from motorctl_serial.options import MODES, SerialOptions
from motorctl_serial.port import Port
from motorctl_serial.protocol import (
    VERSION,
    Capabilities,
    ErrorCode,
    FrameType,
    Refusal,
    capabilities,
    hello,
    refusal,
)
from motorctl_serial.receiver import News

HELLO_EVERY_S = 0.25
"""Between tries; some devices start anew when their port is opened, and take a second for it."""
FIRST_SAMPLE_S = 0.1
TRIES = 5


def begin(
    port: Port,
    rx: NDArray[Any],
    options: SerialOptions,
    channels: Sequence[Channel],
    period_s: float,
    sequence: int,
) -> tuple[Capabilities, int]:
    """Begin a session of as many channels as the highest number needs.

    Parameters
    ----------
    port
        The open port.
    rx
        The receiver, which is reset.
    options
        The driver's options.
    channels
        The channels that axes use.
    period_s
        Of the loop [s].
    sequence
        Sequence number of the first HELLO.

    Returns
    -------
    device : Capabilities
        The device's answer.
    sequence : int
        The sequence number after the last one used.

    Raises
    ------
    RunError
        The device does not answer, or does not fit.
    """
    receiver.forget(rx)
    wanted = max(channel.number for channel in channels) + 1
    period_us = max(1, round(period_s * 1e6))
    port.discard_input()
    deadline_s = time.monotonic() + options.connect_s
    heard = False
    while time.monotonic() < deadline_s and not port.gone:
        body = hello(sequence, wanted, MODES[options.mode], options.watchdog_ms, period_us)
        port.write(b"\0" + frame_of(body))
        asked, sequence = sequence, (sequence + 1) & 0xFF
        until_s = min(deadline_s, time.monotonic() + HELLO_EVERY_S)
        while (news := listen(port, rx, until_s)) is not None:
            heard = True
            if news & News.ERROR:
                said = refusal(rx["error"][0].tobytes())
                if (said.about_type, said.about_sequence) == (FrameType.HELLO, asked):
                    raise RunError(_refused(options, said))
            if news & News.CAPABILITIES:
                device = capabilities(rx["capabilities"][0].tobytes())
                if device.answers == asked and device.watchdog_ms:
                    _check(device, options, channels, period_s)
                    rx["channels"] = wanted
                    rx["counter_bits"] = device.counter_bits
                    rx["boot_id"] = device.boot_id
                    return device, sequence
    if port.gone:
        raise RunError(f"port {options.port}: it vanished while it was opened")
    what = "what it sends is no answer" if heard else "nothing came"
    raise RunError(
        f"port {options.port}: no device answered within connect_s: {options.connect_s:g} s "
        f"({what}); is baud: {options.baud} the device's?"
    )


def first_sample(
    port: Port, rx: NDArray[Any], options: SerialOptions, ask: Callable[[], None]
) -> None:
    """Ask until a sample has come. Raises RunError where none comes, or the device refuses."""
    for _ in range(TRIES):
        ask()
        until_s = time.monotonic() + FIRST_SAMPLE_S
        while (news := listen(port, rx, until_s)) is not None:
            if news & News.FRESH:
                return
            if news & News.ERROR:
                said = refusal(rx["error"][0].tobytes())
                raise RunError(
                    f"port {options.port}: mode: {options.mode} is refused: {said.in_words()}"
                )
    raise RunError(
        f"port {options.port}: the device answers HELLO, but sends no valid STATE in mode: "
        f"{options.mode}"
    )


def listen(port: Port, rx: NDArray[Any], until_s: float) -> int | None:
    """Take what comes next; None when the time is over or the port has vanished."""
    remaining_s = until_s - time.monotonic()
    if remaining_s <= 0.0 or not port.wait(remaining_s):
        return None
    size = port.read()
    if size == 0:
        port.look()
        return None if port.gone else 0
    return int(receiver.take(rx, port.chunk, size))


def _refused(options: SerialOptions, said: Refusal) -> str:
    if said.code == ErrorCode.VERSION:
        return (
            f"port {options.port}: the device speaks versions {said.detail & 255} to "
            f"{said.detail >> 8} of the protocol, this driver speaks version {VERSION}"
        )
    return f"port {options.port}: the device refuses the session: {said.in_words()}"


def _check(
    device: Capabilities, options: SerialOptions, channels: Sequence[Channel], period_s: float
) -> None:
    here = f"port {options.port}: device '{device.name}'"
    if not device.lowest <= VERSION <= device.highest:
        raise RunError(
            f"{here} speaks versions {device.lowest} to {device.highest} of the protocol, this "
            f"driver speaks version {VERSION}"
        )
    if not device.modes & MODES[options.mode]:
        raise RunError(f"{here} has no mode: {options.mode}")
    if device.watchdog_ms != options.watchdog_ms:
        raise RunError(
            f"{here} armed its watchdog with {device.watchdog_ms} ms, watchdog_s: "
            f"{options.watchdog_s:g} asks for {options.watchdog_ms} ms; ask for what it can do"
        )
    # The period in HELLO is whole microseconds; a rate is not refused for their rounding.
    if 1.0 / period_s > device.max_rate_hz * (1.0 + 1e-6):
        raise RunError(
            f"{here} carries at most {device.max_rate_hz} Hz, the configured rate is "
            f"{1.0 / period_s:g} Hz; lower rate_hz"
        )
    for channel in channels:
        axis = f"axis '{channel.axis}'"
        if channel.number >= device.channels:
            raise RunError(
                f"{here} has {device.channels} channels, {axis} has channel: {channel.number} "
                "(they count from 0)"
            )
        if channel.counter_bits != device.counter_bits:
            raise RunError(
                f"{here} has counters of {device.counter_bits} bits, {axis} says counter_bits: "
                f"{channel.counter_bits}"
            )
        if channel.max_voltage_v > device.full_scale_v * (1.0 + 1e-6):
            raise RunError(
                f"{here} has a full scale of {device.full_scale_v:g} V, {axis} has "
                f"max_voltage_v: {channel.max_voltage_v:g}"
            )
