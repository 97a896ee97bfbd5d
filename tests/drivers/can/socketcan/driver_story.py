"""The driver on vcan0 against can-utils; writes what it saw, and judges nothing."""

from __future__ import annotations

import json
import math
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from can_tools import candump, cansend, shell, started, up
from page_layouts import classic_driver, fd_driver

from motorctl.hal import Inputs, Outputs, RunError
from motorctl_can import CanDriver

RESULT = Path(sys.argv[1])
FIRST = "180#0000000000000100"  # counts 0 and 0, chain closed, sequence 0
# Answers the first command frame that it hears with the first state frame.
FIRST_ANSWER = f"candump -n 1 vcan0,200:7FF > /dev/null && cansend vcan0 {FIRST}"
# A device in shell: for the k-th SYNC it sends counts 10 k and -k, and sequence k.
FD_DEVICE = r"""
candump -L vcan0,080:7FF | while read -r _; do
    k=$((k + 1)) x=$((10 * k)) y=$((-k))
    printf -v state '%02X%02X0000%02X%02X%02X%02X0011%02X00' $((x & 255)) $((x >> 8)) \
        $((y & 255)) $((y >> 8 & 255)) $((y >> 16 & 255)) $((y >> 24 & 255)) $((k & 255))
    cansend vcan0 "180##1$state"
done
"""


class Bench:
    """A driver, and every sample that it gave."""

    def __init__(self, driver: CanDriver) -> None:
        self.driver = driver
        self.seen: dict[str, list[Any]] = {}
        self._inputs, self._outputs = Inputs(2), Outputs(2)

    def read(self, what: str) -> list[Any]:
        """Read, and note the sample."""
        self.driver.read(self._inputs)
        self.seen[what] = [self._inputs.counts.tolist(), self._inputs.status.tolist()]
        return self.seen[what]

    def hear(self, what: str, *frames: str) -> None:
        """Let the peer send frames, read, and note the sample."""
        cansend(*frames)
        self.read(what)

    def write(self, x: float, y: float, enable: tuple[int, int] = (1, 1)) -> None:
        """Write once."""
        self._outputs.volts[:], self._outputs.enable[:] = (x, y), enable
        self.driver.write(self._outputs)


@contextmanager
def opened_classic(**changes: Any) -> Iterator[Bench]:
    """Open the classic driver against a peer that answers once."""
    bench = Bench(classic_driver(**changes))
    with started(FIRST_ANSWER):
        time.sleep(0.5)
        bench.driver.open()
    try:
        bench.read("at first")
        yield bench
    finally:
        bench.driver.close()


def commands() -> dict[str, Any]:
    """Send commands of all kinds; candump's log tells what went over the bus."""
    with candump(RESULT / "commands.log"), opened_classic() as bench:
        bench.write(1.0, -1.0)
        bench.write(5.0, -5.0, (1, 0))
        bench.write(1000.0, -1000.0)
        bench.write(math.nan, 2.0)
        for _ in range(260):
            bench.write(0.0005, -0.0005)
    return bench.seen


def states() -> dict[str, Any]:
    """Hear good state frames and others."""
    with opened_classic() as bench:
        bench.hear("ordinary", "180#0A0000F6FFFF0101")
        bench.read("nothing new")
        bench.hear("limits of 24 bits", "180#000080FFFF7F0102")
        bench.hear("chain open", "180#0100000200000003")
        bench.hear("repeated", "180#0500000500000103")
        bench.hear("backwards", "180#0500000500000102")
        bench.hear(
            "newest of three",
            "180#0300000300000104",
            *(f"180#0{k}00000{k}0000010{k}" for k in (5, 6)),
        )
        bench.hear("too short", "180#01020304050607")
        bench.hear("29 bits", "00000180#0700000700000107")
        bench.hear("remote", "180#R8")
        bench.hear("other identifier", "181#0700000700000107")
        bench.hear("FD frame on a classic bus", "180##00700000700000107")
        bench.hear("after all that", "180#0700000700000107")
        cansend("180#0800000800000108")
        time.sleep(3.5)
        bench.read("too old")
        bench.hear("fresh", "180#0900000900000109")
    return bench.seen


