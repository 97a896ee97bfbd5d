"""`motorctl latency` with the real loop process."""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path

import numpy as np
import pytest
import typer
from latency_device import Device
from loop_bench import gantry, with_axes, with_sim
from typer.testing import CliRunner

from motorctl.cli.latency import register
from motorctl.config import load
from motorctl.config.keys import LateSamples
from motorctl.config.machine import Machine
from motorctl.errors import RunError, UsageError
from motorctl.latency import LatencyOptions, measure_latency
from motorctl.latency.cyclictest import INSTALL
from motorctl.latency.verdict import judge
from motorctl.log import read_recording
from motorctl.log.sample import AxisState


def _ignore(_share: float) -> None:
    pass


def _on_metal(machine: Machine) -> Machine:
    """Return the machine on a device that is no simulation, forgiving whatever a pause does."""
    machine = with_axes(machine, limits={"following_error": {"filter_time_s": 1e3}})
    late = LateSamples(hold_ticks=1000)
    drivers = {
        name: dataclasses.replace(setup, cls=Device, late=late)
        for name, setup in machine.drivers.items()
    }
    return dataclasses.replace(machine, drivers=drivers)


def _command(*arguments: str) -> str:
    app = typer.Typer()
    register(app)
    answer = CliRunner().invoke(app, list(arguments), catch_exceptions=False)
    assert answer.exit_code == 0
    return answer.stdout


