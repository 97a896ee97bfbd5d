"""Where an axis is excited: in virtual time, or through a running daemon. Either gives a log."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from motorctl.config import Machine
from motorctl.config.experiment_envelope import beyond_envelope
from motorctl.config.metadata import log_axes, log_metadata
from motorctl.daemon.client import Client, DaemonRefusedError
from motorctl.daemon.recorded_rows import ON_DISK_S, cut_rows, partial_log
from motorctl.errors import RunError, UsageError
from motorctl.log import LogWriter
from motorctl.log.partial import SUFFIX
from motorctl.loop.plan import plan_program
from motorctl.loop.virtual import VirtualMachine
from motorctl.motion import Trajectory
from motorctl.response.plan import ResponsePlan

Progress = Callable[[str, float], None]

POLL_S = 0.1
"""Between two looks at a daemon [s]. Shorter asks more often than anybody sees, longer is late."""
AFTER_S = 0.2
"""Rows recorded after the end [s]; any that are more than none would do."""


def beyond_allowed(machine: Machine, plan: ResponsePlan, reference_m: float) -> list[str]:
    """Return what of a measurement nobody has allowed beforehand, each in a sentence.

    Parameters
    ----------
    machine
        Whose axis is excited.
    plan
        How.
    reference_m
        Where the axis holds [m]; it is led from there to where the motion begins.

    Returns
    -------
    list of str
        Empty where the machine is simulated, or the axis' `experiments` allow all of it.
    """
    axis = machine.axes[plan.axis]
    if machine.drivers[axis.driver].cls.simulated:
        return []
    motion, lasts_s = Trajectory.at_rest(reference_m), plan.duration_s
    if plan.motion is not None:
        whole = plan_program(machine, plan.motion, {axis.name: reference_m})
        motion, lasts_s = whole.trajectories[axis.name], whole.approach_s + plan.duration_s
    return list(beyond_envelope(axis, motion.peaks(), lasts_s / 60.0))


def record_simulated(machine: Machine, plan: ResponsePlan, log: Path, progress: Progress) -> Path:
    """Excite an axis in virtual time and return the log of it.

    Raises
    ------
    UsageError
        Where a driver does not support virtual time, or the motion breaks a limit.
    RunError
        Where an axis trips; the log then ends there.
    """
    name = plan.axis
    writer = LogWriter(log, log_metadata(machine), log_axes(machine))
    try:
        with VirtualMachine(machine, writer.append) as virtual:
            virtual.start()
            lead_s = 0.0
            if plan.motion is not None:
                standing = {name: float(virtual.state(name)["reference_m"])}
                motion = plan_program(machine, plan.motion, standing)
                virtual.follow(motion.trajectories, {name: virtual.memory.program_number()})
                lead_s = motion.approach_s
            _pass(virtual, lead_s, lambda share: progress("moving to the start", share))
            virtual.excite(name, plan.excitation)
            lasts_s = plan.duration_s + AFTER_S
            _pass(virtual, lasts_s, lambda share: progress("exciting the axis", share))
    finally:
        writer.close({})
    return log


def _pass(virtual: VirtualMachine, seconds: float, progress: Callable[[float], None]) -> None:
    rate_hz = virtual.machine.rate_hz
    left = total = round(seconds * rate_hz)
    while left > 0:
        virtual.advance(min(left, round(rate_hz)))
        left -= round(rate_hz)
        virtual.raise_faults()
        progress(min(1.0 - left / total, 1.0))


def require_holding(client: Client, name: str) -> None:
    """Insist that an axis holds, before anybody is asked; raises UsageError with what to do."""
    axis = client.axis(name)
    if axis["excitation"]:
        left_s = axis["excitation"]["left_s"]
        raise UsageError(f"axis {name} is being excited already, for another {left_s:.0f} s")
    if axis["state"] == "idle" and axis["homed"]:
        return
    first = {
        "off": f"`motorctl start {name} --hold` first",
        "idle": f"`motorctl home {name}` first",
        "fault": f"`motorctl reset {name}`, then `motorctl start {name} --hold` first",
    }.get(axis["state"], "wait until it does, or stop it and start it with --hold")
    how = {"idle": "not homed", "fault": "in fault"}.get(axis["state"], axis["state"])
    raise UsageError(f"axis {name} is {how}: its response needs an axis that holds: {first}")


def record_through_daemon(
    client: Client, plan: ResponsePlan, log: Path, progress: Progress
) -> Path:
    """Excite an axis of a running daemon and return a log of it.

    Whatever ends it early, the axis is stopped, and what was recorded stays in the daemon's log. An
    axis that somebody else moves meanwhile is left to them.

    Raises
    ------
    UsageError
        Where the axis does not hold, or is not homed.
    DaemonRefusedError
        Where a limit does not allow it, or something else came first.
    RunError
        Where the axis trips or is stopped meanwhile.
    """
    name, partial = plan.axis, partial_log(client)
    require_holding(client, name)  # while a person was asked, others may have begun something
    begun = int(client.ask("status")["loop"]["ticks"])
    ours = True
    try:
        try:
            approach_s = _begin(client, plan)
        except DaemonRefusedError:
            ours = False
            raise
        if plan.motion is not None:
            _wait(client, name, approach_s, "moving to the start", progress)
            _excite(client, plan)
        _wait(client, name, plan.duration_s, "exciting the axis", progress)
        _until(client, name, lambda axis: axis["state"] == "idle" and not axis["excitation"])
    except BaseException:
        if ours:
            _stop(client, name)
        raise
    time.sleep(ON_DISK_S)
    if partial_log(client) != partial:
        raise RunError(
            f"the daemon began a new log meanwhile: `motorctl response {name} --recording` with "
            f"both tells the response: {partial.name.removesuffix(SUFFIX)} and the next one"
        )
    return cut_rows(partial, begun, log)


def _begin(client: Client, plan: ResponsePlan) -> float:
    """Order what comes first; return how long the way to the start takes [s]."""
    if plan.motion is None:
        _excite(client, plan)
        return 0.0
    document = plan.motion.model_dump(mode="json", exclude={"name"})
    answer = client.ask("program", axis=plan.axis, name=plan.motion.name, document=document)
    return float(answer["approach_s"])


def _excite(client: Client, plan: ResponsePlan) -> None:
    wave = plan.excitation
    client.ask(
        "excite",
        axis=plan.axis,
        volts=wave.volts.tolist(),
        periods=wave.periods,
        fade_periods=wave.fade_periods,
        state="idle" if plan.motion is None else "running",
    )


def _wait(client: Client, name: str, seconds: float, what: str, progress: Progress) -> None:
    """Wait so long while the axis is led; raises RunError where it no longer is."""
    began = time.monotonic()
    while (passed := time.monotonic() - began) < seconds:
        _led(client, name)
        progress(what, passed / seconds)
        time.sleep(POLL_S)


def _until(client: Client, name: str, reached: Callable[[dict[str, Any]], bool]) -> None:
    while not reached(_led(client, name)):
        time.sleep(POLL_S)


def _led(client: Client, name: str) -> dict[str, Any]:
    axis = client.axis(name)
    if axis["state"] not in ("idle", "running"):
        fault = f": {axis['fault']['message']}" if axis["fault"] else ""
        raise RunError(
            f"axis {name} is {axis['state']}{fault}; what was recorded is in the daemon's log"
        )
    return axis


def _stop(client: Client, name: str) -> None:
    """Stop the axis, over a connection of its own: half a request may stand in the other one."""
    try:
        with Client(client.path) as own:
            own.ask("stop", axis=name)
    except Exception:  # it may be in fault, or the daemon gone: the first error tells more
        return
