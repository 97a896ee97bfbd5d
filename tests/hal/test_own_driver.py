"""A third party's driver, installed as a package of its own: found, checked, run, conforming."""

from __future__ import annotations

import json
import os
import re
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import typer
from click.testing import Result
from daemon_rig import DRIVER, Daemon, bench_config, wait_until
from typer.testing import CliRunner

from motorctl.cli import check, drivers
from motorctl.hal import Channel, Driver, Inputs, Outputs, Status
from motorctl.log import read_recording
from motorctl.log.sample import AxisState

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "docs" / "drivers" / "example"
PAGE = ROOT / "docs" / "drivers" / "your_own.md"
RATE_HZ = 400
LATE = "{hold_ticks: 200, predict: true}"
"""Two processes share few processors with whatever else runs: the box may be late."""


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> Path:
    """Install the example apart from everything else; give the folder."""
    folder = tmp_path_factory.mktemp("own")
    source = shutil.copytree(EXAMPLE, folder / "source")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
    alone = ["--no-deps", "--no-index", "--no-build-isolation", "--target", str(folder / "site")]
    subprocess.run([*pip, *alone, str(source)], check=True, timeout=120, capture_output=True)
    return folder / "site"


def box_config(port: int, **changes: str) -> str:
    """Write the bench's configuration with a box in place of the simulated gantry."""
    text = bench_config("ring", "ring").replace("turns: 1}", "turns: 3}")
    text = text.replace(
        DRIVER,
        f"{{type: box, host: 127.0.0.1, port: {port}, late: {LATE}}}",
    )
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    return text


@pytest.fixture
def box() -> Iterator[int]:
    """Yield the port of a box with the simulated gantry behind it."""
    script = Path(__file__).parent / "box_gantry.py"
    with subprocess.Popen(
        [sys.executable, str(script), str(1.0 / RATE_HZ)], stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            yield int(process.stdout.readline())
        finally:
            process.kill()


@pytest.fixture
def at_hand(installed, monkeypatch):
    """Let this process find the example as well."""
    monkeypatch.syspath_prepend(str(installed))
    yield
    sys.modules.pop("motorctl_box", None)


def run(*arguments: object) -> Result:
    """Run `motorctl drivers` or `motorctl check`."""
    app = typer.Typer()
    check.register(app)
    drivers.register(app)
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_motorctl_finds_the_driver_by_its_entry_point(at_hand):
    found = {
        entry["name"]: entry for entry in json.loads(run("drivers", "--json").stdout)["drivers"]
    }
    assert found["box"]["package"] == "motorctl-box"


def test_check_knows_its_options_its_layout_and_its_rate(at_hand, tmp_path):
    path = tmp_path / "machine.yaml"

    def problems(**changes: str) -> str:
        path.write_text(box_config(7710, **changes))
        told = run("check", path)
        return "" if told.exit_code == 0 else str(told.exception)

    assert problems() == ""
    assert "drivers.gantry.prot" in problems(**{"port: 7710": "prot: 7710"})
    assert "drivers.gantry.port" in problems(**{"port: 7710": "port: 77100"})
    narrow = problems(**{"counter_bits: 32": "counter_bits: 16"})
    assert "a box has channels 0, 1, ..., with counters of 32 bits" in narrow
    fast = problems(**{"rate_hz: 400": "rate_hz: 9000"})
    assert "driver 'gantry' carries at most" in fast
    assert "bytes of 0.08 us + 160 us to answer" in fast


class OneAnswer:
    """Stands for the driver's socket: sends nothing, gives one datagram."""

    def __init__(self, answer: bytes = b"") -> None:
        self.answer = answer

    def poll(self, timeout_ms: int) -> list[int]:
        return [1] if self.answer else []

    def recv_into(self, space, size: int, flags: int) -> int:
        came, self.answer = self.answer, b""
        space.reshape(-1)[: len(came)] = np.frombuffer(came, np.uint8)
        return len(came)

    def send(self, data, flags: int) -> int:
        raise BlockingIOError


def box_driver() -> tuple[Driver, Inputs]:
    """Make the example's driver, not open, and what it reads into."""
    from motorctl_box import BoxDriver

    options = BoxDriver.Options(host="127.0.0.1", port=9)
    channels = [Channel(name, i, 0.5e-6, 32, 10.0) for i, name in enumerate("xy")]
    return BoxDriver(options, channels, 1e-3), Inputs(2)


def test_its_example_takes_no_answer_to_an_older_command(at_hand):
    driver, inputs = box_driver()
    for _ in range(3):
        driver.write(Outputs(2))
    told = []
    for number in (2, 3, 4):
        answer = struct.pack("<qI2i2B", number, 7, 100 * number, -number, 0, 0)
        driver._socket = driver._poll = OneAnswer(answer)
        driver.read(inputs)
        told.append((inputs.counts.tolist(), inputs.status.tolist()))
    refused = int(Status.STALE | Status.CORRUPT)
    assert told == [([0, 0], [refused] * 2), ([300, -3], [0, 0]), ([300, -3], [refused] * 2)]


def test_its_example_does_not_take_a_full_queue_for_a_lost_box(at_hand):
    driver, inputs = box_driver()
    driver._socket = driver._poll = OneAnswer()
    driver.write(Outputs(2))
    driver.read(inputs)
    assert inputs.status.tolist() == [int(Status.STALE)] * 2


@pytest.mark.slow
@pytest.mark.wall_clock(lanes=3)
def test_a_box_that_is_not_there_is_named(installed, tmp_path):
    daemon = Daemon(tmp_path, box_config(9), PYTHONPATH=str(installed))
    assert daemon.process.wait(120) == 1
    assert "motion box at 127.0.0.1:9: " in daemon.said
    assert "Traceback" not in daemon.said


@pytest.mark.slow
@pytest.mark.wall_clock(lanes=3)
def test_c2_follows_a_circle_through_it_in_real_time(installed, box, tmp_path):
    environment = {"PYTHONPATH": str(installed)}
    with Daemon(tmp_path, box_config(box), **environment) as daemon:
        for axis in ("x", "y"):
            daemon.ask_when_it_stands("start", axis)
        wait_until(lambda: daemon.state("x") == daemon.state("y") == "idle")
        assert daemon.end() == 0, daemon.said
        log = daemon.log()
    recording = read_recording(log)
    for axis in recording.axes.values():
        error = axis.position - axis.reference
        states = np.asarray(axis.state)
        running = states == AxisState.RUNNING
        assert np.count_nonzero(running) > 2 * RATE_HZ
        assert (states != AxisState.FAULT).all()
        assert np.ptp(axis.reference[running]) > 0.03
        assert np.sqrt(np.mean(error[running] ** 2)) < 1.5e-3


@pytest.mark.slow
@pytest.mark.wall_clock(lanes=3)
def test_it_passes_the_conformance_suite_with_its_own_rig(installed):
    told = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider",
         str(EXAMPLE / "test_motorctl_box.py")],
        env={**os.environ, "PYTHONPATH": str(installed)},
        cwd=ROOT, capture_output=True, text=True, timeout=200, check=False,
    )  # fmt: skip
    assert told.returncode == 0, told.stdout
    assert int(re.search(r"(\d+) passed", told.stdout)[1]) >= 30
    assert re.search(r"1 skipped", told.stdout)  # it has no virtual time


