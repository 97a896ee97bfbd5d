"""Commands to a running daemon: states, limits, programs, and independent axes."""

from __future__ import annotations

import json
import os
import re
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from daemon_rig import Daemon, wait_until
from typer.testing import CliRunner

import motorctl
from motorctl.cli import make_app
from motorctl.daemon.client import Client, DaemonRefusedError
from motorctl.daemon.program_transfer import packed
from motorctl.daemon.supervisor import NICENESS

pytestmark = pytest.mark.wall_clock(lanes=3)


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    with Daemon(tmp_path_factory.mktemp("daemon")) as running:
        yield running


@pytest.fixture
def idle(daemon: Daemon) -> Daemon:
    """Both axes enabled and holding."""
    daemon.hold("x", "y")
    return daemon


def refusal(daemon: Daemon, do: str, **arguments: object) -> DaemonRefusedError:
    with pytest.raises(DaemonRefusedError) as refused:
        daemon.ask(do, **arguments)
    return refused.value


def test_axes_start_and_stop_while_the_other_one_runs(idle: Daemon) -> None:
    idle.ask("program", axis="x", name="shuttle")
    idle.ask("stop", axis="y")
    wait_until(lambda: idle.state("y") == "off")
    assert idle.state("x") == "running"
    idle.ask_when_it_stands("start", "y")
    idle.ask("move", axis="y", position_m=0.12)
    wait_until(lambda: idle.state("y") == "idle")
    assert idle.state("x") == "running"
    idle.ask("stop", axis="x")
    wait_until(lambda: idle.state("x") == "off")
    assert idle.state("y") == "idle"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may go before others")
def test_a_busy_computer_does_not_starve_the_supervisor(daemon: Daemon) -> None:
    pid = daemon.ask("status")["daemon"]["pid"]
    assert os.getpriority(os.PRIO_PROCESS, pid) == NICENESS < 0


def test_start_holds_the_axis_where_it_stands(idle: Daemon) -> None:
    axis = idle.ask("status", axis="x")["axes"]["x"]
    assert (axis["state"], axis["drive_state"]) == ("idle", "operation_enabled")
    assert abs(axis["following_error_m"]) < 0.01
    assert idle.ask("start", axis="x")["state"] == "idle"  # it holds already: nothing to do


def test_a_move_ends_where_it_was_sent(idle: Daemon) -> None:
    answer = idle.ask("move", axis="x", position_m=0.08, velocity_m_s=0.2)
    assert answer["duration_s"] > 0
    wait_until(lambda: idle.state("x") == "idle")
    axis = idle.ask("status", axis="x")["axes"]["x"]
    assert axis["reference_m"] == pytest.approx(0.08, abs=1e-12)
    assert axis["position_m"] == pytest.approx(0.08, abs=0.005)


def test_a_move_by_a_way_ends_so_far_from_where_the_axis_held(idle: Daemon) -> None:
    held_m = idle.ask("status", axis="x")["axes"]["x"]["reference_m"]
    way_m = 0.02 if held_m < 0.2 else -0.02
    answer = idle.ask("move", axis="x", by_m=way_m)
    assert answer["target_m"] == pytest.approx(held_m + way_m, abs=1e-12)
    wait_until(lambda: idle.state("x") == "idle")
    reference_m = idle.ask("status", axis="x")["axes"]["x"]["reference_m"]
    assert reference_m == pytest.approx(held_m + way_m, abs=1e-12)


@pytest.mark.parametrize("arguments", [{}, {"position_m": 0.1, "by_m": 0.01}])
def test_a_move_with_neither_or_both_is_refused(idle: Daemon, arguments: dict[str, float]) -> None:
    no = refusal(idle, "move", axis="x", **arguments)
    assert no.code == "bad_request"
    assert "give either position_m or by_m" in str(no)


def test_stop_all_ramps_every_enabled_axis_down(idle: Daemon) -> None:
    idle.ask("program", axis="x", name="shuttle")
    done = idle.cli("stop", "--all")
    assert (done.returncode, done.stdout) == (0, "axis x: off\naxis y: off\n"), done.stderr
    assert (idle.state("x"), idle.state("y")) == ("off", "off")
    assert idle.cli("stop", "--all").stdout == "no axis was enabled\n"
    assert idle.cli("stop").returncode == 2


