"""Life and death of the daemon's two processes; whatever happens, the log is kept."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from daemon_rig import Daemon, alive, bench_config, command, ended_with_the_tests, wait_until

from motorctl.config import load
from motorctl.daemon import supervisor
from motorctl.daemon.client import Client, DaemonRefusedError
from motorctl.errors import RunError, UsageError
from motorctl.flight import list_records
from motorctl.log import recover
from motorctl.log.sample import AxisState, FaultCause

pytestmark = [pytest.mark.wall_clock(lanes=3), pytest.mark.slow]

TESTS = Path(__file__).parent


def loop_pid(daemon: Daemon) -> int:
    pid: int = daemon.ask("status")["loop"]["pid"]
    return pid


def marking_config(mark: Path) -> str:
    """The bench on a driver that writes down who made its outputs safe."""
    return bench_config("ring", "ring").replace(
        "{type: sim, preset",
        f"{{type: 'marking_driver:MarkingDriver', mark: '{mark}', preset",
    )


def test_sigterm_stops_the_axes_and_completes_the_log(tmp_path: Path) -> None:
    config = bench_config("shuttle", keep_learned=True)
    with Daemon(tmp_path, config) as daemon:
        assert "program" not in daemon.ask("start", axis="x", hold=True)
        started = daemon.ask("start", axis="x")
        assert started["program"] == "shuttle"
        wait_until(lambda: daemon.ask("status", axis="x")["axes"]["x"]["velocity_m_s"] > 0.01)
        assert daemon.end(signal.SIGTERM) == 0, daemon.said
        assert not daemon.socket.exists()
        table = pq.read_table(daemon.log())
        assert table["x.state"][-1].as_py() == AxisState.OFF
        # Ramped down, not cut off: the last reference velocities fall to zero.
        velocity = table["x.reference_velocity_m_s"].to_numpy()
        states = table["x.state"].to_numpy()
        ramp = velocity[states == AxisState.STOPPING]
        assert len(ramp) > 2
        assert abs(ramp[-1]) < 0.01
        learned = json.loads((tmp_path / "state" / "motorctl" / "bench.json").read_text())
        last = table["x.theta_hat_inertia"][-1].as_py()
        assert learned["axes"]["x"]["parameters"]["inertia"] == last
    # The next run goes on from there; this one is ended by Ctrl-C, twice.
    with Daemon(tmp_path / "next", config, XDG_STATE_HOME=str(tmp_path / "state")) as daemon:
        assert "axis x: starts from the parameters learned" in daemon.said
        daemon.ask("start", axis="x")
        daemon.process.send_signal(signal.SIGINT)
        assert daemon.end(signal.SIGINT) == 0, daemon.said
        table = pq.read_table(daemon.log())
        assert table["x.theta_hat_inertia"][0].as_py() == last
        assert json.loads(table.schema.metadata[b"motorctl"])["rows_lost"] == 0


@pytest.mark.slow
def test_no_large_library_is_imported_while_the_loop_ticks(tmp_path: Path) -> None:
    """Hundreds of files under the interpreter's lock: no sign of life is given meanwhile."""
    with Daemon(tmp_path, bench_config("shuttle"), PYTHONPROFILEIMPORTTIME="1") as daemon:
        daemon.ask("start", axis="x")
        daemon.ask("estop")
        wait_until(lambda: bool(list_records(daemon.logs).records))
        assert daemon.end() == 0, daemon.said
        said = daemon.said.partition("DEGRADED")[2].splitlines()
    imported = [line.split("|")[-1].strip() for line in said if line.startswith("import time:")]
    assert len(imported) < 20, imported


@pytest.mark.slow
def test_an_emergency_stop_is_taken_while_the_daemon_stops(tmp_path: Path) -> None:
    slow = bench_config().replace("max_velocity_m_s: 1.0", "max_velocity_m_s: 0.4")
    slow = slow.replace("stop: {acceleration_m_s2: 2,", "stop: {acceleration_m_s2: 0.4,")
    with Daemon(tmp_path, slow) as daemon, Client(daemon.socket) as client:
        client.ask("start", axis="x")
        client.ask("move", axis="x", position_m=0.4, velocity_m_s=0.35, acceleration_m_s2=5)
        wait_until(lambda: client.axis("x")["velocity_m_s"] > 0.3)
        daemon.process.send_signal(signal.SIGTERM)
        wait_until(lambda: client.axis("x")["state"] == "stopping")
        with pytest.raises(DaemonRefusedError, match="the daemon is stopping"):
            client.ask("start", axis="y")
        assert client.ask("estop") == {"axes": ["x", "y"]}
        assert daemon.process.wait(60) == 0, daemon.said
        table = pq.read_table(daemon.log())
        assert table["x.state"][-1].as_py() == AxisState.FAULT
        assert table["x.fault"][-1].as_py() == FaultCause.ESTOP


