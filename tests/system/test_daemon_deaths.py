"""Processes that stand still or die together: nothing moves on, no row is lost, the next tells."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from buses_bench import (
    BUSES,
    SLACK_S,
    WATCHDOG_S,
    DeviceProcess,
    device_file,
    free_port,
    host_file,
)
from daemon_rig import Daemon, alive, bench_config, wait_until
from recorded_ring import metadata_of

from motorctl.flight import list_records
from motorctl.log import background
from motorctl.log.folder import stored_logs
from motorctl.log.sample import AxisState, SampleFlag

pytestmark = pytest.mark.wall_clock(lanes=3)

RATE_HZ = 400
USUAL_S = 2.0
USUAL = bench_config("shuttle", supervisor_timeout_s=USUAL_S)
IMPATIENT = bench_config("shuttle", supervisor_timeout_s=0.5)
"""The axis is still on its first way when the loop misses its supervisor."""
ONE = "serial exchange"
ONE_AND_LONG = [bus if bus == ONE else pytest.param(bus, marks=pytest.mark.long) for bus in BUSES]


KILLED = {
    True: "and its loop process were killed",
    False: "was killed; its loop process then stopped every axis",
}
"""What the next start tells of a supervisor, with its loop or without."""


def loop_pid(daemon: Daemon) -> int:
    pid: int = daemon.ask("status")["loop"]["pid"]
    return pid


def moving(daemon: Daemon) -> None:
    daemon.ask("start", axis="x")
    wait_until(lambda: abs(daemon.ask("status", axis="x")["axes"]["x"]["velocity_m_s"]) > 0.01)


def no_row_is_missing(log: Path) -> None:
    """A busy computer may make the loop skip a period; the row after it says so."""
    table = pq.read_table(log, columns=["tick", "x.flags"])
    gap = np.diff(table["tick"].to_numpy()) != 1
    skipped = table["x.flags"].to_numpy()[1:] & SampleFlag.SKIPPED > 0
    assert not (gap & ~skipped).any(), log


def start_anew(daemon: Daemon) -> str:
    """Start the daemon again, and give what it said since."""
    before = len(daemon.said)
    daemon.process = daemon.launch()
    daemon.wait_until_running()
    assert {daemon.state(axis) for axis in ("x", "y")} == {"off"}
    return daemon.said[before:]


@pytest.mark.slow
def test_a_supervisor_or_a_loop_killed_with_what_makes_closed_logs_loses_no_row(
    tmp_path: Path,
) -> None:
    """The next start tells; without the loop the daemon ends, and makes the log itself."""
    with Daemon(tmp_path, USUAL) as daemon:
        moving(daemon)
        time.sleep(1.0)
        ticks = [daemon.ask("status")["loop"]["ticks"]]
        loop = loop_pid(daemon)
        os.kill(daemon.process.pid, signal.SIGKILL)
        daemon.process.wait()
        wait_until(lambda: not alive(loop))
        (closed,) = daemon.partial_logs()
        start_anew(daemon)

        converter, loop = moving_while_a_log_is_made(daemon, closed, ticks)
        os.kill(daemon.process.pid, signal.SIGKILL)
        os.kill(converter, signal.SIGKILL)
        daemon.process.wait()
        wait_until(lambda: not alive(loop) and not alive(converter))
        assert closed.exists()  # whole, as its log is not
        said = start_anew(daemon)
        assert "its supervisor was killed; its loop process then stopped every axis" in said
        assert "2 of earlier runs are unfinished" in said
        assert closed.name in said
        assert "Traceback" not in said

        converter, loop = moving_while_a_log_is_made(daemon, closed, ticks)
        os.kill(loop, signal.SIGKILL)
        os.kill(converter, signal.SIGKILL)
        assert daemon.process.wait(60) == 1
        assert not alive(converter)
        assert "the loop process ended (killed by SIGKILL)" in daemon.said
        assert not daemon.partial_logs()
        assert "ended with: " in start_anew(daemon)
        assert "Traceback" not in daemon.said
        assert daemon.end() == 0, daemon.said
        *killed, _ = (stored.path for stored in stored_logs(daemon.logs, "bench"))
        every_log_ends_at_its_kill(killed, ticks)
        assert not daemon.partial_logs()
        assert not list(daemon.logs.glob("*.tmp"))


def moving_while_a_log_is_made(daemon: Daemon, closed: Path, ticks: list[int]) -> tuple[int, int]:
    """Have axes move while the log of a run that was killed is made, by a process that stands.

    Parameters
    ----------
    daemon
        One that was started anew.
    closed
        The recording of the killed run.
    ticks
        The loop's are appended, once the axes have moved for a second.

    Returns
    -------
    int, int
        The process that makes the log, and the loop's.
    """
    converter = stopped_converter(closed)
    moving(daemon)
    time.sleep(1.0)
    told = daemon.ask("status")["loop"]
    ticks.append(told["ticks"])
    return converter, told["pid"]


def every_log_ends_at_its_kill(logs: Sequence[Path], ticks: Sequence[int]) -> None:
    """Insist that logs of killed runs end less than a second before, without a gap."""
    lost_s = []
    for log, at_kill in zip(logs, ticks, strict=True):
        last = pq.read_table(log, columns=["tick"])["tick"][-1].as_py()
        lost_s.append(max(0.0, (at_kill - last) / RATE_HZ))
        no_row_is_missing(log)
    print(f"at most {max(lost_s):.2f} s lost, {np.median(lost_s):.2f} s in the median")
    assert max(lost_s) < 1.0


def stopped_converter(closed: Path) -> int:
    """Wait for the process that makes a log of a closed recording; have it stand in its work."""
    found: list[int] = []

    def begun() -> bool:
        for process in Path("/proc").glob("[0-9]*"):
            try:
                words = (process / "cmdline").read_bytes().split(b"\0")
            except OSError:
                continue
            if background.__name__.encode() in words and os.fsencode(closed) in words:
                found.append(int(process.name))
                os.kill(found[0], signal.SIGSTOP)
                return True
        return False

    wait_until(begun)
    return found[0]


@pytest.mark.parametrize(
    "kills",
    [
        pytest.param(4, marks=pytest.mark.slow),
        pytest.param(200, marks=[pytest.mark.slow, pytest.mark.long, pytest.mark.timeout(3600)]),
    ],
)
def test_whatever_moment_it_is_killed_at_a_log_ends_less_than_a_second_before(
    tmp_path: Path, kills: int
) -> None:
    """The supervisor alone, or the loop with it; the next start tells, and makes the log."""
    random = np.random.default_rng(1)
    ticks_at_kill, with_loop = [], []
    with Daemon(tmp_path, USUAL) as daemon:
        for kill in range(kills):
            moving(daemon)
            time.sleep(random.uniform(0.0, 2.0))
            pid = loop_pid(daemon)
            ticks_at_kill.append(daemon.ask("status")["loop"]["ticks"])
            os.kill(daemon.process.pid, signal.SIGKILL)
            with_loop.append(random.random() < 0.5)
            if with_loop[-1]:
                os.kill(pid, signal.SIGKILL)
            daemon.process.wait()
            wait_until(lambda pid=pid: not alive(pid))
            said = start_anew(daemon)
            assert f"did not end in order: its supervisor {KILLED[with_loop[-1]]}" in said, kill
            assert "of earlier runs are unfinished" in said
            assert "Traceback" not in said
        assert daemon.end() == 0, daemon.said
    *killed, last = (stored.path for stored in stored_logs(daemon.logs, "bench"))
    every_log_ends_at_its_kill(killed, ticks_at_kill)
    for log, both in zip(killed, with_loop, strict=True):
        states = pq.read_table(log, columns=["x.state"])["x.state"]
        assert states[0].as_py() == AxisState.OFF
        assert (states[-1].as_py() == AxisState.RUNNING) or not both
    assert pq.read_table(last, columns=["x.state"])["x.state"][0].as_py() == AxisState.OFF


@pytest.mark.slow
@pytest.mark.parametrize("name", ONE_AND_LONG)
def test_loop_and_supervisor_killed_at_once_leave_the_device_to_its_own_watchdog(
    tmp_path: Path, name: str
) -> None:
    """By the device's own clock, from the last command that it heard: not sooner, nor later than a
    wake-up and what this computer paused."""
    bus = BUSES[name]
    port = free_port()
    with DeviceProcess(tmp_path, device_file(bus, port)) as device:
        config = host_file(bus, bus.driver(device.endpoint, port))
        with Daemon(tmp_path / "daemon", config) as daemon:
            moving(daemon)
            pid = loop_pid(daemon)
            os.kill(daemon.process.pid, signal.SIGKILL)
            os.kill(pid, signal.SIGKILL)
            daemon.process.wait()
            time.sleep(4 * WATCHDOG_S)
        device.end()
        report = device.report
        assert report["watchdog_trips"] == 1
        late_s = report["watchdog_after_s"] - WATCHDOG_S
        assert 0.0 <= late_s < SLACK_S + report["longest_pause_s"]
        assert report["off_s"][-1][1] is None


@pytest.mark.slow
def test_a_supervisor_that_stands_still_has_its_axes_ramped_down_and_wakes_to_tell(
    tmp_path: Path,
) -> None:
    with Daemon(tmp_path, IMPATIENT) as daemon:
        moving(daemon)
        pid = loop_pid(daemon)
        os.kill(daemon.process.pid, signal.SIGSTOP)
        wait_until(lambda: not alive(pid))
        os.kill(daemon.process.pid, signal.SIGCONT)
        assert daemon.process.wait(60) == 1
        assert "no sign of life from the supervisor" in daemon.said
        assert "every axis was stopped" in daemon.said
        assert "Traceback" not in daemon.said
        # The ring held what nobody wrote: the log has the ramp to its end.
        table = pq.read_table(daemon.log())
        states = table["x.state"].to_numpy()
        ramp = table["x.reference_velocity_m_s"].to_numpy()[states == AxisState.STOPPING]
        assert abs(ramp[-1]) < 0.01
        assert states[-1] in (AxisState.OFF, AxisState.FAULT)
        no_row_is_missing(daemon.log())
        assert "ended with: " in start_anew(daemon)


@pytest.mark.slow
def test_a_supervisor_that_pauses_for_less_than_its_limit_costs_nothing(tmp_path: Path) -> None:
    with Daemon(tmp_path, IMPATIENT) as daemon:
        moving(daemon)
        for _ in range(5):
            os.kill(daemon.process.pid, signal.SIGSTOP)
            time.sleep(0.2)
            os.kill(daemon.process.pid, signal.SIGCONT)
            time.sleep(0.3)
        assert daemon.state("x") == "running"
        assert daemon.end() == 0, daemon.said
        no_row_is_missing(daemon.log())


@pytest.mark.slow
def test_a_loop_that_stands_still_for_less_than_its_limit_trips_what_it_led_and_jolts_nothing(
    tmp_path: Path,
) -> None:
    with Daemon(tmp_path, USUAL) as daemon:
        moving(daemon)
        pid = loop_pid(daemon)
        os.kill(pid, signal.SIGSTOP)
        time.sleep(0.4)
        os.kill(pid, signal.SIGCONT)
        wait_until(lambda: daemon.state("x") == "fault")
        fault = daemon.ask("status")["axes"]["x"]["fault"]
        assert (fault["cause"], fault["guard"], fault["code"]) == ("host_frozen", "host_frozen", 22)
        assert "the loop was stalled for" in fault["message"]
        assert loop_pid(daemon) == pid
        daemon.ask_when_it_stands("reset", "x")
        daemon.ask_when_it_stands("start", "x")
        assert daemon.state("x") == "running"
        assert daemon.end() == 0, daemon.said
        table = pq.read_table(daemon.log())
        ticks, states = table["tick"].to_numpy(), table["x.state"].to_numpy()
        (pause,) = np.flatnonzero(np.diff(ticks) > 0.3 * RATE_HZ)
        # The first tick after the pause is the one that disables.
        assert states[pause] == AxisState.RUNNING
        assert states[pause + 1] == AxisState.FAULT
        assert table["x.command_v"][int(pause) + 1].as_py() == 0.0


@pytest.mark.slow
def test_an_edited_configuration_changes_nothing_until_the_next_start_which_says_what_changed(
    tmp_path: Path,
) -> None:
    with Daemon(
        tmp_path, bench_config("shuttle", keep_learned=True, supervisor_timeout_s=USUAL_S)
    ) as daemon:
        moving(daemon)
        ran = daemon.config.read_text()
        edited = ran.replace("ks_v_s_m: 30", "ks_v_s_m: 31")
        daemon.config.write_text(edited)
        wait_until(lambda: told(daemon) == "was changed")
        daemon.config.unlink()
        wait_until(lambda: told(daemon) == "was removed")
        assert daemon.state("x") == "running"
        daemon.ask("estop")
        wait_until(lambda: bool(list_records(daemon.logs).records), 30)
        daemon.config.write_text(edited)
        assert daemon.end() == 0, daemon.said
        assert "the machine goes on as it was configured then" in daemon.said
        (record,) = list_records(daemon.logs).records
        for metadata in (record.metadata, metadata_of(daemon.log())):
            assert metadata["config"]["axes"]["y"]["gains"]["ks_v_s_m"] == 30.0
        # And what was learned is cut short by a power cut, say.
        learned = tmp_path / "state" / "motorctl" / "bench.json"
        os.truncate(learned, learned.stat().st_size // 2)
        said = start_anew(daemon)
        assert "axes.y.gains.ks_v_s_m: 30.0 -> 31.0" in said
        assert "did not end in order" not in said
        assert said.count("learned parameters ignored: Invalid JSON") == 1
        assert "Traceback" not in said
        assert daemon.ask("status", axis="x")["axes"]["x"]["theta_hat"]["inertia"] == 0.19
        assert told(daemon) is None


def told(daemon: Daemon) -> str | None:
    difference: str | None = daemon.ask("status")["daemon"]["config_difference"]
    return difference