def test_reset_all_clears_the_fault_of_every_axis_that_has_one(idle: Daemon) -> None:
    assert idle.cli("reset", "--all").stdout == "no axis was in fault\n"
    idle.ask("estop")
    done = idle.cli("reset", "--all")
    assert (done.returncode, done.stdout) == (0, "axis x: off\naxis y: off\n"), done.stderr
    assert (idle.state("x"), idle.state("y")) == ("off", "off")
    assert idle.cli("reset").returncode == 2
    assert idle.cli("reset", "x", "--all").returncode == 2


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"position_m": 0.46}, "0.46"),
        ({"position_m": -0.06}, "0.06"),
        ({"position_m": 0.1, "velocity_m_s": 1.01}, "velocity 1.01"),
        ({"position_m": 0.1, "acceleration_m_s2": 11}, "acceleration 11"),
        ({"position_m": 0.1, "velocity_m_s": 1e-300}, "must be above 1e-09"),
    ],
)
def test_a_move_beyond_a_limit_moves_nothing(
    idle: Daemon, arguments: dict[str, float], named: str
) -> None:
    no = refusal(idle, "move", axis="x", **arguments)
    assert (no.code, no.exit_status) == ("out_of_limits", 2)
    assert named in str(no)
    assert idle.state("x") == "idle"


def test_a_program_beyond_a_limit_moves_nothing(idle: Daemon) -> None:
    document = {
        "kind": "point_to_point",
        "axis": "y",
        "start_m": 0.1,
        "target_m": 0.4,
        "max_velocity_m_s": 0.9,
        "max_acceleration_m_s2": 50,
        "max_jerk_m_s3": 1000,
    }
    no = refusal(idle, "program", axis="y", name="hard", document=document)
    assert (no.code, no.exit_status) == ("out_of_limits", 2)
    assert "acceleration" in str(no)
    assert "voltage" in str(no)
    assert idle.state("y") == "idle"


def test_the_wrong_state_is_told_with_what_is_possible(idle: Daemon) -> None:
    idle.ask("program", axis="x", name="shuttle")
    no = refusal(idle, "move", axis="x", position_m=0.1)
    assert (no.code, no.exit_status) == ("wrong_state", 2)
    assert (
        str(no) == "axis x is running (operation enabled): move is not possible; possible now: stop"
    )
    assert refusal(idle, "start", axis="x").code == "wrong_state"
    assert refusal(idle, "program", axis="x", name="shuttle").code == "wrong_state"
    assert refusal(idle, "reset", axis="x").code == "wrong_state"
    idle.ask("stop", axis="x")
    wait_until(lambda: idle.state("x") == "off")
    assert idle.ask("stop", axis="x")["state"] == "off"  # it stands already: nothing to do
    assert refusal(idle, "move", axis="x", position_m=0.1).code == "wrong_state"
    assert refusal(idle, "home", axis="x").code == "no_homing"


def test_unknown_names_are_told_with_the_known_ones(idle: Daemon) -> None:
    assert "known: x, y" in str(refusal(idle, "start", axis="z"))
    assert "known: shuttle, ring" in str(refusal(idle, "program", axis="x", name="dance"))
    no = refusal(idle, "program", axis="y", name="shuttle")
    told = "program 'shuttle' moves x, not axis y: name one that it moves"
    assert (no.code, str(no)) == ("bad_program", told)


def test_a_program_over_two_axes_begins_on_both_in_the_same_tick(idle: Daemon) -> None:
    idle.ask("stop", axis="y")
    wait_until(lambda: idle.state("y") == "off")
    assert "axis y is off" in str(refusal(idle, "program", axis="x", name="ring"))
    assert idle.state("x") == "idle"
    idle.ask_when_it_stands("start", "y")
    answer = idle.ask("program", axis="y", name="ring")
    assert answer["axes"] == ["x", "y"]
    assert {idle.state("x"), idle.state("y")} == {"running"}
    motions = [axis["motion"] for axis in idle.ask("status")["axes"].values()]
    assert motions[0]["duration_s"] == motions[1]["duration_s"]
    wait_until(lambda: idle.state("x") == idle.state("y") == "idle")


