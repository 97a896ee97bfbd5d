"""A dual drive whose numbers cannot be is refused, with file, line, key and arithmetic."""

import copy
from typing import Any

import numpy as np
import pytest
from config_bench import MACHINE, machine, problems, write

from motorctl.config import load
from motorctl.config.analysis import loop_margins
from motorctl.config.axis_keys import Homing
from motorctl.config.dual_drive_keys import DualDrive
from motorctl.config.hardware import wirings_of
from motorctl.config.load import load_resolved
from motorctl.config.metadata import log_axes
from motorctl.config.summary import summarise
from motorctl.log.columns import log_columns

DUAL: dict[str, Any] = {
    "channel": 1,
    "skew": {
        "k1_1_s": 100.0,
        "ks_v_s_m": 20.0,
        "gamma_d": 200.0,
        "max_voltage_v": 3.0,
        "inertia_v_s2_m": 0.08,
        "stiffness_v_m": 500.0,
    },
    "max_out_of_square_m": 2e-3,
}


def beam(**changes):
    """Return the bench's machine with two motors; changes by path, as of `machine`."""
    given = {"axes__x__dual_drive": copy.deepcopy(DUAL)}
    given["axes__x__guards"] = {"skew": {"limit_m": 1e-3}}
    data = machine(**given)
    for path, value in changes.items():
        part = data["axes"]["x"]
        *where, key = path.split("__")
        for name in where:
            part = part[name]
        part[key] = value
    return data


def test_an_axis_with_two_motors_takes_two_channels_of_its_driver(tmp_path):
    bench = load(write(tmp_path, beam()))
    channels = [w.channel for w in wirings_of(bench.axes.values())]
    assert [(c.axis, c.number) for c in channels] == [("x", 0), ("x.2", 1)]
    assert channels[0].max_voltage_v == channels[1].max_voltage_v == 10.0


def test_the_machine_of_a_log_is_the_one_that_was_run():
    shipped = load("dual_gantry")
    again = load_resolved(shipped.resolved)
    assert again.axes["x"].dual_drive == shipped.axes["x"].dual_drive
    assert isinstance(again.axes["x"].dual_drive, DualDrive)


REFUSED = [
    ({"guards__skew": None}, "guards.skew", ["is missing", "dual_drive needs it"]),
    ({"guards__skew__limit_m": 2e-6}, "guards.skew.limit_m",
     ["2e-06", "2 encoder counts", "always"]),
    ({"guards__skew__limit_m": 0.019, "dual_drive__max_out_of_square_m": 0.02}, None, []),
    ({"guards__skew__limit_m": 0.02, "dual_drive__max_out_of_square_m": 0.02},
     "guards.skew.limit_m", ["0.02", "can never trip", "10 V", "500 V/m", "0.02 m"]),
    ({"guards__skew__limit_m": 0.199, "dual_drive__max_out_of_square_m": 0.2,
      "dual_drive__skew__stiffness_v_m": 0.0}, None, []),
    ({"guards__skew__limit_m": 0.2, "dual_drive__max_out_of_square_m": 0.2,
      "dual_drive__skew__stiffness_v_m": 0.0},
     "guards.skew.limit_m", ["0.2", "can never trip", "stuck in the middle", "travel of 0.4 m"]),
    ({"guards__skew__limit_m": 0.4, "dual_drive__max_out_of_square_m": 0.4,
      "dual_drive__skew__stiffness_v_m": 0.0},
     "guards.skew.limit_m", ["0.4", "can never trip", "travel"]),
    ({"dual_drive__skew__max_voltage_v": 10.0}, "dual_drive.skew.max_voltage_v",
     ["found 10", "below limits.max_voltage_v 10 V"]),
    ({"dual_drive__max_out_of_square_m": None}, "dual_drive.max_out_of_square_m",
     ["is missing", "switch_index"]),
    ({"dual_drive__max_out_of_square_m": 0.5e-3}, "dual_drive.max_out_of_square_m",
     ["0.0005", "guards.skew.limit_m 0.001"]),
    ({"dual_drive__max_out_of_square_m": 0.4}, "dual_drive.max_out_of_square_m",
     ["0.4", "can never trip", "travel"]),
    ({"dual_drive__max_out_of_square_m": 0.0201}, "dual_drive.max_out_of_square_m",
     ["0.0201", "can never trip", "10 V", "500 V/m", "0.02 m", "at most that"]),
    ({"dual_drive__max_out_of_square_m": 0.02}, None, []),
    ({"dual_drive__skew__ks_v_s_m": 400.0}, "dual_drive.skew",
     ["skew loop is unstable", "ks 400", "0.08 V*s^2/m", "2000 Hz"]),
    ({"dual_drive__skew__k1_1_s": 2000.0}, "dual_drive.skew.k1_1_s", ["2000", "below the rate"]),
    ({"dual_drive__channel": 0}, "dual_drive.channel", ["found 0", "axis 'x' uses already"]),
    ({"dual_drive__chanel": 1}, "dual_drive.chanel", ["unknown key", "channel"]),
    ({"dual_drive__skew__ks_v_s_m": -1.0}, "dual_drive.skew.ks_v_s_m", ["greater than 0"]),
    ({"guards__skew__reaction": "stop"}, "guards.skew.reaction", ["quick_stop"]),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "key", "parts"), REFUSED)
