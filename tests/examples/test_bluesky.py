"""The examples for bluesky: an axis of a running daemon as a device of ophyd-async."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from daemon_rig import Daemon

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock(lanes=3)]

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    with Daemon(tmp_path_factory.mktemp("daemon")) as running:
        yield running


def example(code: str | Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run an example, or code beside the examples, in an interpreter of its own."""
    run = [str(code)] if isinstance(code, Path) else ["-c", code]
    return subprocess.run(
        [sys.executable, *run, *map(str, arguments)],
        cwd=EXAMPLES,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_a_plan_scans_an_axis_and_measures_at_every_place(daemon: Daemon) -> None:
    done = example(EXAMPLES / "bluesky_scan.py", daemon.socket, "x", 0.05, 0.13, 5)
    assert done.returncode == 0, done.stderr
    told = re.findall(r"x at +(\S+) mm: following error (\S+) µm rms", done.stdout)
    places = [float(place) for place, _ in told]
    assert places == pytest.approx([50.0, 70.0, 90.0, 110.0, 130.0], abs=1.0)
    assert all(0.0 < float(noise) < 5000.0 for _, noise in told)
    assert daemon.state("x") == "idle"


ROTARY = """
import asyncio, sys
from ophyd_axis import Axis, StandstillNoise
socket = sys.argv[1]
async def main():
    joint = Axis(socket, "x", "joint", unit="rad")
    noise = StandstillNoise(socket, "x", "noise", unit="rad")
    await joint.connect(mock=True)
    await noise.connect(mock=True)
    print((await joint.position.describe())["joint-position"]["units"])
    print((await noise.rms.describe())["noise-rms"]["units"])
    await Axis(socket, "x", "joint", unit="rad").connect()
asyncio.run(main())
"""


def test_a_joint_is_described_in_radians_and_a_wrong_unit_is_refused(daemon: Daemon) -> None:
    done = example(ROTARY, daemon.socket)
    assert done.stdout.split() == ["rad", "rad"]
    assert "axis x is in m: give unit='m'" in done.stderr


BEYOND = """
import sys
import bluesky.plan_stubs as bps
from bluesky.run_engine import RunEngine
from ophyd_async.core import init_devices
from ophyd_axis import Axis
run_engine = RunEngine({})
with init_devices():
    stage = Axis(sys.argv[1], "y")
run_engine(bps.stage(stage, wait=True))
run_engine(bps.mv(stage, 9.0))
"""


def test_a_move_beyond_a_limit_fails_the_plan_with_the_reason(daemon: Daemon) -> None:
    done = example(BEYOND, daemon.socket)
    assert done.returncode == 1
    assert "9" in done.stderr
    assert "DaemonRefusedError" in done.stderr
    assert "0.45" in done.stderr, "the limit"
    assert daemon.state("y") == "idle"


ABORTED = """
import sys
import bluesky.plan_stubs as bps
from bluesky.run_engine import RunEngine
from ophyd_async.core import init_devices
from ophyd_axis import Axis
run_engine = RunEngine({})
with init_devices():
    stage = Axis(sys.argv[1], "y")
def plan():
    yield from bps.stage(stage, wait=True)
    yield from bps.abs_set(stage, 0.3)
    yield from bps.sleep(0.1)
    raise ValueError("the plan changed its mind")
run_engine(plan())
"""


def test_a_plan_that_fails_while_the_axis_moves_ramps_it_down(daemon: Daemon) -> None:
    done = example(ABORTED, daemon.socket)
    assert "the plan changed its mind" in done.stderr
    axis = daemon.ask("status", axis="y")["axes"]["y"]
    assert (axis["state"], axis["fault"]) == ("off", None)
    assert axis["position_m"] < 0.29
