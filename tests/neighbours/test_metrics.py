"""What Prometheus reads of a machine: the status, named by its conventions, and who may read it."""

from __future__ import annotations

import asyncio
import re
import socket
import sys
import threading
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from beam_bench import Held
from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.openmetrics.exposition import generate_latest as open_metrics
from prometheus_client.openmetrics.parser import (
    text_string_to_metric_families as open_metrics_parsed,
)
from prometheus_client.parser import text_string_to_metric_families
from served_socket import served
from told_status import document_of, reported

from motorctl.api.status import MachineStatus
from motorctl.cli import main
from motorctl.daemon.protocol import Request
from motorctl.daemon.report import Report
from motorctl.loop import Verb
from motorctl.neighbours import metrics_server
from motorctl.neighbours.metrics import metrics_of
from motorctl.neighbours.metrics_server import Access, DaemonCollector, application, open_server

TOKEN = "0123456789abcdef0123"
UNITS = "meters|volts|seconds|hertz|bytes|ratio|meters_per_second"

Samples = dict[tuple[str, frozenset[tuple[str, str]]], float]


class Told:
    """A collector of one document."""

    def __init__(self, document: dict[str, Any]) -> None:
        self._document = document

    def collect(self) -> Any:
        return metrics_of(MachineStatus.of(self._document))


def text_of(document: dict[str, Any], write: Callable[..., bytes] = generate_latest) -> str:
    registry = CollectorRegistry(auto_describe=False)
    registry.register(Told(document))  # type: ignore[arg-type]
    return write(registry).decode()