def filters() -> dict[str, Any]:
    """Hear state frames among thousands of frames for others."""
    floods = ("-I 181 -L 8", "-I 580", "-e -I 180", "-I 001 -L 8")
    with candump(RESULT / "flood.log"), opened_classic(max_frames_per_read=4) as bench:
        for flood in floods:
            shell(f"cangen vcan0 -g 0 -n 1000 {flood}")
        bench.read("after a flood")
        bench.hear("a sample after the flood", "180#0100000100000101")
        with started("exec cangen vcan0 -g 1 -I 181 -L 8"):
            for k in range(2, 12):
                bench.hear(f"sample {k} in the flood", f"180#{k:02X}0000{k:02X}000001{k:02X}")
    return bench.seen


def down() -> dict[str, Any]:
    """Take the interface down, up, away, and make it anew."""
    with opened_classic() as bench:
        bench.hear("before", "180#0100000100000101")
        shell("ip link set vcan0 down")
        for k in range(3):
            bench.read(f"down {k}")
            bench.write(1.0, 1.0)
        bench.driver.safe()
        up()
        bench.read("up, nothing heard")
        with candump(RESULT / "up.log"):
            bench.write(1.0, 1.0)
            bench.hear("up and heard", "180#0200000200000102")
        bench.read("up, nothing more")
        shell("ip link del vcan0")
        for k in range(3):
            bench.read(f"gone {k}")
            bench.write(1.0, 1.0)
        up()
        bench.write(1.0, 1.0)
        bench.hear("made anew", "180#0300000300000103")
    with opened_classic() as again:
        again.hear("made anew and opened", "180#0400000400000104")
    bench.driver.safe()
    return {**bench.seen, **again.seen}


def troubles() -> dict[str, Any]:
    """Let the bus tell of errors, and the interface have no room."""
    with opened_classic() as bench:
        bench.hear("bus-off", "20000040#0000000000000000")
        bench.read("bus-off lasts")
        bench.hear("restarted", "20000100#0000000000000000")
        bench.hear("bus-off again", "20000040#0000000000000000")
        bench.hear("heard after bus-off", "180#0100000100000101")
        bench.hear("warning", "20000004#0008000000000000", "180#0200000200000102")
        shell("tc qdisc add dev vcan0 root pfifo limit 0")
        for k in range(3):
            bench.write(1.0, 1.0)
            bench.read(f"no room {k}")
        shell("tc qdisc del dev vcan0 root")
        bench.write(1.0, 1.0)
        bench.hear("room again", "180#0300000300000103")
    return bench.seen


def flexible() -> dict[str, Any]:
    """Exchange over CAN FD with SYNC."""
    bench = Bench(fd_driver())
    with candump(RESULT / "fd.log"), started(FD_DEVICE):
        time.sleep(0.5)
        bench.driver.open()
        try:
            for k in range(10):
                bench.read(f"sample {k}")
                bench.write(1.0, -1.0)
        finally:
            bench.driver.close()
    left = Bench(fd_driver(sync={"id": 0x80, "wait_s": 0.3}))
    with started(FD_DEVICE):
        time.sleep(0.5)
        left.driver.open()
    left.read("device gone")
    left.driver.close()
    return {**bench.seen, **left.seen}


def refused() -> dict[str, Any]:
    """Open where there is no device, and no interface that is up."""
    told = {}
    shell("ip link set vcan0 down")
    for what in ("down", "silent"):
        if what == "silent":
            up()
        try:
            classic_driver(open_timeout_s=0.3).open()
        except RunError as error:
            told[what] = str(error)
    return told


def main() -> None:
    scenes: tuple[Callable[[], dict[str, Any]], ...] = (
        commands,
        states,
        filters,
        down,
        troubles,
        flexible,
        refused,
    )
    for scene in scenes:
        began = time.monotonic()
        try:
            up()
            told = scene()
        except Exception:
            told = {"failed": traceback.format_exc()}
        (RESULT / f"{scene.__name__}.json").write_text(json.dumps(told))
        print(f"{scene.__name__}: {time.monotonic() - began:.1f} s", flush=True)
    (RESULT / "driver.done").touch()


if __name__ == "__main__":
    main()