def test_what_cannot_be_is_refused_at_its_key(tmp_path, changes, key, parts):
    if key is None:
        load(write(tmp_path, beam(**changes)))
        return
    (told,) = problems(tmp_path, beam(**changes))
    assert told.key == f"axes.x.{key}"
    assert told.line is not None
    assert all(part in told.message for part in parts), told.message


def test_switches_that_are_further_apart_than_a_beam_can_be_askew_are_noted(tmp_path):
    def told(offset_m, **changes):
        data = beam(dual_drive__square_offset_m=offset_m, **changes)
        notes = summarise(load(write(tmp_path, data)))["notes"]
        return [note for note in notes if "square_offset_m" in note]

    assert told(-0.022) == []  # 20 mm askew, and 2 mm as they may differ
    (note,) = told(-0.023)
    assert "axis x: dual_drive.square_offset_m -0.023" in note
    assert "0.02 m (max_voltage_v 10 V by 500 V/m)" in note
    assert "max_out_of_square_m 0.002 m" in note
    assert told(-0.3, dual_drive__skew__stiffness_v_m=0.0) == []


def test_a_skew_guard_of_an_axis_with_one_motor_is_refused(tmp_path):
    data = machine(axes__x__guards={"skew": {"limit_m": 1e-3}})
    (told,) = problems(tmp_path, data)
    assert told.key == "axes.x.guards.skew"
    assert "can never trip: the axis has one drive" in told.message


def test_a_channel_that_another_axis_has_is_refused(tmp_path):
    data = beam()
    data["axes"]["y"] = copy.deepcopy(MACHINE["axes"]["x"]) | {"channel": 1, "program": None}
    keys = {p.key for p in problems(tmp_path, data)}
    assert keys == {"axes.y.channel"}


def test_absolute_encoders_need_no_limit_of_homing(tmp_path):
    data = beam(dual_drive__max_out_of_square_m=None)
    data["axes"]["x"]["homing"] = {"method": "absolute"}
    assert load(write(tmp_path, data)).axes["x"].homing == Homing(method="absolute")


def test_check_shows_the_margins_of_the_skew_loop():
    told = summarise(load("dual_gantry"))["axes"]["x"]["dual_drive"]
    now, later = told["skew_margins"]
    assert now["stable"]
    assert later["stable"]
    assert later["delay_s"] == pytest.approx(now["delay_s"] + 0.2e-3)
    assert 30.0 < later["phase_margin_deg"] < now["phase_margin_deg"] < 90.0


def test_the_margin_of_an_elastic_beam_is_where_the_loop_begins_to_swing():
    # Found apart from the rule: the loop is simulated with its gain just within and just beyond.
    keys = {"k1_1_s": 100.0, "gamma_d": 300.0, "period_s": 0.5e-3, "delay_s": 0.8e-3}
    plant = {"theta1": 0.08, "theta2": 0.5, "stiffness": 900.0}
    margin = loop_margins(**plant, ks_v_s_m=20.0, **keys).gain_margin
    assert margin is not None
    for factor, swings in ((0.97, False), (1.03, True)):
        late = np.abs(_simulated(factor * margin, **plant, ks_v_s_m=20.0, **keys)[-2000:]).max()
        assert (late > 1e-3) == swings
        scaled = {**keys, "gamma_d": factor * margin * keys["gamma_d"]}
        assert loop_margins(**plant, ks_v_s_m=factor * margin * 20.0, **scaled).stable != swings


def _simulated(
    gain, *, theta1, theta2, stiffness, k1_1_s, ks_v_s_m, gamma_d, period_s, delay_s, steps=40
):
    """Let a skew of 1 mm come to rest, or not: plain steps, a delay line, the law as written."""
    h = period_s / steps
    line = [0.0] * round(delay_s / h)
    s, rate, d, before, told = 1e-3, 0.0, 0.0, 1e-3, []
    for _ in range(6000):
        p = (s - before) / period_s + k1_1_s * s
        u = gain * (-ks_v_s_m * p - d)
        d, before = d + period_s * gamma_d * p, s
        told.append(s)
        for _ in range(steps):
            line.append(u)
            a = (line.pop(0) - theta2 * rate - stiffness * s) / theta1
            rate += h * a
            s += h * rate
        if abs(s) > 1.0:
            break
    return np.array(told)


def test_only_an_axis_with_two_motors_has_columns_of_its_skew():
    own = {"skew_m", "skew_reference_m", "skew_command_v", "second_device_status"}
    beam_columns = {c.name for c in log_columns(log_axes(load("dual_gantry")))}
    stage_columns = {c.name for c in log_columns(log_axes(load("small_stage")))}
    assert beam_columns - stage_columns == {f"x.{name}" for name in own}
    assert not stage_columns - beam_columns
