"""The crowd on the control socket: it is what it says, and so are its figures."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from served_socket import served

from motorctl.daemon.client import Client
from motorctl.daemon.protocol import RefusedError, Request, parse_request
from motorctl.errors import UsageError
from motorctl_benchmarks.control_socket.crowd import CLIENTS_A_USER, Crowd, Told
from motorctl_benchmarks.control_socket.figures import findings_of
from motorctl_benchmarks.control_socket.fuzz import fuzzed
from motorctl_benchmarks.control_socket.session import (
    BUSY,
    CONVERTING,
    CROWD,
    CROWD_MAIN,
    QUIET,
    WATCHED,
    Session,
    SocketOptions,
    Spell,
    run_session,
)

broken = False


async def _handle(request: Request) -> dict[str, Any]:
    if broken:
        raise ZeroDivisionError("a mistake of ours")
    return {"did": request.do}


@pytest.fixture
def socket() -> Iterator[Path]:
    """A control socket of its own, in a folder that the crowd's made-up users can reach."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o711)
        with served(Path(folder) / "s.sock", _handle) as place:
            yield place


def crowd(socket: Path, **changes: Any) -> Told:
    asked = replace(Crowd(str(socket), 56, 60_000, 1.0, seed=3), **changes)
    done = subprocess.run(
        [sys.executable, "-c", CROWD_MAIN],
        input=json.dumps(asdict(asked)),
        capture_output=True,
        text=True,
        check=True,
    )
    return Told(**json.loads(done.stdout))


@pytest.mark.slow
def test_a_crowd_sends_what_was_asked_for_and_the_server_outlives_it(socket: Path) -> None:
    told = crowd(socket)
    assert told.fuzzed_bytes >= 60_000
    assert told.connections >= 56
    assert told.most_at_once > CLIENTS_A_USER
    assert told.answers > 10
    assert told.refusals > 10
    with Client(socket) as client:
        assert client.ask("status") == {"did": "status"}


@pytest.mark.slow
def test_a_mistake_of_the_daemons_own_is_counted(
    socket: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"{__name__}.broken", True)
    assert crowd(socket, clients=28).mistakes > 0


def test_fuzzed_bytes_are_the_same_for_a_seed_and_hardly_ever_a_request() -> None:
    lines = [fuzzed(random.Random(seed)) for seed in range(3000)]
    assert lines == [fuzzed(random.Random(seed)) for seed in range(3000)]
    proper = 0
    for line in lines:
        try:
            request = parse_request(line.strip())
        except RefusedError:
            continue
        proper += 1
        assert getattr(request, "axis", "z") == "z" or request.do == "status"
    assert proper < 0.1 * len(lines)
    assert len(set(lines)) > 2000


def session(**changes: Any) -> Session:
    def spell(kind: str, late: int) -> Spell:
        lateness_s = np.full(1000, 1e-6)
        lateness_s[:late] = 150e-6
        return Spell(kind, lateness_s)

    kinds = {QUIET: 10, CROWD: 10, WATCHED: 9, CONVERTING: 15, BUSY: 20}
    spells = tuple(spell(kind, late) for kind, late in kinds.items())
    told = Told(connections=200, most_at_once=200, answers=9, fuzzed_bytes=10_000_000)
    return replace(Session(spells * 2, told, 2e-4, 0, ()), **changes)


def test_what_quiet_spells_differ_in_is_no_fault_of_a_crowd() -> None:
    def share(late: int, kind: str = QUIET) -> Spell:
        return Spell(kind, np.where(np.arange(1000) < late, 150e-6, 1e-6))

    told = session().told
    apart = (
        share(1),
        share(11),
        share(6, CROWD),
        share(10, CROWD),
        share(8, WATCHED),
        share(8, CONVERTING),
        share(9, BUSY),
    )
    figure = findings_of(Session(apart, told, 2e-4, 0, ()), SocketOptions()).figures[0]
    assert (figure.value, figure.peer_value) == pytest.approx((0.8, 0.6 + 0.5 * 2**0.5))
    assert figure.met is True
    alike = (share(6), share(6), share(8, CROWD), *apart[4:])
    figure = findings_of(Session(alike, told, 2e-4, 0, ()), SocketOptions()).figures[0]
    assert figure.ratio == pytest.approx(0.75)
    assert figure.met is False


