"""Measure this machine: the loop process, and cyclictest before and after it."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from motorctl.config.machine import Machine
from motorctl.errors import RunError, UsageError
from motorctl.latency.advice import kernel_advice, spin_advice, theft_advice
from motorctl.latency.cyclictest import (
    INSTALL,
    Rival,
    cyclictest_command,
    rival_of,
    run_cyclictest,
)
from motorctl.latency.host import host_facts
from motorctl.latency.keep import keep_latency
from motorctl.latency.loop_run import LoopRun, run_loop
from motorctl.latency.progress import Progress, part_of
from motorctl.latency.result import LATE_S, Latency
from motorctl.latency.ticks import read_ticks
from motorctl.log.folder import must_be_writable
from motorctl.loop.realtime import chosen_cpu

SHORTEST_S = 0.5


@dataclass(frozen=True)
class LatencyOptions:
    """What a user may choose."""

    duration_s: float = 60.0
    log: Path | None = None
    """Where to keep the log of every tick; None: it is read and thrown away."""
    out: Path | None = None
    """The folder for latency.png and latency.json; None: they are not written."""
    beside_cyclictest: bool = True
    move_devices: bool = False
    """Start axes also where a driver is not a simulated one."""


def measure_latency(machine: Machine, options: LatencyOptions, progress: Progress) -> Latency:
    """Run the loop for a while, and cyclictest for half as long before and after it.

    Both get the same CPU, priority and period, one after the other, so that neither disturbs the
    other.

    Parameters
    ----------
    machine
        The configured machine; its axes are started where its drivers are simulated ones,
        or where `options` allow it.
    options
        Duration [s], and where log and figures are kept.
    progress
        Told the share that is done, 0 to 1.

    Returns
    -------
    Latency
        Lateness and turnaround of the loop, those of cyclictest where it is installed, and advice.

    Raises
    ------
    UsageError
        Where a duration is too short or a folder cannot be written to.
    RunError
        Where the loop fails, an axis trips, or no tick fell into the measurement.
    """
    if not SHORTEST_S <= options.duration_s < float("inf"):
        raise UsageError(f"duration {options.duration_s:g} s: must be at least {SHORTEST_S:g} s")
    for folder in (options.log.parent if options.log else None, options.out):
        if folder is not None:
            must_be_writable(folder)
    if machine.loop.waits:  # measured is what a machine of metal would bear
        settings = machine.loop.model_copy(update={"without_realtime": "degrade"})
        machine = replace(machine, loop=settings)
    cpu = chosen_cpu(machine.loop)
    host = host_facts()
    limits_s = (*LATE_S, machine.period_s)
    interval_us = round(machine.period_s * 1e6)
    moving = options.move_devices or all(d.cls.simulated for d in machine.drivers.values())
    with ExitStack() as stack:
        log = options.log
        if log is None:
            temporary = stack.enter_context(tempfile.TemporaryDirectory(prefix="motorctl-"))
            log = Path(temporary) / "latency.parquet"

        def loop(share: Progress) -> LoopRun:
            return run_loop(machine, log, options.duration_s, moving=moving, progress=share)

        rival: Rival | None = None
        without = "cyclictest was not asked for"
        command = cyclictest_command(cpu, machine.loop.priority, interval_us)
        if not options.beside_cyclictest:
            run = loop(progress)
        elif command is None:
            without = INSTALL
            run = loop(progress)
        else:
            run, documents, without = _in_turn(command, options.duration_s, loop, progress)
            if documents:
                rival = rival_of(command, documents, limits_s, interval_us)
        times = read_ticks(run, next(iter(machine.axes)), limits_s)
    if times.lateness.total == 0:
        raise RunError("no tick fell into the time of the measurement: the loop stood still")
    latency = Latency(
        machine=machine,
        host=host,
        cpu=cpu,
        duration_s=options.duration_s,
        moving=moving,
        log=options.log,
        run=run,
        times=times,
        rival=rival,
        without_rival=without if rival is None else None,
        advice=(
            *theft_advice(run.stolen_share, cpu),
            *kernel_advice(cpu),
            *spin_advice(
                machine.loop.spin_s, machine.period_s, times.lateness.share_beyond(LATE_S[0])
            ),
        ),
    )
    if options.out is not None:
        keep_latency(latency, options.out)
    return latency


def _in_turn(
    command: list[str],
    duration_s: float,
    loop: Callable[[Progress], LoopRun],
    progress: Progress,
) -> tuple[LoopRun, list[dict[str, object]], str]:
    """Run cyclictest, the loop and cyclictest; gives the loop's run, both documents or why not."""
    documents = []
    why = ""
    try:
        documents.append(run_cyclictest(command, duration_s / 2))
    except RunError as error:
        why = str(error)
    progress(0.25)
    run = loop(part_of(progress, 0.25, 0.75))
    if documents:
        try:
            documents.append(run_cyclictest(command, duration_s / 2))
        except RunError as error:
            why, documents = str(error), []
    progress(1.0)
    return run, documents, why
