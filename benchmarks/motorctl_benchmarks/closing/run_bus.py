"""One bus: the loop closed through a daemon, then the same machine in virtual time."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import yaml

from motorctl.config import load_resolved
from motorctl.config.machine import Machine
from motorctl.errors import RunError
from motorctl.latency.progress import Progress
from motorctl_benchmarks.buses.device import device_running
from motorctl_benchmarks.buses.session import exchange_of
from motorctl_benchmarks.closing.gantries import HiddenGantry, document_of
from motorctl_benchmarks.running_daemon import MAIN, running_daemon

LONGEST_S = 3600.0
"""So long a loop may take. By hand: longer keeps who waits for one that hangs."""
JUDGED = ("eF", "L2[e]")
UNUSED = "unused"


@dataclass(frozen=True)
class Gain:
    """What the loop did to one error of one axis on the motion that no fit has used, [m]."""

    before_m: float
    after_m: float

    @property
    def left(self) -> float:
        """The part of it that is left."""
        return self.after_m / self.before_m


@dataclass(frozen=True)
class Closed:
    """What one loop came to."""

    errors: Mapping[str, Mapping[str, Gain]]
    """By axis and measure."""
    named: Mapping[str, tuple[str, ...]]
    rounds: int
    ended: str
    lasted_s: float
    motions: int = 0
    minutes: float = 0.0
    questions: int = 0
    """On a machine: motions, minutes of motion, and how often somebody had to be asked."""
    disturbed: float = 0.0
    """Part of a motion's rows that count for nothing, as samples were missing: the largest."""


@dataclass(frozen=True)
class BusClosed:
    """Both of a bus."""

    bus: str
    rate_hz: float
    hidden: Mapping[str, tuple[str, ...]]
    over_bus: Closed | None = None
    virtual: Closed | None = None
    failed: str = ""

    def worse(self, axis: str, measure: str) -> float:
        """Return what is left of an error over the bus, over what is left in virtual time."""
        assert self.over_bus is not None
        assert self.virtual is not None
        over, beside = (c.errors[axis][measure] for c in (self.over_bus, self.virtual))
        return over.left / beside.left

    @property
    def axes(self) -> tuple[str, ...]:
        """Those that were measured."""
        return () if self.over_bus is None else tuple(self.over_bus.errors)

    @property
    def questions(self) -> int:
        """How often somebody had to be asked."""
        return 0 if self.over_bus is None else self.over_bus.questions

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)


def close_over_bus(gantry: HiddenGantry, folder: Path, progress: Progress) -> BusClosed:
    """Close the loop behind a bus and in virtual time. Raises RunError where either fails."""
    hidden = {axis: tuple(effects) for axis, effects in gantry.hidden.items()}
    bus = BusClosed(gantry.transport.name, gantry.transport.rate_hz, hidden)
    with device_running(gantry.device(), folder) as endpoint:
        drivers = gantry.transport.driver(endpoint)
        delay_s = exchange_of(gantry.on_bus(drivers, 0.0)).delay_s
        config = _written(gantry.on_bus(drivers, delay_s), folder / "bus.yaml")
        with running_daemon(str(config), folder) as (_, client):
            over_bus = _closed(config, folder / "bus", "--socket", str(client.path), "--yes")
    progress(0.6)
    config = _written(gantry.direct(delay_s), folder / "direct.yaml")
    virtual = _closed(config, folder / "virtual")
    progress(1.0)
    return BusClosed(bus.bus, bus.rate_hz, bus.hidden, over_bus, virtual)


def _written(machine: Machine, path: Path) -> Path:
    document = document_of(machine)
    load_resolved(document, str(path), hardware=True)
    path.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
    return path


def _closed(config: Path, out: Path, *where: str) -> Closed:
    """Run the command as a user would, nobody at the terminal."""
    words = [sys.executable, "-P", "-c", MAIN, "close-loop", str(config), "--out", str(out)]
    began = time.monotonic()
    done = subprocess.run(
        [*words, "--force", "--json", *where],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=LONGEST_S,
        check=False,
    )
    (out.parent / f"{out.name}.stderr.txt").write_text(done.stderr, encoding="utf-8")
    (out.parent / f"{out.name}.json").write_text(done.stdout, encoding="utf-8")
    if done.returncode:
        said = done.stderr.strip().splitlines()
        raise RunError(f"close-loop: {said[-1] if said else f'status {done.returncode}'}")
    return closed_of(json.loads(done.stdout), time.monotonic() - began)


def closed_of(document: Mapping[str, Any], lasted_s: float) -> Closed:
    """Read what `close-loop --json` tells."""
    still: dict[str, Any] = {"motions": 0, "minutes": {}, "questions": 0, "disturbed_share": 0.0}
    moved = document["moved"] or still
    errors, named = {}, {}
    for name, axis in document["axes"].items():
        before, after = (axis["tracking"][UNUSED][when] for when in ("before", "after"))
        errors[name] = {symbol: Gain(before[symbol], after[symbol]) for symbol in JUDGED}
        named[name] = tuple(axis["effects"])
    return Closed(
        errors,
        named,
        len(document["rounds"]),
        document["ended"],
        lasted_s,
        moved["motions"],
        max(moved["minutes"].values(), default=0.0),
        moved["questions"],
        moved["disturbed_share"],
    )
