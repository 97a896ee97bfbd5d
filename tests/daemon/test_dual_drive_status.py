"""Status and log tell the skew of an axis with two motors, and of no other."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from beam_bench import Held, absolute, beam
from loop_bench import Rig, gantry

from motorctl.daemon.report import Report
from motorctl.hal import Status
from motorctl.loop.simulation import simulate


def axes_told(rig, folder):
    document = Report(rig.machine, rig.memory, folder / "s").document(rig.names, {})
    return json.loads(json.dumps(document))["axes"]


def test_status_tells_the_skew_its_limit_and_what_the_second_end_reports(tmp_path):
    with Held() as rig:
        rig.put(30e-6, -10e-6)
        rig.advance(1)
        told = axes_told(rig, tmp_path)["x"]["dual_drive"]
        assert told["skew_m"] == pytest.approx(40e-6)
        assert told["skew_limit_m"] == 1e-3
        assert told["skew_command_v"] < 0.0
        assert told["second_device"] is None
        rig.driver.status[1] = Status.AMPLIFIER_FAULT
        rig.advance(1)
        told = axes_told(rig, tmp_path)["x"]
        assert told["dual_drive"]["second_device"] == "the amplifier reports a fault"
        assert told["device"] == "the amplifier reports a fault"


def test_status_of_an_axis_with_one_motor_says_nothing_of_skew(tmp_path):
    with Rig(gantry()) as rig:
        rig.advance(2)
        assert all("dual_drive" not in axis for axis in axes_told(rig, tmp_path).values())


def test_a_log_holds_the_commands_of_both_motors(tmp_path):
    machine = absolute(beam(), 0.2e-3)
    simulate(machine, tmp_path / "run.parquet", duration_s=0.4)
    table = pq.read_table(tmp_path / "run.parquet")
    skew = table["x.skew_m"].to_numpy()
    assert skew[5] == pytest.approx(0.2e-3, abs=5e-6)
    assert abs(skew[-1]) < 60e-6
    assert np.abs(table["x.skew_command_v"].to_numpy()).max() > 0.0
    assert table.schema.field("x.skew_command_v").metadata[b"unit"] == b"V"
