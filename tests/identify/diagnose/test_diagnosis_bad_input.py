"""Recordings that cannot be what they are said to be: told apart, told plainly, never named."""

import json
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from fit_plant import C1, simulate
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from tiers import few_of

from motorctl.cli import main
from motorctl.config import load
from motorctl.errors import MotorctlError
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.diagnose.report.json_document import diagnosis_document
from motorctl.log import AxisRecording, Recording

RATE_HZ = 1000.0


@pytest.fixture(scope="module")
def run():
    return simulate(seed=1, duration_s=6.0, rate_hz=RATE_HZ, peak_acceleration=15.0)


@pytest.fixture
def refused(run, tmp_path, monkeypatch, capsys):
    """Return a function that has the command line refuse a recording, and returns the message."""

    def refuse(config=None, options=(), axis="x", **columns):
        own = {"time_s": run.time_s, "position_m": run.position, "command_v": run.command}
        own |= columns
        path = tmp_path / "run.parquet"
        time = own.pop("time_s")
        table = pa.table({"time_s": time} | {f"{axis}.{name}": own[name] for name in own})
        if config is not None:
            document = {"rate_hz": RATE_HZ, "config": config}
            table = table.replace_schema_metadata({"motorctl": json.dumps(document)})
        pq.write_table(table, path)
        monkeypatch.setattr(sys, "argv", ["motorctl", "diagnose", str(path), "--json", *options])
        with pytest.raises(SystemExit) as end:
            main()
        told = capsys.readouterr()
        assert end.value.code == 2
        assert told.out == ""
        assert "Traceback" not in told.err
        return told.err

    return refuse


def noise(run, seed=5):
    return np.random.default_rng(seed).standard_normal(len(run.time_s))


def test_no_motion(run, refused):
    still = np.full_like(run.position, 0.2)
    assert "no motion" in refused(position_m=still)
    assert "no motion" in refused(position_m=0.2 + 0.5e-6 * (np.arange(len(still)) % 3))


def test_a_command_that_does_nothing(run, refused):
    assert "the command is constant at 0 V" in refused(command_v=np.zeros_like(run.command))


@pytest.mark.slow
def test_only_noise(run, refused):
    position = 0.2 + 0.5e-6 * np.round(20.0 * noise(run))
    assert "only noise" in refused(position_m=position, command_v=noise(run, 6))


@pytest.mark.slow
def test_a_command_of_noise_explains_nothing(run, refused):
    message = refused(command_v=noise(run))
    assert "the command" in message
    assert "acceleration" in message


def test_a_command_that_is_saturated_throughout(run, refused):
    message = refused(command_v=np.clip(300.0 * np.sin(2.0 * run.time_s), -10.0, 10.0))
    assert "saturated throughout" in message
    assert "10 V" in message


@pytest.mark.slow
def test_a_test_in_steps_is_not_called_saturated(run, refused):
    message = refused(command_v=10.0 * np.sign(np.sin(2.0 * run.time_s) + 1e-9))
    assert "saturated" not in message


def test_half_a_second(run, refused):
    few = slice(1000, 1500)
    message = refused(
        time_s=run.time_s[few], position_m=run.position[few], command_v=run.command[few]
    )
    assert "0.5" in message
    assert "needed" in message


def test_time_that_runs_backwards(run, refused):
    assert "column 'time_s' runs backwards" in refused(time_s=run.time_s[::-1])
    jumped = run.time_s.copy()
    jumped[3000:] -= 2.0
    message = refused(time_s=jumped)
    assert "column 'time_s' runs backwards" in message


def test_position_and_command_exchanged(run, refused):
    message = refused(position_m=run.command, command_v=run.position)
    assert "exchanged" in message or "is the position in m" in message


def test_a_command_of_the_other_sign(run, refused):
    assert "sign" in refused(command_v=-run.command)


def test_a_position_that_is_not_a_number(run, refused):
    holed = run.position.copy()
    holed[700:1200] = np.nan
    assert "x.position_m" in refused(position_m=holed)


def test_a_foreign_position_in_another_unit(run, refused):
    assert "is the position in m" in refused(position_m=1000.0 * run.position)


def own_config():
    return dict(load("published_gantry").resolved)


@pytest.mark.parametrize(
    ("column", "factor", "cause"),
    [
        ("position_m", 1000.0, "limits.travel_m"),
        ("position_m", 1e-3, "no whole number of counts"),
        ("command_v", 1000.0, "limits.max_voltage_v"),
        ("command_v", 1e-3, "model.inertia.bounds"),
    ],
)
def test_a_log_in_another_unit_than_its_configuration_says(run, refused, column, factor, cause):
    values = {"position_m": run.position, "command_v": run.command}
    message = refused(own_config(), **{column: factor * values[column]})
    assert "not a recording of the machine" in message
    assert cause in message