@pytest.mark.slow
def test_a_mistake_of_the_supervisor_ramps_the_axes_down(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    moves = threading.Event()

    def tell_changes(*arguments: object) -> None:
        if moves.is_set():
            raise ZeroDivisionError("a mistake of ours")

    def command_it() -> None:
        wait_until(lambda: (tmp_path / "s").exists() and any(tmp_path.glob("*.partial")), 240)
        with Client(tmp_path / "s") as client:
            client.ask("start", axis="x")
            client.ask("program", axis="x", name="shuttle")
            wait_until(lambda: client.axis("x")["velocity_m_s"] > 0.01)
            moves.set()

    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(supervisor.Journal, "tell_changes", tell_changes)
    (tmp_path / "bench.yaml").write_text(bench_config())
    options = supervisor.DaemonOptions(socket=tmp_path / "s", log_directory=tmp_path)
    commanding = threading.Thread(target=command_it)
    commanding.start()
    with pytest.raises(RunError, match="ZeroDivisionError: a mistake of ours"):
        supervisor.run_daemon(load(str(tmp_path / "bench.yaml")), options)
    commanding.join()
    (log,) = tmp_path.glob("*.parquet")
    table = pq.read_table(log)
    ramp = table.filter(pc.equal(table["x.state"], AxisState.STOPPING))
    assert abs(ramp["x.reference_velocity_m_s"][-1].as_py()) < 0.01
    assert table["x.state"][-1].as_py() == AxisState.OFF


@pytest.mark.slow
def test_a_loop_that_dies_ends_the_daemon_with_the_reason_and_the_log(tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    with Daemon(tmp_path, marking_config(mark), PYTHONPATH=str(TESTS)) as daemon:
        # A program of two axes begins when the second of them is started.
        waits = daemon.cli("start", "x")
        assert waits.stdout == "axis x: enabled, holds; program ring waits for y\n"
        assert daemon.state("x") == "idle"
        assert daemon.ask_when_it_stands("start", "y")["axes"] == ["x", "y"]
        assert {daemon.state("x"), daemon.state("y")} == {"running"}
        os.kill(loop_pid(daemon), signal.SIGKILL)
        assert daemon.process.wait(60) == 1
        assert "the loop process ended (killed by SIGKILL)" in daemon.said
        assert "Traceback" not in daemon.said
        # The supervisor itself made the outputs safe.
        assert str(daemon.process.pid) in mark.read_text().split()
        assert pq.read_table(daemon.log())["x.state"][-1].as_py() == AxisState.RUNNING
        assert not daemon.partial_logs()
        # No axis tripped, and still the last seconds are kept, with the reason.
        (record,) = list_records(daemon.logs).records
        assert record.cause == "loop_ended"
        assert "killed by SIGKILL" in record.message
        assert record.rows > 0


@pytest.mark.slow
def test_a_loop_that_stands_still_is_ended_and_starves_the_watchdog(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(60)
        with Daemon(tmp_path, NOTIFY_SOCKET=str(tmp_path / "notify")) as daemon:
            told = [manager.recv(4096).decode() for _ in range(8)]
            assert any(text.startswith("READY=1\n") for text in told)
            assert "WATCHDOG=1" in told
            pid = loop_pid(daemon)
            os.kill(pid, signal.SIGSTOP)
            # So that systemd waits for the log to be closed, instead of for the watchdog's food.
            while not manager.recv(4096).startswith(b"STOPPING=1\n"):
                pass
            assert daemon.process.wait(60) == 1
            assert "the loop has not ticked for" in daemon.said
            assert not alive(pid)
            assert pq.read_metadata(daemon.log()).num_rows > 0


def test_a_daemon_says_a_word_before_it_loads_anything_and_a_stop_while_starting_is_told(
    tmp_path: Path,
) -> None:
    daemon = Daemon(tmp_path)
    wait_until(lambda: bool(daemon.said))
    assert daemon.end() == 0
    first, *_, last = daemon.said.splitlines()
    assert first == "motorctl: starting"
    assert "motorctl: told to stop" in daemon.said, daemon.said
    assert last.startswith("motorctl: ")
    assert not list(tmp_path.glob("*.sock"))


def test_a_stop_while_the_loop_is_compiled_is_told_and_so_is_what_takes_long(
    tmp_path: Path,
) -> None:
    daemon = Daemon(tmp_path, XDG_CACHE_HOME=str(tmp_path / "cache"))  # nothing is kept there
    wait_until(lambda: "compiling the control loop (about 10 s" in daemon.said, 240)
    told = daemon.ask("status")["loop"]["preparing"]
    assert "the control loop is being compiled, once for this configuration (about 10 s" in told
    wait_until(lambda: "compiling the kernels of 2 axes" in daemon.said, 240)
    assert daemon.end() == 0
    assert "s of starting, before the first tick: no axis was enabled" in daemon.said
    assert all(line.startswith("motorctl: ") for line in daemon.said.splitlines()), daemon.said


TOLD_BEFORE_THE_EVENT_LOOP = """
import os, signal
import motorctl.cli
from motorctl.daemon import supervisor

class Told(supervisor.CompilingBeside):
    def __init__(self, compile):
        super().__init__(compile)
        os.kill(os.getpid(), signal.SIGTERM)

supervisor.CompilingBeside = Told
motorctl.cli.main()
"""


def test_a_stop_between_the_libraries_and_the_event_loop_is_not_lost(tmp_path: Path) -> None:
    config = tmp_path / "bench.yaml"
    config.write_text(bench_config())
    told = subprocess.run(
        [
            *(sys.executable, "-c", ended_with_the_tests(TOLD_BEFORE_THE_EVENT_LOOP)),
            *("run", config, "--log-dir", tmp_path / "logs"),
            *("--socket", tmp_path / "motorctl.sock"),
        ],
        env={**os.environ, "XDG_STATE_HOME": str(tmp_path / "state")},
        stderr=subprocess.PIPE,
        text=True,
        timeout=240,
        check=False,
    )
    assert told.returncode == 0, told.stderr
    assert "s of starting, before the first tick: no axis was enabled" in told.stderr
    assert not list(tmp_path.glob("*.sock"))


def test_a_daemon_that_cannot_start_leaves_the_signals_to_its_caller(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")
    (tmp_path / "bench.yaml").write_text(bench_config())
    before = [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)]
    options = supervisor.DaemonOptions(log_directory=tmp_path / "taken")
    with pytest.raises(UsageError, match="taken"):
        supervisor.run_daemon(load(str(tmp_path / "bench.yaml")), options)
    assert [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)] == before


@pytest.mark.slow
def test_a_stop_before_the_first_tick_forgets_nothing(tmp_path: Path) -> None:
    kept = tmp_path / "state" / "motorctl" / "bench.json"
    kept.parent.mkdir(parents=True)
    kept.write_text("what an earlier run left")
    daemon = Daemon(tmp_path, bench_config(keep_learned=True))
    wait_until(lambda: daemon.cli("status").returncode == 0, 240)
    # The loop may tick by now: then the daemon has every right to write a new file.
    starting = daemon.ask("status")["loop"]["phase"] != "running"
    assert daemon.end() == 0
    assert "learned parameters ignored: Invalid JSON" in daemon.said
    assert "Traceback" not in daemon.said
    assert not starting or kept.read_text() == "what an earlier run left"


@pytest.mark.slow
def test_a_refusal_of_the_loop_is_shown_in_one_line(tmp_path: Path) -> None:
    # A CPU that does not exist cannot be pinned to, whatever rights the test has.
    config = bench_config(without_realtime="refuse").replace("loop: {", "loop: {cpu: 4000, ")
    daemon = Daemon(tmp_path, config)
    assert daemon.process.wait(240) == 1
    last = daemon.said.strip().splitlines()[-1]
    assert "loop.without_realtime is 'refuse'" in last
    assert "not pinned to a CPU" in last
    assert not list(daemon.logs.iterdir())


@pytest.mark.slow
def test_what_cannot_work_is_told_before_anything_starts(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    daemon = Daemon(tmp_path)
    daemon.process.kill()
    daemon.process.wait()
    daemon.logs = tmp_path / "file" / "logs"
    assert daemon.launch().wait(120) == 2
    assert f"log directory {daemon.logs}: cannot be made: Not a directory" in daemon.said
    done = daemon.cli("status")
    assert done.returncode == 1
    assert "no daemon answers on" in done.stderr
    assert command("run")[-1] == "run"


@pytest.mark.slow
def test_a_full_disk_stops_no_axis_and_is_counted(tmp_path: Path) -> None:
    import resource

    with Daemon(tmp_path) as daemon:
        daemon.ask("start", axis="x")
        # Less than a log's metadata: so no next log can be begun, either.
        resource.prlimit(daemon.process.pid, resource.RLIMIT_FSIZE, (4096, 4096))
        wait_until(lambda: daemon.ask("status")["recording"]["failure"] is not None)
        status = daemon.ask("status")
        assert "recording cannot be opened" in status["recording"]["failure"]
        wait_until(lambda: daemon.ask("status")["recording"]["rows_lost"] > 0)
        assert status["axes"]["x"]["state"] == "idle"
        assert daemon.end() == 1
        assert "recording" in daemon.said
        (left,) = daemon.partial_logs()
        assert pq.read_metadata(recover(left).path).num_rows > 0
