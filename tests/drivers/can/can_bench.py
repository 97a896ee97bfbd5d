"""A bench for tests of the CAN driver: layouts, and a device on the `virtual` interface."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import can
import numpy as np
import pytest
import real_time
from pydantic import ValidationError

from motorctl.hal import Channel, Inputs, Outputs
from motorctl_can import CanDriver, CanOptions

PERIOD_S = 1e-3
COMMAND, STATE, STATE_Y, SYNC = 0x200, 0x180, 0x181, 0x80
NUMBERS = itertools.count()


def bits(
    means: str, start: int, count: int, axis: str | None = None, **more: Any
) -> dict[str, Any]:
    signal = {"means": means, "start": start, "bits": count, **more}
    return signal if axis is None else {**signal, "axis": axis}


def command_frame(identifier: int = COMMAND) -> dict[str, Any]:
    return {
        "id": identifier,
        "direction": "command",
        "length": 6,
        "signals": {
            "volts_x": bits("volts", 0, 16, "x", signed=True, scale=0.0005),
            "volts_y": bits("volts", 16, 16, "y", signed=True, scale=0.0005),
            "enable_x": bits("enable", 32, 1, "x"),
            "enable_y": bits("enable", 33, 1, "y"),
            "sequence": bits("sequence", 40, 8),
        },
    }


def state_frame(identifier: int = STATE) -> dict[str, Any]:
    """Counts of 24 bits, a byte of flags, sequence; all fits a classic frame."""
    return {
        "id": identifier,
        "direction": "state",
        "length": 8,
        "signals": {
            "counts_x": bits("counts", 0, 24, "x", signed=True),
            "counts_y": bits("counts", 24, 24, "y", signed=True),
            "encoder_x": bits("encoder_lost", 48, 1, "x"),
            "fault_y": bits("amplifier_fault", 49, 1, "y"),
            "chain": bits("estop", 50, 1, inverted=True),
            "boot": bits("boot", 52, 4),
            "sequence": bits("sequence", 56, 8),
        },
    }


def frames_of_both() -> dict[str, Any]:
    return {"command": command_frame(), "positions": state_frame()}


def frames_apart() -> dict[str, Any]:
    """One state frame an axis, with 32 bits of counts and no boot counter."""
    frames = {"command": command_frame()}
    for axis, identifier in (("x", STATE), ("y", STATE_Y)):
        frames[f"state_{axis}"] = {
            "id": identifier,
            "direction": "state",
            "length": 5,
            "signals": {
                f"counts_{axis}": bits("counts", 0, 32, axis, signed=True),
                f"sequence_{axis}": bits("sequence", 32, 8),
            },
        }
    return frames


def options(**given: Any) -> CanOptions:
    # a busy machine may take long between sending and reading; one test is about age
    usual = {"interface": "virtual", "channel": f"bench-{next(NUMBERS)}", "max_age_s": 0}
    data = {**usual, **given}
    if "frames" not in data and "dbc" not in data:
        data["frames"] = frames_of_both()
    return CanOptions.model_validate(data)


def channels(counter_bits: int = 24, axes: str = "xy") -> list[Channel]:
    return [Channel(a, i, 0.5e-6, counter_bits, 10.0) for i, a in enumerate(axes)]


def state_bytes(
    x: int, y: int, sequence: int, flags: int = 0, boot: int = 1, chain: int = 1
) -> bytes:
    word = x & 0xFFFFFF | (y & 0xFFFFFF) << 24
    word |= (flags & 3 | chain << 2 | boot << 4) << 48 | (sequence & 255) << 56
    return word.to_bytes(8, "little")


def lone_bytes(count: int, sequence: int) -> bytes:
    return (count & 0xFFFFFFFF).to_bytes(4, "little") + bytes([sequence & 255])


@contextmanager
def bus(channel: str, interface: str = "virtual", **more: Any) -> Iterator[can.BusABC]:
    opened = can.Bus(interface=interface, channel=channel, ignore_config=True, **more)
    try:
        yield opened
    finally:
        opened.shutdown()


def message(data: bytes, identifier: int = STATE, **more: Any) -> can.Message:
    return can.Message(arbitration_id=identifier, is_extended_id=False, data=data, **more)


class Bench:
    """A driver without SYNC, opened against state frames that the test sends by itself."""

    def __init__(self, given: CanOptions, peer: can.BusABC, counter_bits: int = 24) -> None:
        self.driver = CanDriver(given, channels(counter_bits), PERIOD_S)
        self.peer = peer
        self.inputs, self.outputs = Inputs(2), Outputs(2)

    def send(self, data: bytes, identifier: int = STATE, **more: Any) -> None:
        self.peer.send(message(data, identifier, **more))

    def read(self) -> tuple[list[int], list[int]]:
        self.driver.read(self.inputs)
        return self.inputs.counts.tolist(), self.inputs.status.tolist()

    def sent(self) -> list[can.Message]:
        """Return every frame that has come to the peer since the last call."""
        return list(iter(lambda: self.peer.recv(0), None))


@contextmanager
def opened(
    first: Mapping[int, bytes] | None = None, counter_bits: int = 24, **given: Any
) -> Iterator[Bench]:
    """Open a bench; `first` are the state frames that wait for it, by identifier."""
    chosen = options(**given)
    with bus(chosen.channel) as peer:
        bench = Bench(chosen, peer, counter_bits)
        with answering(peer, first or {STATE: state_bytes(0, 0, 0)}):
            bench.driver.open()
        try:
            bench.read()
            bench.sent()
            yield bench
        finally:
            bench.driver.close()


@contextmanager
def opened_apart(**given: Any) -> Iterator[Bench]:
    first = {STATE: lone_bytes(0, 0), STATE_Y: lone_bytes(0, 0)}
    with opened(first, 32, frames=frames_apart(), **given) as bench:
        yield bench


@contextmanager
def answering(peer: can.BusABC, first: Mapping[int, bytes]) -> Iterator[None]:
    """Send the first state frames, again and again, while the driver asks to be heard."""

    def answer() -> None:
        while not stop.is_set():
            if peer.recv(0.01) is not None:
                for identifier, data in first.items():
                    peer.send(message(data, identifier))

    stop = threading.Event()
    real_time.begins()
    thread = threading.Thread(target=answer)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


class Device:
    """A device that answers SYNC, as docs/drivers/can.md describes it, in a thread of its own.

    `answer` gives the frames for one SYNC; without it, each has counts 10 k and 20 k.
    """

    def __init__(
        self,
        peer: can.BusABC,
        answer: Callable[[int], list[can.Message]] | None = None,
        sync: int = SYNC,
    ) -> None:
        self.samples = 0
        self.commands: list[can.Message] = []
        self.answer = answer or self.usual
        self._peer, self._sync = peer, sync
        self._stop = threading.Event()
        real_time.begins()
        self._thread = threading.Thread(target=self._serve)

    def usual(self, k: int) -> list[can.Message]:
        return [message(state_bytes(10 * k, 20 * k, k))]

    def _serve(self) -> None:
        while not self._stop.is_set():
            got = self._peer.recv(0.02)
            if got is None:
                continue
            if got.arbitration_id != self._sync:
                self.commands.append(got)
                del self.commands[:-1000]
                continue
            self.samples += 1
            for out in self.answer(self.samples):
                self._peer.send(out)

    def __enter__(self) -> Device:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()


@contextmanager
def on_sync(
    answer: Callable[[int], list[can.Message]] | None = None, wait_s: float = 0.2, **given: Any
) -> Iterator[tuple[Bench, Device]]:
    """Open a driver with SYNC against a device that answers.

    The wait is generous, since the machine that runs the tests may be busy.
    """
    chosen = options(sync={"id": SYNC, "wait_s": wait_s}, **given)
    counter_bits = 32 if "frames" in given else 24
    with bus(chosen.channel) as peer, Device(peer, answer) as device:
        bench = Bench(chosen, peer, counter_bits)
        bench.driver.open()
        try:
            yield bench, device
        finally:
            bench.driver.close()


def random_bytes(seed: int, rows: int, length: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (rows, length), np.uint8)


def told(given: dict[str, Any], context: Any = None) -> list[tuple[str, str]]:
    """Return key and message of each mistake in options that are refused."""
    with pytest.raises(ValidationError) as caught:
        CanOptions.model_validate(given, context=context)
    return [(".".join(map(str, e["loc"])), e["msg"]) for e in caught.value.errors()]