@pytest.fixture
def follow_the_page(tmp_path):
    """Run a command of the page, not installed, where the page says; give how it ended."""
    shutil.copytree(EXAMPLE, tmp_path / "docs" / "drivers" / "example")
    (tmp_path / "machine.yaml").write_text(
        box_config(7710, **{"type: box": "type: 'motorctl_box:BoxDriver'"})
    )
    shown = re.findall(r"^(PYTHONPATH=(?:.*\\\n)*.*)$", PAGE.read_text(), re.MULTILINE)

    def run_shown(name: str, more: str = "") -> subprocess.CompletedProcess[str]:
        (command,) = (text for text in shown if f" {name} " in text)
        return subprocess.run(
            ["/bin/sh", "-c", f"{command.partition('#')[0]} {more}"],
            env={"PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin", "COLUMNS": "120"},
            cwd=tmp_path, capture_output=True, text=True, timeout=200, check=False,
        )  # fmt: skip

    return run_shown


@pytest.mark.slow
def test_a_driver_that_is_not_installed_is_found_as_the_page_says(follow_the_page):
    told = follow_the_page("motorctl check")
    assert (told.returncode, told.stderr) == (0, "")
    assert "motorctl_box:BoxDriver" in told.stdout


@pytest.mark.slow
@pytest.mark.parametrize("named", ["--driver", "--driver-rig"])
def test_what_is_not_installed_is_found_by_the_suite_as_the_page_says(follow_the_page, named):
    told = follow_the_page(named, "--collect-only -q -p no:cacheprovider")
    assert told.returncode == 0, told.stdout
    assert "TestDriver" in told.stdout


def test_a_driver_whose_module_is_not_found_is_told_with_the_way_to_it(tmp_path):
    path = tmp_path / "machine.yaml"
    path.write_text(box_config(7710, **{"type: box": "type: 'motorctl_box:BoxDriver'"}))
    said = str(run("check", path).exception)
    assert "drivers.gantry.type: " in said
    assert "module 'motorctl_box' is missing; is its folder on PYTHONPATH?" in said


def test_the_page_shows_the_example_as_it_is():
    page = PAGE.read_text()
    for name in ("motorctl_box.py", "pyproject.toml"):
        assert (EXAMPLE / name).read_text().strip() in page, name
    assert len((EXAMPLE / "motorctl_box.py").read_text().splitlines()) < 100
