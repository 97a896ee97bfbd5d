"""`motorctl.connect` and `connect_async`: a machine that runs, from a script."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Coroutine, Iterator
from pathlib import Path
from typing import Any

import pytest
from daemon_rig import Daemon, bench_config, wait_until
from served_socket import served

import motorctl
from motorctl.api.orders import Reset
from motorctl.api.status import AxisStatus
from motorctl.daemon.protocol import (
    AxisCommand,
    Code,
    RefusedError,
    Request,
    StatusCommand,
)

pytestmark = pytest.mark.wall_clock(lanes=3)


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    config = bench_config("shuttle")
    with Daemon(tmp_path_factory.mktemp("daemon"), config) as running:
        yield running


@pytest.fixture
def machine(daemon: Daemon) -> Iterator[motorctl.Connection]:
    """A connection; both axes hold."""
    with motorctl.connect(daemon.socket) as connection:
        for name in ("x", "y"):
            if connection.axis_status(name).state == "fault":
                connection.reset(name)
            if connection.axis_status(name).state != "idle":
                connection.stop(name)
            connection.start(name, hold=True)
        yield connection


def run(doing: Coroutine[Any, Any, Any]) -> Any:
    return asyncio.run(doing)


def test_a_move_is_waited_for_and_ends_where_it_was_sent(machine: motorctl.Connection) -> None:
    motion = machine.move("x", 0.08, velocity_m_s=0.2)
    assert (motion.axes, motion.program) == (("x",), None)
    assert 0.0 < motion.duration_s < 5.0
    assert machine.axis_status("x").state == "running"
    ended = machine.wait("x", timeout_s=motion.duration_s + 2.0)
    assert isinstance(ended, AxisStatus)
    assert (ended.state, ended.homed, ended.fault) == ("idle", True, None)
    assert ended.reference_m == pytest.approx(0.08, abs=1e-12)
    assert machine.stop("x").state == "off"


def test_a_program_runs_until_it_is_stopped(machine: motorctl.Connection) -> None:
    started = machine.start("x")
    assert started.motion is not None
    assert (started.program, started.motion.axes) == ("shuttle", ("x",))
    assert machine.wait("x", "running", timeout_s=1.0).state == "running"
    began = time.monotonic()
    with pytest.raises(TimeoutError, match=r"axis x is still running after 0\.1 s"):
        machine.wait("x", timeout_s=0.1)
    assert time.monotonic() - began < 1.0
    assert machine.stop("x").state == "off"
    machine.start("y", hold=True)
    assert machine.start("x", hold=True).motion is None
    assert machine.program("x", "ring").axes == ("x", "y")


def test_a_status_tells_every_axis_in_fields_a_frame_and_a_table(
    machine: motorctl.Connection,
) -> None:
    told = machine.status()
    assert (told.machine, told.rate_hz, list(told.axes)) == ("bench", 400.0, ["x", "y"])
    assert told["y"].travel_m == (-0.05, 0.45)
    assert "inertia" in told["x"].theta_hat
    assert list(told.to_pandas()["state"]) == ["idle", "idle"]
    assert "<td>idle</td>" in told._repr_html_()
    assert told.recording is not None


def test_what_the_daemon_refuses_is_an_error_with_its_code(machine: motorctl.Connection) -> None:
    with pytest.raises(motorctl.DaemonRefusedError, match=r"0\.46") as no:
        machine.move("x", 0.46)
    assert no.value.code == "out_of_limits"
    with pytest.raises(motorctl.DaemonRefusedError, match="unknown axis 'z'"):
        machine.wait("z")


def test_an_axis_that_trips_ends_the_wait_with_cause_and_remedy(
    machine: motorctl.Connection, daemon: Daemon
) -> None:
    machine.start("x")
    daemon.ask("estop")
    with pytest.raises(motorctl.AxisFaultError, match=r"`motorctl reset x` clears") as tripped:
        machine.wait("x")
    assert (tripped.value.axis, tripped.value.cause) == ("x", "estop")
    assert machine.wait("x", "fault").fault_cause == "estop"
    assert machine.reset("x") == Reset("x", True, None, False)
    assert set(machine.estop()) == {"x", "y"}


def test_tasks_wait_for_their_own_axes_on_one_connection(
    machine: motorctl.Connection, daemon: Daemon
) -> None:
    async def both() -> list[AxisStatus]:
        async with motorctl.connect_async(daemon.socket) as shared:
            assert (await shared.status()).machine == "bench"
            motions = await asyncio.gather(shared.move("x", 0.1), shared.move("y", 0.12))
            waiting = [shared.wait(motion.axes[0], timeout_s=10.0) for motion in motions]
            return await asyncio.gather(*waiting)

    x, y = run(both())
    assert x.reference_m == pytest.approx(0.1)
    assert y.reference_m == pytest.approx(0.12)


def test_a_cancelled_wait_leaves_the_connection_to_stop_with(
    machine: motorctl.Connection, daemon: Daemon
) -> None:
    async def cancelled() -> str:
        shared = await motorctl.connect_async(daemon.socket)
        try:
            await shared.start("x")
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(shared.wait("x"), 0.2)
            return (await shared.stop("x")).state
        finally:
            await shared.close()

    assert run(cancelled()) == "off"


def test_an_async_wait_for_an_axis_that_trips_tells_why(
    machine: motorctl.Connection, daemon: Daemon
) -> None:
    async def trip() -> None:
        async with motorctl.connect_async(daemon.socket) as shared:
            await shared.start("x")
            waiting = asyncio.create_task(shared.wait("x"))
            await asyncio.sleep(0.1)
            await shared.estop()
            await waiting

    with pytest.raises(motorctl.AxisFaultError, match="axis x: fault: "):
        run(trip())


def test_where_no_daemon_is_both_say_how_to_start_one(tmp_path: Path) -> None:
    async def connected() -> None:
        await motorctl.connect_async(tmp_path / "none.sock")

    with pytest.raises(motorctl.RunError, match="motorctl run CONFIG"):
        motorctl.connect(tmp_path / "none.sock")
    with pytest.raises(motorctl.RunError, match="motorctl run CONFIG"):
        run(connected())


def test_an_axis_that_trips_meanwhile_keeps_none_from_being_stopped(tmp_path: Path) -> None:
    stopped: list[str] = []

    async def handle(request: Request) -> dict[str, Any]:
        if isinstance(request, StatusCommand):
            states = {"x": "running", "y": "off" if stopped else "running"}
            return {"axes": {name: {"state": state} for name, state in states.items()}}
        assert isinstance(request, AxisCommand)
        if request.axis == "x":
            raise RefusedError(Code.WRONG_STATE, "axis x is in fault: stop is not possible")
        stopped.append(request.axis)
        return {}

    with served(tmp_path / "s", handle) as place, motorctl.connect(place) as machine:
        with pytest.raises(motorctl.DaemonRefusedError, match="axis x is in fault"):
            machine.stop_all()
        assert stopped == ["y"]


def test_a_daemon_that_ends_while_it_is_asked_ends_the_wait(tmp_path: Path) -> None:
    async def handle(request: Request) -> dict[str, Any]:
        assert isinstance(request, StatusCommand)
        await asyncio.sleep(60.0)
        return {}

    async def ask() -> None:
        with served(tmp_path / "s", handle) as place:
            shared = await motorctl.connect_async(place)
            asked = asyncio.create_task(shared.status())
            await asyncio.sleep(0.2)
        with pytest.raises(motorctl.RunError, match="closed the connection"):
            await asked
        with pytest.raises(motorctl.RunError, match="closed the connection"):
            await shared.status()
        await shared.close()

    run(ask())
    wait_until(lambda: not (tmp_path / "s").exists())