def test_an_emergency_stop_trips_every_axis_until_it_is_reset(idle: Daemon) -> None:
    idle.ask("program", axis="x", name="shuttle")
    idle.ask("estop")
    wait_until(lambda: idle.state("x") == idle.state("y") == "fault")
    fault = idle.ask("status", axis="x")["axes"]["x"]["fault"]
    assert fault["cause"] == "estop"
    assert fault["message"].startswith("emergency stop, at ")
    no = refusal(idle, "start", axis="x")
    assert str(no) == (
        "axis x is in fault: start is not possible; possible now: reset; `motorctl status x` tells "
        "why it tripped, and what to do"
    )
    idle.ask_when_it_stands("reset", "x")
    x, y = idle.ask("status")["axes"].values()
    assert (x["state"], y["state"], y["drive_state"]) == ("off", "fault", "fault")
    assert x["drive_state"] in ("switch_on_disabled", "ready_to_switch_on")  # it may still coast


def record_of(daemon: Daemon, message: str) -> dict[str, Any]:
    """Wait for the flight record of a fault, which comes when the seconds after it have passed."""
    documents: list[dict[str, Any]] = []

    def is_shown() -> bool:
        result = CliRunner().invoke(make_app(), ["fault", "show", "--json", *daemon.at])
        documents.append(json.loads(result.stdout) if result.exit_code == 0 else {})
        recorded = documents[-1].get("message", "nothing")
        return message.startswith(recorded)  # the status also says what to do

    wait_until(is_shown)
    return documents[-1]


def test_the_seconds_before_a_fault_are_shown_by_the_running_daemon(idle: Daemon) -> None:
    idle.ask("estop")
    wait_until(lambda: idle.state("x") == idle.state("y") == "fault")
    document = record_of(idle, idle.ask("status")["axes"]["x"]["fault"]["message"])
    assert re.search(r"-x-estop(-\d+)?$", document["id"])  # there may be one of this second
    assert set(document["faults"]) == {"x", "y"}
    moment = document["moment"]
    assert (moment["before"]["x"]["state"], moment["at"]["x"]["state"]) == ("idle", "fault")
    assert moment["at"]["x"]["values"]["command_v"] == 0.0
    shown = idle.cli("status").stdout
    assert f"motorctl fault show {document['id']}" in shown
    path = idle.ask("status")["recording"]["flight_records"]["newest_path"]
    assert (Path(path).is_absolute(), Path(path).stem) == (True, document["id"])
    words = "".join(line.strip("│ ") for line in shown.splitlines())
    assert f"motorctl scope {path}" in words.replace("scope/", "scope /")  # wrapped, if it is long
    assert motorctl.open_log(path).rows == document["rows"]


@pytest.mark.slow
def test_a_fault_that_is_reset_at_once_is_in_record_and_journal_all_the_same(
    idle: Daemon,
) -> None:
    told = idle.said.count("axis x: fault: ")
    for k in range(3):  # both look twenty times a second, and might see it by luck
        idle.ask("estop")
        idle.ask("reset", axis="x")
        message = idle.ask("status")["axes"]["y"]["fault"]["message"]
        idle.ask("reset", axis="y")
        assert list(record_of(idle, message)["faults"]) == ["x", "y"]
        wait_until(lambda k=k: idle.said.count("axis x: fault: ") > told + k)
        for axis in ("x", "y"):
            idle.ask_when_it_stands("start", axis)
    assert idle.said.count("axis x: fault: ") == told + 3


@pytest.mark.slow
def test_a_program_file_travels_to_the_daemon(idle: Daemon, tmp_path: Path) -> None:
    file = tmp_path / "there.yaml"
    file.write_text(
        "{kind: point_to_point, axis: x, start_m: 0.1, target_m: 0.11, max_velocity_m_s: 0.1,"
        " max_acceleration_m_s2: 1.0, max_jerk_m_s3: 50}"
    )
    done = idle.cli("program", "x", str(file), "--wait")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("axis x: program there on x: ")
    reference = idle.ask("status", axis="x")["axes"]["x"]["reference_m"]
    assert reference == pytest.approx(0.11, abs=1e-12)


@pytest.mark.slow
def test_recorded_points_travel_to_the_daemon(idle: Daemon, tmp_path: Path) -> None:
    time_s = np.linspace(0, 1, 51)
    x_m = 0.1 + 0.01 * (1 - np.cos(np.pi * time_s)) ** 2
    file = tmp_path / "points.csv"
    rows = "".join(f"{t:.6f},{x:.9f}\n" for t, x in zip(time_s, x_m, strict=True))
    file.write_text("time_s,x_m\n" + rows)
    (tmp_path / "shape.yaml").write_text("{kind: points, axes: [x], file: points.csv, ease_s: 0.2}")
    request = packed(tmp_path / "shape.yaml", ["x", "y"])
    assert request["files"]["points.csv"].startswith("time_s,x_m")
    assert idle.ask("program", axis="x", **request)["program"] == "shape"
    wait_until(lambda: idle.state("x") == "idle")