def read(text: str) -> Samples:
    return {
        (sample.name, frozenset(sample.labels.items())): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def value(samples: Samples, name: str, **labels: str) -> float:
    return samples[f"motorctl_{name}", frozenset(labels.items())]


def test_numbers_are_those_of_the_status_in_base_units(tmp_path: Path) -> None:
    with reported(tmp_path) as (rig, report):
        rig.move("x", 0.1)
        rig.advance(400)
        document = document_of(rig, report)
    assert value(read(text_of(document)), "recorder_trouble") == 0.0
    document["recording"] |= {"trouble": "the next log cannot be begun", "rows_lost": 7}
    document["recording"] |= {"disk": {"free_mb": 250.0, "free_files": 12, "hours_left": 2.0}}
    timing = {"p50_s": 4e-6, "p99_s": 9e-6, "p999_s": 2e-5, "max_s": 3e-4, "max_at_s": 1.0}
    document["loop"]["turnaround"] = timing
    samples, x = read(text_of(document)), document["axes"]["x"]
    for name, key in (
        ("position_meters", "position_m"),
        ("velocity_meters_per_second", "velocity_m_s"),
        ("following_error_meters", "following_error_m"),
        ("command_volts", "command_v"),
    ):
        assert value(samples, f"axis_{name}", axis="x") == x[key] != 0.0
    assert value(samples, "axis_homed", axis="x") == 1.0
    assert value(samples, "loop_ticks_total") == document["loop"]["ticks"]
    assert value(samples, "recorder_rows_lost_total") == 7
    assert value(samples, "recorder_trouble") == 1.0
    assert value(samples, "recorder_disk_free_bytes") == 250e6
    assert value(samples, "recorder_disk_free_files") == 12
    assert value(samples, "recorder_disk_left_seconds") == 7200
    assert value(samples, "loop_turnaround_seconds", quantile="0.99") == 9e-6
    assert value(samples, "loop_turnaround_max_seconds") == 3e-4
    about = {"version": document["daemon"]["version"], "machine": "published-gantry"}
    assert value(samples, "daemon_build_info", **about) == 1.0
    x["position_unit"] = "rad"  # as of a rotary axis
    samples = read(text_of(document))
    assert value(samples, "axis_position_radians", axis="x") == x["position_m"]
    assert value(samples, "axis_velocity_radians_per_second", axis="x") == x["velocity_m_s"]
    meters = {dict(labels)["axis"] for name, labels in samples if "_meters" in name}
    assert meters <= {"y"}


def test_an_axis_has_one_state_and_a_fault_its_cause(tmp_path: Path) -> None:
    def states(name: str, axis: str) -> list[str]:
        label = f"motorctl_axis_{name}"
        return [
            dict(labels)[label]
            for (found, labels), on in samples.items()
            if found == label and on and dict(labels)["axis"] == axis
        ]

    with reported(tmp_path) as (rig, report):
        samples = read(text_of(document_of(rig, report)))
        assert (states("state", "x"), states("state", "y")) == (["idle"], ["off"])
        assert states("fault", "x") == []
        rig.ask(Verb.ESTOP)
        samples = read(text_of(document_of(rig, report)))
        assert states("state", "x") == ["fault"]
        assert states("fault", "x") == ["estop"]


def test_the_load_of_a_motor_is_its_mean_square_command_by_the_continuous_one(
    tmp_path: Path,
) -> None:
    with reported(tmp_path) as (rig, report):
        rig.move("x", 0.1)
        rig.advance(1000)
        document = document_of(rig, report)
        # The same exponential mean square, of the rows that the loop wrote: tau is 10 s.
        heat_v2 = 0.0
        kept = 2.718281828459045 ** -(1 / rig.machine.rate_hz / 10.0)
        for command_v in rig.rows("x")["command_v"]:
            heat_v2 = kept * heat_v2 + (1.0 - kept) * command_v**2
    load = value(read(text_of(document)), "axis_motor_load_ratio", axis="x")
    assert load == pytest.approx(heat_v2 / 2.0**2, rel=1e-3)
    heat = document["axes"]["x"]["motor_heat"]
    assert heat["rms_command_v"] == pytest.approx(heat_v2**0.5, rel=1e-3)
    assert document["axes"]["y"]["motor_heat"] is None


def test_a_beam_tells_its_skew(tmp_path: Path) -> None:
    with Held() as rig:
        rig.put(30e-6, -10e-6)
        rig.advance(1)
        document = document_of(rig, Report(rig.machine, rig.memory, tmp_path / "s"))
    assert value(read(text_of(document)), "axis_skew_meters", axis="x") == pytest.approx(40e-6)


def test_names_are_as_prometheus_asks_and_both_formats_are_read(tmp_path: Path) -> None:
    with reported(tmp_path) as (rig, report):
        document = document_of(rig, report)
    families = {family.name: family for family in text_string_to_metric_families(text_of(document))}
    assert len(families) > 30
    for name, family in families.items():
        assert re.fullmatch(r"motorctl_[a-z]+(_[a-z]+)*", name)
        assert family.documentation.endswith(".")
        assert not re.search(r"_(mm|um|us|ms|mb|percent|m|v|s)$", name)
        for sample in family.samples:
            assert sample.name.endswith("_total") == (family.type == "counter")
    dimensioned = [n for n in families if re.search(rf"_({UNITS})$", n)]
    assert len(dimensioned) >= 14
    text = text_of(document, open_metrics)
    assert {f.name for f in open_metrics_parsed(text)} >= {"motorctl_up", "motorctl_axis_state"}


@contextmanager
def serving(path: Path, access: Access, told: list[str]) -> Iterator[int]:
    """Serve the metrics of the daemon on a socket; yields the port."""
    with open_server("127.0.0.1", 0, application(DaemonCollector(path, told.append), access)) as it:
        thread = threading.Thread(target=it.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            yield it.server_port
        finally:
            it.shutdown()
            thread.join()


def asked(port: int, path: str = "/metrics", **headers: str) -> tuple[int, str]:
    request = urllib.request.Request(f"http://127.0.0.1:{port}{path}", headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=20) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read().decode()


@pytest.mark.wall_clock(lanes=3)
def test_a_daemon_that_is_away_is_down_until_it_is_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(metrics_server, "keep_off_the_loop", lambda pid: None)
    told: list[str] = []
    with reported(tmp_path) as (rig, report):
        document = document_of(rig, report)

    async def handle(request: Request) -> dict[str, Any]:
        return document

    place = tmp_path / "s"
    with serving(place, Access("127.0.0.1", None), told) as port:
        for _ in range(2):
            code, text = asked(port)
            assert (code, value(read(text), "up")) == (200, 0.0)
            assert "motorctl_axis_state" not in text
        with served(place, handle):
            code, text = asked(port)
            assert (code, value(read(text), "up")) == (200, 1.0)
            assert "motorctl_axis_state" in text
        assert value(read(asked(port)[1]), "up") == 0.0
    assert [line.split(":")[0] for line in told] == [
        "no metrics of the daemon",
        "the daemon answers",
        "no metrics of the daemon",
    ]


@pytest.mark.wall_clock(lanes=3)
def test_a_daemon_that_hangs_is_down_for_every_scrape_in_time_and_up_when_it_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(metrics_server, "ANSWER_S", 0.15)
    kept_off: list[int] = []
    monkeypatch.setattr(metrics_server, "keep_off_the_loop", kept_off.append)
    told: list[str] = []
    with reported(tmp_path) as (rig, report):
        document = document_of(rig, report)
    goes_on, place = threading.Event(), tmp_path / "s"

    async def handle(request: Request) -> dict[str, Any]:
        while not goes_on.is_set():
            await asyncio.sleep(0.01)
        return document

    with (
        served(place, handle),
        serving(place, Access("127.0.0.1", None), told) as port,
        ThreadPoolExecutor(4) as scrapers,
    ):
        for _ in range(3):
            answers = list(scrapers.map(lambda _: asked(port), range(4)))
            assert [value(read(text), "up") for _, text in answers] == [0.0] * 4
        asking = [each for each in threading.enumerate() if each.name == "metrics-ask"]
        assert len(asking) == 1
        assert not kept_off
        goes_on.set()
        asking[0].join()
        assert value(read(asked(port)[1]), "up") == 1.0
    assert kept_off == [document["loop"]["pid"]]
    assert len(told) == 2
    assert "the daemon did not answer within 0.15 s" in told[0]


@pytest.mark.wall_clock(lanes=3)
def test_it_leaves_the_loop_s_cpu_before_any_thread_serves_and_that_of_the_next_loop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept_off: list[int] = []
    monkeypatch.setattr(metrics_server, "keep_off_the_loop", kept_off.append)
    with reported(tmp_path) as (rig, report):
        document = document_of(rig, report)

    async def handle(request: Request) -> dict[str, Any]:
        return document

    with served(tmp_path / "s", handle) as place:
        collector = DaemonCollector(place, lambda told: None)
        document["loop"]["pid"] = 2**22 + 1  # of no process
        collector.begin()
        document["loop"]["pid"] += 1
        list(collector.collect())
    assert kept_off == [2**22 + 1, 2**22 + 2]


@pytest.mark.wall_clock(lanes=3)
def test_a_scrape_may_name_metrics_and_a_head_has_no_body(tmp_path: Path) -> None:
    with serving(tmp_path / "none", Access("127.0.0.1", None), []) as port:
        code, text = asked(port, "/metrics?name[]=motorctl_up&name[]=motorctl_loop_ticks_total")
        assert (code, read(text)) == (200, {("motorctl_up", frozenset()): 0.0})
        assert asked(port, "/metrics?name[]=none_such") == (200, "")
        whole = asked(port)[1].encode()
        for path, status, length in (("/metrics", b"200 OK", len(whole)), ("/", b"404", None)):
            with socket.create_connection(("127.0.0.1", port)) as connection:
                asks = f"HEAD {path} HTTP/1.0\r\nHost: 127.0.0.1\r\n\r\n"
                connection.sendall(asks.encode())
                with connection.makefile("rb") as answer:
                    head, _, body = answer.read().partition(b"\r\n\r\n")
            assert status in head.splitlines()[0]
            assert length is None or f"Content-Length: {length}".encode() in head
            assert body == b""


@pytest.mark.wall_clock(lanes=3)
def test_only_metrics_are_read_and_only_under_the_server_s_own_name(tmp_path: Path) -> None:
    with serving(tmp_path / "none", Access("127.0.0.1", None), []) as port:
        assert asked(port)[0] == asked(port, Host=f"localhost:{port}")[0] == 200
        code, why = asked(port, Host="rebound.example")
        assert (code, "'rebound.example', which is none of this server's" in why) == (403, True)
        code, why = asked(port, Origin="http://elsewhere.example")
        assert (code, "metrics are for programs" in why) == (403, True)
        assert asked(port, "/") == (404, "refused: the metrics are at /metrics\n")
        request = urllib.request.Request(f"http://127.0.0.1:{port}/metrics", data=b"x")
        with pytest.raises(urllib.error.HTTPError, match="405"):
            urllib.request.urlopen(request, timeout=20)


@pytest.mark.wall_clock(lanes=3)
def test_with_a_token_only_who_sends_it_reads(tmp_path: Path) -> None:
    with serving(tmp_path / "none", Access("127.0.0.1", TOKEN), []) as port:
        for wrong in ({}, {"Authorization": f"Bearer {TOKEN}x"}, {"Authorization": "Bearer é"}):
            code, why = asked(port, **wrong)
            assert (code, "authorization.credentials_file" in why) == (401, True)
        assert asked(port, Authorization=f"Bearer {TOKEN}")[0] == 200


def run(monkeypatch: pytest.MonkeyPatch, *words: str) -> int | str | None:
    monkeypatch.setattr(sys, "argv", ["motorctl", "metrics", *words])
    with pytest.raises(SystemExit) as end:
        main()
    return end.value.code


def test_an_address_that_others_reach_asks_for_a_token(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert run(monkeypatch, "--address", "0.0.0.0") == 2
    told = capsys.readouterr().err
    assert "metrics on 0.0.0.0 are read by whoever reaches it" in told
    assert "openssl rand -hex 32" in told
    short = tmp_path / "token"
    short.write_text("secret\n")
    assert run(monkeypatch, "--address", "0.0.0.0", "--token-file", str(short)) == 2
    assert "holds 6 characters, should be one word of at least 16" in capsys.readouterr().err
    assert run(monkeypatch, "--token-file", str(tmp_path / "none")) == 2
    assert "the token cannot be read: No such file" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("address", "shown"), [("0.0.0.0", socket.gethostname()), ("127.0.0.1", "127.0.0.1")]
)
def test_the_address_that_it_prints_can_be_asked_from_elsewhere(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    address: str,
    shown: str,
) -> None:
    token = tmp_path / "token"
    token.write_text(TOKEN)

    def interrupted(server: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("socketserver.BaseServer.serve_forever", interrupted)
    at = ("--socket", str(tmp_path / "none"), "--port", "0", "--address", address)
    assert run(monkeypatch, *at, "--token-file", str(token)) == 0
    assert re.fullmatch(rf"http://{shown}:\d+/metrics  \(Ctrl-C ends\)\n", capsys.readouterr().out)


def test_a_port_that_is_taken_is_told_with_what_to_do(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert run(monkeypatch, "--port", port, "--socket", str(tmp_path / "none")) == 1
    told = capsys.readouterr().err
    assert f"cannot be served on 127.0.0.1, port {port}" in told
    assert "--port 0 takes any that is free" in told


def test_without_its_extra_it_says_how_to_install_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "prometheus_client", None)
    assert run(monkeypatch) == 2
    assert capsys.readouterr().err == (
        "motorctl: motorctl metrics needs prometheus-client, which is not installed: "
        "pip install 'motorctl[metrics]'\n"
    )