def test_a_crowd_that_nobody_noticed_meets_the_target() -> None:
    found = findings_of(session(), SocketOptions())
    late = found.figures[0]
    assert (late.value, late.peer_value, late.ratio, late.met) == (1.0, 1.0, 1.0, True)
    assert not found.failed
    rows = {row[0]: row for row in found.tables[0].rows}
    assert rows[QUIET][1:5] == ("2,000", "1.000", "1.000, 1.000", "0.000")
    assert rows[BUSY][2] == "2.000"
    scope, logs = found.figures[1:3]
    assert (scope.value, scope.met) == (pytest.approx(0.9), True)
    assert (logs.value, logs.peer_value, logs.met) == (1.5, 1.0, False)


def test_a_crowd_that_makes_ticks_late_is_told() -> None:
    spells = list(session().spells)
    spells[1] = Spell(CROWD, np.full(1000, 150e-6))
    found = findings_of(session(spells=tuple(spells)), SocketOptions())
    assert found.figures[0].met is False


def test_an_emergency_stop_that_waited_is_told() -> None:
    def stops(*stops_s: float) -> dict[str, Any]:
        figures = findings_of(session(stops_s=stops_s), SocketOptions()).figures
        return {f.name: (f.value, f.met) for f in figures if f.name.startswith("estop")}

    quick = stops(*[0.01] * 98, 0.02, 0.4)
    assert quick["estop_median"] == (pytest.approx(10.0), None)
    assert quick["estop_worst"] == (pytest.approx(400.0), True)
    assert stops(0.01, 0.6)["estop_worst"] == (pytest.approx(600.0), False)
    assert stops()["estop_worst"][1] is None


@pytest.mark.parametrize("changes", [{"rows_lost": 1}, {"troubles": ("axis x is fault",)}])
def test_a_lost_row_or_an_axis_that_stopped_fails_the_bench(changes: dict[str, Any]) -> None:
    assert findings_of(session(**changes), SocketOptions()).failed


@pytest.mark.slow
@pytest.mark.wall_clock
def test_a_daemon_outlives_a_crowd_with_both_axes_in_motion_and_every_row_on_the_disk() -> None:
    usual = os.sched_getaffinity(0)
    cpu = max(usual) if len(usual) > 1 else None
    options = SocketOptions(clients=60, fuzzed_bytes=200_000, spell_s=3.0, rounds=1, loop_cpu=cpu)
    shown = run_session(options, lambda _: None)
    assert os.sched_getaffinity(0) == usual
    assert shown.troubles == ()
    assert shown.rows_lost == 0
    assert shown.told.fuzzed_bytes >= 200_000
    assert len(shown.stops_s) > 2
    assert shown.logs_made > 0
    assert shown.watched.drawings > 10
    assert shown.watched.rows_lost == 0
    assert [spell.kind for spell in shown.spells] == [QUIET, CROWD, WATCHED, CONVERTING, BUSY]
    assert all(len(spell.lateness_s) > 5000 for spell in shown.spells)


@pytest.mark.parametrize("cpu", [4096, None])
def test_a_cpu_for_the_loop_that_is_not_there_or_the_only_one_is_refused(
    monkeypatch: pytest.MonkeyPatch, cpu: int | None
) -> None:
    if cpu is None:
        cpu = min(os.sched_getaffinity(0))
        monkeypatch.setattr(os, "sched_getaffinity", lambda _: {cpu})
    with pytest.raises(UsageError, match=f"--loop-cpu {cpu}: it must be one of two or more"):
        run_session(SocketOptions(loop_cpu=cpu), lambda _: None)
