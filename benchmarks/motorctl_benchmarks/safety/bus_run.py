"""The campaign on buses: its sessions one after the other, in real time."""

from __future__ import annotations

from collections.abc import Sequence

from motorctl.errors import MotorctlError
from motorctl.latency.progress import Progress
from motorctl_benchmarks.safety.bus_case import BusOutcome, judged
from motorctl_benchmarks.safety.bus_cases import BusKey
from motorctl_benchmarks.safety.bus_expectations import promise
from motorctl_benchmarks.safety.bus_faults import KILLS
from motorctl_benchmarks.safety.bus_kills import KillOutcome, run_kill
from motorctl_benchmarks.safety.bus_session import Session, run_session

Outcome = BusOutcome | KillOutcome


def sessions_of(keys: Sequence[BusKey]) -> list[Session]:
    """Return sessions of cases that one daemon can run: of a bus, a controller and a setup; each
    kill has one of its own."""
    groups: dict[tuple[object, ...], list[BusKey]] = {}
    for key in keys:
        kill = key.fault if key.fault in KILLS else ""
        group = (key.line, key.controller, key.seed, key.setup, kill)
        groups.setdefault(group, []).append(key)
    return [Session(tuple(own)) for own in groups.values()]


def run_bus_cases(keys: Sequence[BusKey], progress: Progress) -> list[Outcome]:
    """Run every session; where one cannot be run through, each of its cases says so."""
    outcomes: list[Outcome] = []
    sessions = sessions_of(keys)
    for k, session in enumerate(sessions):

        def part(share: float, k: int = k) -> None:
            progress((k + share) / len(sessions))

        try:
            if session.first.fault in KILLS:
                outcomes.append(run_kill(session.first))
            else:
                outcomes += judged(run_session(session, part))
        except MotorctlError as error:
            outcomes += [_not_run(key, f"could not be run: {error}") for key in session.keys]
        part(1.0)
    return outcomes


def _not_run(key: BusKey, why: str) -> Outcome:
    if key.fault in KILLS:
        return KillOutcome(key, failures=(why,))
    wanted = promise(key.line, key.state, key.fault)
    assert wanted is not None
    return BusOutcome(key, wanted, failures=(why,))