def test_a_recording_of_another_axis_than_the_configurations(run, refused):
    odd = 0.7e-6 * np.round(run.position / 0.7e-6)
    message = refused(options=["--model", "published_gantry"], position_m=odd)
    assert "no whole number of counts" in message
    heavy = refused(options=["--model", "published_gantry"], command_v=0.02 * run.command)
    assert "model.inertia.bounds" in heavy
    far = refused(options=["--model", "published_gantry"], position_m=run.position + 2.0)
    assert "limits.travel_m" in far


def test_an_axis_that_the_configuration_lacks(refused):
    message = refused(axis="elbow", options=["--model", "published_gantry"])
    assert "no axis 'elbow'" in message
    assert "it has: " in message


def recording_of(rate_hz, position, command, time_s=None):
    time = np.arange(len(position)) / rate_hz if time_s is None else time_s
    return Recording("fuzz.csv", rate_hz, time, {"x": AxisRecording("x", position, command)})


SIGNALS = st.sampled_from(
    ["zeros", "constant", "noise", "ramp", "sine", "steps", "walk", "jumps", "counts", "nan", "inf"]
)


def signal(kind, n, scale, random):
    t = np.arange(n) / max(n, 1)
    made = {
        "zeros": np.zeros(n),
        "constant": np.full(n, random.standard_normal()),
        "noise": random.standard_normal(n),
        "ramp": t,
        "sine": np.sin(2.0 * np.pi * random.uniform(0.5, 40.0) * t),
        "steps": np.repeat(random.standard_normal(n // 50 + 1), 50)[:n],
        "walk": np.cumsum(random.standard_normal(n)),
        "jumps": np.cumsum(random.standard_normal(n) * (random.random(n) < 0.01)),
        "counts": np.round(20.0 * np.sin(9.0 * t)),
        "nan": np.where(random.random(n) < 0.01, np.nan, random.standard_normal(n)),
        "inf": np.where(random.random(n) < 0.001, np.inf, t),
    }[kind]
    return scale * made


def answered(recording):
    """Diagnose; gives the verdict, or the class of what was told."""
    try:
        found = diagnose_recording(recording, {"x": C1})
    except MotorctlError as error:
        return "refused" if str(error).startswith("fuzz.csv") else str(error)
    json.dumps(diagnosis_document(found), allow_nan=False)
    return found.axes["x"].verdict


@pytest.mark.slow
@settings(max_examples=25, suppress_health_check=[HealthCheck.too_slow])
@given(
    SIGNALS,
    SIGNALS,
    st.integers(2, 4000),
    st.sampled_from([0.7, 33.3, 100.0, 999.9, 5000.0, 1e6]),
    st.sampled_from([1e-12, 1e-6, 1e-3, 1.0, 1e6, 1e200]),
    st.integers(0, 1000),
)
@example("ramp", "ramp", 1378, 0.7, 1e-3, 0)  # few rows over a long time
@example("ramp", "ramp", 1377, 33.3, 1e-3, 0)  # nothing left but rounding
@example("noise", "noise", 100, 100.0, 1e200, 0)  # squares overflow
@example("inf", "noise", 1000, 100.0, 1.0, 3)
def test_any_columns_get_an_answer_or_a_reason(position, command, n, rate_hz, scale, seed):
    random = np.random.default_rng(seed)
    x = signal(position, n, scale, random)
    u = signal(command, n, random.choice([1e-3, 1.0, 10.0]), random)
    assert answered(recording_of(rate_hz, x, u)) in (
        "refused", "complete", "effect", "unknown_structure", "insufficient_data",
    )  # fmt: skip


DAMAGES = {
    "cut": lambda x, r: np.concatenate([x[:2000], x[2600:], x[-600:]]),
    "frozen": lambda x, r: np.where(np.arange(len(x)) > 2500, x[2500], x),
    "jumped": lambda x, r: x + 0.01 * (np.arange(len(x)) > 3000),
    "spiked": lambda x, r: x + 0.05 * (r.random(len(x)) < 0.002),
    "coarse": lambda x, r: 1e-3 * np.round(x / 1e-3),
    "noisy": lambda x, r: x + 1e-3 * r.standard_normal(len(x)),
    "late": lambda x, r: np.roll(x, 300),
}


@pytest.mark.slow
@pytest.mark.parametrize("damage", few_of(DAMAGES, 3))
@pytest.mark.parametrize("column", ["position", "command"])
def test_a_damaged_column_never_gives_a_traceback(run, damage, column):
    columns = {"position": run.position, "command": run.command}
    columns[column] = DAMAGES[damage](columns[column], np.random.default_rng(0))
    answered(recording_of(RATE_HZ, **columns))


@pytest.mark.slow
def test_a_command_of_another_axis_names_nothing(run):
    other = simulate(seed=7, duration_s=6.0, rate_hz=RATE_HZ, peak_acceleration=15.0)
    assert answered(recording_of(RATE_HZ, run.position, other.command)) != "effect"