@pytest.mark.slow
@pytest.mark.wall_clock(lanes=3)
def test_two_seconds_give_a_log_with_every_tick_and_a_verdict(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))  # no cyclictest
    log, out = tmp_path / "ticks.parquet", tmp_path / "out"
    words = ("--duration", "2", "--log", str(log), "--out", str(out), "--json")
    document = json.loads(_command(*words))

    ticks = document["ticks"]
    assert ticks["every_tick"]
    assert ticks["rows_lost"] == 0
    assert ticks["periods_missing"] == ticks["skipped_periods"]
    recording = read_recording(log, gaps="keep")
    assert len(recording.time_s) == ticks["rows"]
    assert ticks["measured"] + ticks["periods_missing"] >= 0.9 * 2.0 * document["rate_hz"]
    states = recording.axes["x"].state
    assert states is not None
    assert AxisState.RUNNING in states
    assert recording.metadata["rows_lost"] == 0

    lateness, turnaround = document["lateness"], document["turnaround"]
    for found in (lateness, turnaround, *turnaround["parts"].values()):
        assert 0.0 < found["p50_us"] <= found["p99_us"] <= found["p999_us"] <= found["max_us"]
    assert turnaround["parts"].keys() == {"read", "compute", "write"}
    assert sum(lateness["histogram"]["counts"]) == ticks["measured"]
    assert recording.lateness_s is not None
    assert lateness["max_us"] * 1e-6 <= np.nanmax(recording.lateness_s) + 1e-12
    assert document["verdict"]["grade"] == judge(lateness["max_us"]).grade
    assert document["cyclictest"] == {"missing": INSTALL}
    figures = {figure["name"]: figure for figure in document["figures"]}
    assert figures.keys() >= {"lateness_p50", "late_50us", "late_100us", "late_200us", "skipped"}
    assert figures["turnaround_p50"]["peer_value"] == pytest.approx(14.0)
    assert figures["lateness_p50"]["target"] == {"of": "value", "relation": "<", "limit": 2.0}
    assert figures["late_100us"]["met"] is None

    assert json.loads((out / "latency.json").read_text()) == document
    assert (out / "latency.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
@pytest.mark.wall_clock(lanes=3)
def test_the_terminal_shows_verdict_histograms_and_whether_every_tick_is_there(monkeypatch):
    monkeypatch.setenv("PATH", os.devnull)
    monkeypatch.setenv("COLUMNS", "120")
    shown = _command("--duration", "0.5")
    assert "every tick in the log: yes" in shown
    assert "worst lateness" in shown
    assert "turnaround" in shown
    assert "█" in shown
    assert "apt-get install rt-tests" in shown


@pytest.mark.slow
@pytest.mark.wall_clock(lanes=3)
def test_a_machine_that_needs_homing_is_homed_first():
    options = LatencyOptions(duration_s=1.0, beside_cyclictest=False)
    latency = measure_latency(load("small_stage"), options, _ignore)
    assert latency.every_tick
    assert latency.times.lateness.total > 0
    assert latency.document()["cyclictest"] == {"missing": "cyclictest was not asked for"}


@pytest.mark.parametrize("duration_s", [0.0, -1.0, float("nan"), float("inf")])
def test_a_duration_that_cannot_be_is_refused(duration_s):
    with pytest.raises(UsageError, match="duration"):
        measure_latency(load("published_gantry"), LatencyOptions(duration_s), _ignore)


def test_a_folder_that_cannot_be_written_to_is_refused_before_anything_runs(tmp_path):
    (tmp_path / "file").write_text("")
    options = LatencyOptions(out=tmp_path / "file" / "out")
    with pytest.raises(UsageError, match=r"file/out: cannot be made"):
        measure_latency(load("published_gantry"), options, _ignore)


@pytest.mark.slow
@pytest.mark.wall_clock(lanes=3)
@pytest.mark.parametrize("move", [False, True])
def test_axes_of_a_real_device_stay_off_unless_they_are_told_to_move(tmp_path, monkeypatch, move):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    machine = _on_metal(load("published_gantry"))
    assert Device.supports_virtual_time  # which says nothing of what moves
    log = tmp_path / "ticks.parquet"
    options = LatencyOptions(0.5, log, beside_cyclictest=False, move_devices=move)
    latency = measure_latency(machine, options, _ignore)
    assert latency.moving is move
    axes = read_recording(log, gaps="keep").axes
    for axis in axes.values():
        assert axis.state is not None
        assert (AxisState.RUNNING in axis.state) is move
        assert np.any(axis.command != 0.0) == move


@pytest.mark.slow
@pytest.mark.wall_clock(lanes=3)
def test_a_trip_of_a_real_axis_stops_every_axis_and_is_told(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    fault = {"kind": "amplifier_fault", "at_s": 2.0, "channel": 1, "duration_s": 0.01}
    log = tmp_path / "ticks.parquet"
    options = LatencyOptions(30.0, log, beside_cyclictest=False, move_devices=True)
    message = (
        r"^axis y tripped: the amplifier reports a fault, at .* s; .*; every axis was stopped$"
    )
    machine = _on_metal(with_sim(gantry(), faults=[fault]))
    with pytest.raises(RunError, match=message):
        measure_latency(machine, options, _ignore)
    axes = read_recording(log, gaps="keep").axes
    tripped = int(np.argmax(axes["y"].state == AxisState.FAULT))
    assert (axes["y"].state[tripped:] == AxisState.FAULT).all()
    assert not axes["y"].command[tripped:].any()
    assert axes["x"].state[-1] == AxisState.OFF
    assert axes["x"].command[-1] == 0.0


@pytest.mark.slow
@pytest.mark.wall_clock(lanes=3)
def test_a_trip_of_a_simulated_axis_is_told_and_the_measurement_goes_on(tmp_path):
    fault = {"kind": "amplifier_fault", "at_s": 1.0, "channel": 1, "duration_s": 0.01}
    options = LatencyOptions(3.0, tmp_path / "ticks.parquet", beside_cyclictest=False)
    latency = measure_latency(with_sim(gantry(), faults=[fault]), options, _ignore)
    assert any("axis y tripped" in note for note in latency.run.refusals)
    axes = read_recording(tmp_path / "ticks.parquet", gaps="keep").axes
    tripped = int(np.argmax(axes["y"].state == AxisState.FAULT))
    assert AxisState.RUNNING in axes["y"].state[tripped:]
