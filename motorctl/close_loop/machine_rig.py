"""Motions on the machine itself, through the daemon that runs it."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motorctl.close_loop.rigs import BrokenOffError, Share
from motorctl.config import Machine
from motorctl.config.model_keys import (
    axes_with_other_models,
    other_keys_that_differ,
    with_models_of,
)
from motorctl.config.story import story_of
from motorctl.daemon.client import Client, DaemonRefusedError
from motorctl.daemon.model_trials import TRIPS
from motorctl.daemon.protocol import Code
from motorctl.daemon.recorded_rows import ON_DISK_S, cut_rows, partial_log
from motorctl.errors import MotorctlError, RunError, UsageError
from motorctl.loop.plan import ProgramPlan, plan_program
from motorctl.motion import Points, Program

POLL_S = 0.1
"""Between two looks at it [s]. Shorter asks more often than anybody sees; longer is late."""
STAND_S = 30.0
"""How long an axis may take to hold after it was started, or to come to rest [s]: an amplifier may
take 20. Longer keeps who waits for one that is broken. By hand."""
CAUSES = frozenset(cause.name.lower() for cause in TRIPS)
"""Faults that say something of the models: a gentler motion, or other models, are tried then."""


@dataclass(frozen=True)
class AskedMotion:
    """A motion that somebody has to agree to."""

    plans: Mapping[str, ProgramPlan]
    """By program."""
    duration_s: float
    other_models: tuple[str, ...]
    """Axes that get other models before."""
    tripped: Mapping[str, str]
    """Axes that have to be reset before, and why they tripped."""


Consent = Callable[[Machine, AskedMotion], None]
"""Raises UsageError where nobody agrees."""


class MachineRig:
    """Runs motions through a daemon: other models are applied, programs followed, rows cut out.

    Parameters
    ----------
    client
        A connection to the daemon.
    running
        What the daemon runs.
    consent
        Asked before anything moves.
    """

    verb = "running"
    goes_on = True

    def __init__(self, client: Client, running: Machine, consent: Consent) -> None:
        self._client = client
        self._running = running
        self._consent = consent
        self._kept = running
        self.runs_on = f"machine {running.name}"
        self._led: set[str] = set()
        """Axes that were started or moved."""
        self._stopped_here: set[str] = set()
        """Those of them that were stopped from here: they may be off."""
        self.begun = 0
        self.motions = 0
        """Of those that were begun, how many were run whole."""
        self.notes: tuple[str, ...] = ()

    def insist(self, machine: Machine) -> None:
        """Raise UsageError where the daemon runs another machine, or an axis is not homed."""
        others = other_keys_that_differ(self._running, machine.resolved)
        if others:
            key, running, given = others[0]
            raise UsageError(
                f"{machine.source}: {key} is {given!r}, and the daemon on {self._client.path} runs "
                f"{running!r}: name the configuration that it was started with"
            )
        for name, axis in self._client.ask("status")["axes"].items():
            if not axis["homed"]:
                raise UsageError(f"axis {name} is not homed: `motorctl home {name}` first")

    def keep(self, machine: Machine) -> None:
        """Take note of the models that shall run in the end, as `leave` sees to."""
        self._kept = machine

    def run(self, machine: Machine, log: Path, duration_s: float | None, progress: Share) -> None:
        """Run the motion on the machine; as `Rig.run`.

        Whatever ends it early, every axis of it is stopped, and what was recorded stays in the
        daemon's logs.
        """
        programs = [machine.programs[name] for name in machine.followed_programs]
        names = sorted({axis for program in programs for axis in program.axes})
        self._ask_for_consent(machine, programs, duration_s)
        self.begun += 1
        self.notes = ()
        try:
            self._ready(names)
            self._take_on(machine)
            partial = partial_log(self._client)
            begun = int(self._client.ask("status")["loop"]["ticks"])
            lasts_s = max((self._begin(program) for program in programs), default=0.0)
            self._wait(names, min(lasts_s, duration_s or lasts_s), progress)
            self._bring_to_rest(names, lasts_s, duration_s)
            ended = int(self._client.ask("status")["loop"]["ticks"])
        except RunError as error:
            told_of_models = isinstance(error, _ModelRefusedError) or self._tripped(names)
            self.stop(names)
            if told_of_models:
                raise
            raise BrokenOffError(str(error)) from error
        except BaseException:
            self.stop(names)
            raise
        time.sleep(ON_DISK_S)
        if partial_log(self._client) != partial:
            raise BrokenOffError(f"the daemon began a new log while {log.stem} was run")
        try:
            cut_rows(partial, begun, log, ended)
        except RunError as error:
            raise BrokenOffError(str(error)) from error
        self.motions += 1

    def leave(self) -> tuple[str, ...]:
        """Have the models run that were kept; return the axes that changed theirs for that.

        As `stop`, over a connection of its own.

        Raises
        ------
        MotorctlError
            Where the daemon refuses, and others run on.
        """
        if not self.begun:
            return ()
        with Client(self._client.path) as own:
            for name in sorted(self._led):
                own.wait_for(name, _stands, STAND_S)
            answer = own.ask("apply", **self._order_of(self._kept))
        return tuple(answer["axes"])

    def stop(self, names: Iterable[str] | None = None) -> tuple[str, ...]:
        """Stop axes, by default all that were led, whatever becomes of one of them.

        A connection of its own is used: half a request may stand in the other. Returns those that
        could not be told to.
        """
        left = []
        with _uninterrupted():
            for name in sorted(self._led) if names is None else names:
                try:
                    with Client(self._client.path) as own:
                        if own.axis(name)["state"] in ("idle", "running", "homing"):
                            self._stopped_here.add(name)
                            own.ask("stop", axis=name)
                except (MotorctlError, OSError):  # the first error tells more
                    left.append(name)
        return tuple(left)

    def _ask_for_consent(
        self, machine: Machine, programs: list[Program], duration_s: float | None
    ) -> None:
        axes = self._client.ask("status")["axes"]
        plans = {}
        for program in programs:
            standing = {name: float(axes[name]["reference_m"]) for name in program.axes}
            plans[program.name] = plan_program(machine, program, standing)
        lasts_s = max((plan.duration_s for plan in plans.values()), default=0.0)
        faults = {n: a["fault"]["message"] for n, a in axes.items() if a["state"] == "fault"}
        changed = tuple(axes_with_other_models(self._running, machine))
        asked = AskedMotion(plans, min(lasts_s, duration_s or lasts_s), changed, faults)
        self._consent(machine, asked)

    def _ready(self, names: list[str]) -> None:
        """Let every axis of the motion hold."""
        for name in names:
            state = self._client.axis(name)["state"]
            if state == "off" and name in self._led - self._stopped_here:
                raise BrokenOffError(f"axis {name} is off: somebody stopped it")
            if state == "fault":
                self._when_it_stands("reset", name)
            if state in ("fault", "off"):
                self._when_it_stands("start", name, hold=True)
            self._led.add(name)
            self._stopped_here.discard(name)
        for name in names:
            self._client.wait_for(name, lambda axis: axis["state"] == "idle", STAND_S)

    def _when_it_stands(self, do: str, name: str, **arguments: Any) -> None:
        self._client.ask_when_ready(do, lambda _: None, axis=name, **arguments)

    def _take_on(self, machine: Machine) -> None:
        """Have the daemon run the machine's models; where it does already, nothing is changed."""
        try:
            self._client.ask("apply", **self._order_of(machine))
        except DaemonRefusedError as no:
            refused = _ModelRefusedError if no.code == Code.OUT_OF_LIMITS else BrokenOffError
            raise refused(str(no)) from no

    def _order_of(self, machine: Machine) -> dict[str, Any]:
        config = with_models_of(self._running, machine.resolved)
        if machine is self._running:  # which is known from a log
            return {"config": config, "source": "what ran when close-loop began"}
        source = machine.source.absolute()
        return {"config": config, "source": str(source), "story": story_of(source)}

    def _begin(self, program: Program) -> float:
        """Order a program; return how long it lasts with its approach [s]."""
        document = program.model_dump(mode="json", exclude={"name"})  # type: ignore[attr-defined]
        files = {}
        if isinstance(program, Points):
            document["file"] = "points.csv"
            files["points.csv"] = program.file.read_text(encoding="utf-8-sig")
        answer = self._client.ask(
            "program", axis=program.axes[0], name=program.name, document=document, files=files
        )
        self.notes += tuple(answer.get("notes", ()))
        return float(answer["duration_s"])

    def _wait(self, names: list[str], seconds: float, progress: Share) -> None:
        began = time.monotonic()
        while (passed := time.monotonic() - began) < seconds:
            self._must_be_led(names)
            progress(passed / seconds)
            time.sleep(POLL_S)

    def _bring_to_rest(self, names: list[str], lasts_s: float, duration_s: float | None) -> None:
        if duration_s is not None and duration_s < lasts_s:
            for name in names:
                self._stopped_here.add(name)
                self._client.ask("stop", axis=name)
            for name in names:
                self._client.wait_for(name, lambda axis: axis["state"] == "off", STAND_S)
            return
        deadline = time.monotonic() + STAND_S
        while any(state != "idle" for state in self._must_be_led(names).values()):
            if time.monotonic() > deadline:
                raise RunError(f"the motion has not ended {STAND_S:g} s after its time")
            time.sleep(POLL_S)

    def _must_be_led(self, names: list[str]) -> dict[str, str]:
        """Return the axes' states; raises RunError where one is no longer led."""
        axes = self._client.ask("status")["axes"]
        for name in names:
            if axes[name]["state"] not in ("idle", "running"):
                fault = axes[name]["fault"]
                told = f": {fault['message']}" if fault else ", and nothing here stopped it"
                raise RunError(f"axis {name} is {axes[name]['state']}{told}")
        return {name: axes[name]["state"] for name in names}

    def _tripped(self, names: list[str]) -> bool:
        """Return whether an axis tripped on something that its model may be the cause of."""
        try:
            with Client(self._client.path) as own:
                axes = own.ask("status")["axes"]
        except (MotorctlError, OSError):
            return False
        return any(axes[n]["fault"] and axes[n]["fault"]["cause"] in CAUSES for n in names)


def _stands(axis: Mapping[str, Any]) -> bool:
    return axis["state"] in ("idle", "off", "fault")


class _ModelRefusedError(RunError):
    """The daemon takes no such model on."""


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Let no second Ctrl-C come between the axes that are stopped."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