def test_the_daemon_opens_no_file_on_a_clients_word(idle: Daemon, tmp_path: Path) -> None:
    secret = tmp_path / "secret.csv"
    secret.write_text("time_s,x_m\nsecret,words\n")
    document = {"kind": "points", "axes": ["x"], "file": str(secret)}
    no = refusal(idle, "program", axis="x", name="mine", document=document)
    assert (no.code, str(no)) == (
        "bad_program",
        "mine: file: its text is not in the request's files",
    )
    sent = {"document": document, "files": {str(secret): "time_s,x_m\n0,zero\n1,0.1\n"}}
    no = refusal(idle, "program", axis="x", name="mine", **sent)
    assert str(no).startswith("points.csv:2: x_m: 'zero' is no number")


def test_a_bad_program_is_refused_with_its_key(idle: Daemon) -> None:
    document = {"kind": "circle", "axes": ["x", "q"]}
    no = refusal(idle, "program", axis="x", name="mine", document=document)
    assert no.code == "bad_program"
    assert "mine: center_m: this key is missing" in str(no)


def test_the_command_line_tells_errors_with_their_exit_status(
    daemon: Daemon, tmp_path: Path
) -> None:
    unknown = daemon.cli("start", "z")
    assert (unknown.returncode, unknown.stdout) == (2, "")
    assert unknown.stderr == "motorctl: unknown axis 'z'; known: x, y\n"
    missing = daemon.cli("program", "x", str(tmp_path / "none.yaml"))
    assert missing.returncode == 2
    assert "none.yaml" in missing.stderr
    negative = daemon.cli("move", "x", "-0.3")
    assert negative.returncode == 2
    assert "Traceback" not in unknown.stderr + missing.stderr + negative.stderr


def test_status_is_one_json_document_or_a_table(idle: Daemon) -> None:
    done = idle.cli("status", "x", "--json")
    document = json.loads(done.stdout)
    assert done.stderr == ""
    assert document["machine"] == "bench"
    assert document["loop"]["phase"] == "running"
    assert list(document["axes"]) == ["x"]
    assert document["axes"]["x"]["theta_hat"].keys() >= {"inertia", "em_cubic"}
    assert document["recording"]["rows_lost"] == 0
    shown = idle.cli("status").stdout
    assert "bench" in shown
    assert max(map(len, shown.splitlines())) <= 80


def test_a_hostile_client_stops_no_axis(idle: Daemon) -> None:
    idle.ask("program", axis="x", name="shuttle")
    generator = np.random.default_rng(1)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as hostile:
        hostile.connect(str(idle.socket))
        hostile.settimeout(20)
        for size in (1, 100, 10_000):
            hostile.sendall(generator.bytes(size) + b"\n")
        deep = b'{"do":"program","axis":"x","name":"n","document":' + b'{"a":' * 5000
        hostile.sendall(deep + b"1" + b"}" * 5001 + b"\n")
        with Client(idle.socket) as other:
            assert other.axis("x")["state"] == "running"
            assert other.axis("y")["state"] == "idle"


def test_the_log_holds_every_tick_and_what_was_commanded(idle: Daemon) -> None:
    """Runs last: it ends the module's daemon."""
    idle.ask("program", axis="x", name="ring")
    wait_until(lambda: idle.state("x") == "idle")
    assert idle.end() == 0, idle.said
    table = pq.read_table(idle.log())
    metadata = json.loads(table.schema.metadata[b"motorctl"])
    tick = table["tick"].to_numpy()
    assert tick[-1] == metadata["loop"]["ticks"]
    assert (np.diff(tick, prepend=-1) > 0).all()
    assert (np.diff(tick, prepend=-1) - 1).sum() == metadata["loop"]["skipped_periods"]
    assert metadata["rows_lost"] == 0
    motion = metadata["motions"][-1]
    assert (motion["name"], motion["axes"]) == ("ring", ["x", "y"])
    # Both references leave their places right at the tick that was ordered for both.
    for axis in motion["axes"]:
        reference = table[f"{axis}.reference_m"].to_numpy()
        moving = tick[1:][np.diff(reference) != 0]
        assert motion["start_tick"] <= moving[moving >= motion["start_tick"] - 10][0]
    assert not idle.partial_logs()
