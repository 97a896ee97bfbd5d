"""YAML descriptions of foreign recordings: units, clocks, segments, and every way to be wrong."""

import math
import struct

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from hypothesis import given, settings
from hypothesis import strategies as st

from motorctl.errors import DataError
from motorctl.log import read_recording
from motorctl.log.units import unit_for

N = 100

GOOD = """\
file: data.mat
time: {column: t, unit: ms}
axes:
  x:
    position: {column: q, unit: mm}
    command: {column: u, unit: V}
    reference: {column: r, unit: um}
    force_per_command: {value: 35.15, unit: N/V}
segments: {fit: [0, 0.06], held_out: [0.06, 0.1]}
"""


@pytest.fixture
def described(tmp_path):
    """Write a description of known data and read it."""
    data = {
        "t": np.arange(N) * 1.0,
        "q": np.linspace(0, 50, N),
        "u": np.sin(np.arange(N)),
        "r": np.linspace(0, 50_000, N),
        "counts": np.arange(N, dtype=np.int32),
    }
    scipy.io.savemat(tmp_path / "data.mat", data)

    def read(text):
        (tmp_path / "run.yaml").write_text(text)
        return read_recording(tmp_path / "run.yaml"), data

    return read


def test_units_become_metres_seconds_and_volts(described):
    recording, data = described(GOOD)
    assert recording.sample_rate_hz == 1000.0
    axis = recording.axes["x"]
    np.testing.assert_allclose(axis.position, data["q"] * 1e-3)
    np.testing.assert_allclose(axis.reference, data["r"] * 1e-6)
    np.testing.assert_array_equal(axis.command, data["u"])
    np.testing.assert_allclose(axis.following_error, 0, atol=1e-15)
    assert axis.force_per_command.value == 35.15
    assert axis.force_per_command.force_unit == "N"
    assert recording.source.endswith("run.yaml")


def test_segments_share_no_row_and_leave_none_out(described):
    recording, _ = described(GOOD)
    assert recording.rows("fit") == slice(0, 60)
    assert recording.rows("held_out") == slice(60, 100)


def test_without_segments_there_are_none(described):
    recording, _ = described(GOOD.replace("segments", "# segments"))
    assert recording.segments == {}
    assert recording.rows("fit") is None


def test_a_sample_rate_takes_the_place_of_a_time_column(described):
    recording, _ = described(GOOD.replace("time: {column: t, unit: ms}", "sample_rate_hz: 1e3"))
    np.testing.assert_allclose(recording.time_s, np.arange(N) / 1000)


@pytest.mark.parametrize(
    ("unit", "factor", "base"),
    [
        ("m", 1, "m"),
        ("mm", 1e-3, "m"),
        ("um", 1e-6, "m"),
        ("µm", 1e-6, "m"),
        ("rad", 1, "rad"),
        ("deg", math.pi / 180, "rad"),
        ("nm", 1e-9, "m"),
        ("turn", 2 * math.pi, "rad"),
        ("rev", 2 * math.pi, "rad"),
        ("mm, scale: -2", -2e-3, "m"),
        ("count, resolution: 5.0e-7", 5e-7, "m"),
        ("count, resolution: {value: 0.5, unit: um}", 5e-7, "m"),
        ("count, resolution_m: 5e-7", 5e-7, "m"),
        ("count, resolution: 0.01, resolution_unit: deg", math.pi / 18000, "rad"),
        ("count, resolution_rad: 1e-4", 1e-4, "rad"),
    ],
)
def test_every_unit_of_position(described, unit, factor, base):
    text = GOOD.replace("{column: q, unit: mm}", f"{{column: counts, unit: {unit}}}")
    text = text.replace("    reference: {column: r, unit: um}\n", "")
    axis = described(text)[0].axes["x"]
    np.testing.assert_allclose(axis.position, np.arange(N) * factor)
    assert axis.position_unit == base
    assert axis.resolution == (pytest.approx(factor) if unit.startswith("count") else None)


@pytest.mark.parametrize(
    ("unit", "force"),
    [
        ("V", "N/V"),
        ("A", "N/A"),
        ("N", "N/N"),
        ("N*m", "N*m/N*m"),
        ("Nm", "Nm/Nm"),
        ("N m", "N m/N m"),
    ],
)
def test_every_unit_of_command(described, unit, force):
    text = GOOD.replace("unit: V", f"unit: {unit}").replace("N/V", force)
    known = unit.replace("Nm", "N*m").replace("N m", "N*m")
    assert described(text)[0].axes["x"].command_unit == known


@pytest.mark.parametrize(
    ("unit", "factor", "base"),
    [
        ("mA", 1e-3, "A"),
        ("mV", 1e-3, "V"),
        ("kN", 1e3, "N"),
        ("mNm", 1e-3, "N*m"),
        ("percent", 1.0, "%"),
        ("A, scale: -0.5", -0.5, "A"),
    ],
)
def test_commands_are_scaled_to_their_base_unit(described, unit, factor, base):
    text = GOOD.replace("unit: V", f"unit: {unit}").replace("N/V", f"N/{base}")
    recording, data = described(text)
    np.testing.assert_allclose(recording.axes["x"].command, factor * data["u"])
    assert recording.axes["x"].command_unit == base


@pytest.mark.parametrize("unit", ["rpm", "turns/min", "revs/min"])
def test_a_velocity_stands_for_a_position_that_was_not_recorded(described, unit):
    text = GOOD.replace("position: {column: q, unit: mm}", f"velocity: {{column: u, unit: {unit}}}")
    recording, data = described(text.replace("unit: um", "unit: deg"))
    axis = recording.axes["x"]
    rate = 2 * math.pi / 60 * data["u"]
    np.testing.assert_allclose(np.diff(axis.position), 0.5e-3 * (rate[1:] + rate[:-1]))
    assert axis.position_unit == "rad"
    assert "its position is the integral of column 'u'" in recording.notes[0]


def test_a_late_column_is_brought_back_in_time(described):
    recording, data = described(GOOD.replace("unit: V", "unit: V, late_s: 0.002"))
    command = recording.axes["x"].command
    np.testing.assert_allclose(command[:-2], data["u"][2:], atol=1e-12)
    np.testing.assert_allclose(command[-2:], data["u"][-1])


ROWS = np.column_stack([np.arange(N) / 250, np.linspace(0, 1, N), np.cos(np.arange(N))])


def as_text(path):
    np.savetxt(path, ROWS)


def as_named_text(path):
    np.savetxt(path, ROWS, header="1  2   3")


def as_comma_text(path):
    np.savetxt(path, ROWS, delimiter=",")


def as_npy(path):
    np.save(path, ROWS)


def as_npz(path):
    np.savez(path, run=ROWS, name=np.array(["no numbers"]))


def as_mat(path):
    scipy.io.savemat(path, {"run": ROWS})


def as_mat_of_version_4(path):
    scipy.io.savemat(path, {"run": ROWS, "unit": "V"}, format="4")


def as_mat_with_a_signal_a_row(path):
    scipy.io.savemat(path, {"run": ROWS.T})


def as_mat_of_version_4_from_quarc(path):
    """As QUARC writes it: a signal a row, time in the first."""
    scipy.io.savemat(path, {"run": ROWS.T}, format="4")


def as_mat_of_version_4_by_another_machine(path):
    head = struct.pack(">5i", 1000, *ROWS.shape, 0, len(b"run\0"))
    path.write_bytes(head + b"run\0" + ROWS.astype(">f8").tobytes("F"))


@pytest.mark.parametrize(
    ("file", "write", "columns"),
    [
        ("a.txt", as_text, ("1", "2", "3")),
        ("a.txt", as_named_text, ("1", "2", "3")),
        ("a.csv", as_comma_text, ("1", "2", "3")),
        ("a.npy", as_npy, ("[:,0]", "[:,1]", "[:,2]")),
        ("a.npz", as_npz, ("run[:,0]", "run[:,1]", "run[:,2]")),
        ("a.mat", as_mat, ("run(:,1)", "run(:,2)", "run(:,3)")),
        ("a.mat", as_mat_of_version_4, ("run(:,1)", "run(:,2)", "run(:,3)")),
        ("a.mat", as_mat_with_a_signal_a_row, ("run(1,:)", "run(2,:)", "run(3,:)")),
        ("a.mat", as_mat_of_version_4_from_quarc, ("run(1,:)", "run(2,:)", "run(3,:)")),
        ("a.mat", as_mat_of_version_4_by_another_machine, ("run(:,1)", "run(:,2)", "run(:,3)")),
    ],
)
def test_columns_without_names_are_found_by_their_number(tmp_path, file, write, columns):
    write(tmp_path / file)
    t, q, u = (f'"{name}"' for name in columns)
    (tmp_path / "d.yaml").write_text(
        f"file: {file}\ntime: {{column: {t}}}\naxes:\n  b:\n"
        f"    position: {{column: {q}, unit: m}}\n    command: {{column: {u}, unit: A}}\n"
    )
    recording = read_recording(tmp_path / "d.yaml")
    assert recording.sample_rate_hz == pytest.approx(250)
    np.testing.assert_allclose(recording.axes["b"].position, ROWS[:, 1])
    np.testing.assert_allclose(recording.axes["b"].command, ROWS[:, 2])


def test_rows_that_end_with_a_separator_have_no_further_column(tmp_path):
    """So writes many a C program; the cell behind it is no value, and the rows are no header."""
    lines = ["\t".join(f"{value:.6f}" for value in row) + "\t" for row in ROWS]
    (tmp_path / "a.txt").write_text("\n".join(lines) + "\n")
    (tmp_path / "named.txt").write_text("t\tq\tu\n" + "\n".join(lines) + "\n")
    for file, (q, u) in {"a.txt": ("2", "3"), "named.txt": ("q", "u")}.items():
        (tmp_path / "d.yaml").write_text(
            f"file: {file}\nsample_rate_hz: 250\naxes:\n  b:\n"
            f'    position: {{column: "{q}", unit: m}}\n    command: {{column: "{u}", unit: A}}\n'
        )
        axis = read_recording(tmp_path / "d.yaml").axes["b"]
        np.testing.assert_allclose(axis.position, ROWS[:, 1], atol=1e-6)
        np.testing.assert_allclose(axis.command, ROWS[:, 2], atol=1e-6)


@pytest.mark.parametrize(("unit", "turn"), [("rad", 2.0 * math.pi), ("deg", 360.0), ("turn", 1.0)])
def test_an_angle_that_begins_anew_after_a_turn_counts_on(tmp_path, unit, turn):
    count = np.arange(400)
    turns = 1.3 * np.sin(count / 60.0) + 0.2
    rows = np.column_stack([turn * (turns % 1.0), np.cos(count)])
    np.savetxt(tmp_path / "a.txt", rows)
    (tmp_path / "d.yaml").write_text(
        "file: a.txt\nsample_rate_hz: 250\naxes:\n  b:\n"
        f'    position: {{column: "1", unit: {unit}}}\n    command: {{column: "2", unit: A}}\n'
    )
    recording = read_recording(tmp_path / "d.yaml")
    moved = np.diff(recording.axes["b"].position)
    np.testing.assert_allclose(moved, 2.0 * math.pi * np.diff(turns), atol=1e-9)
    times = np.count_nonzero(np.diff(np.floor(turns)))
    assert f"begins anew after a turn, {times} times" in recording.notes[0]


def _moved_and_told(folder, position, unit="rad"):
    """Return the steps of a position that is read, and the notes."""
    np.savetxt(folder / "a.txt", np.column_stack([position, np.cos(np.arange(len(position)))]))
    (folder / "d.yaml").write_text(
        "file: a.txt\nsample_rate_hz: 50\naxes:\n  b:\n"
        f'    position: {{column: "1", unit: {unit}}}\n    command: {{column: "2", unit: A}}\n'
    )
    recording = read_recording(folder / "d.yaml")
    return np.diff(recording.axes["b"].position), recording.notes


@pytest.mark.parametrize(
    ("unit", "period", "base"), [("rad", 25.0, 1.0), ("rad", 191.0, 1.0), ("mm", 65.536, 1e-3)]
)
def test_a_counter_that_begins_anew_at_its_end_counts_on(tmp_path, unit, period, base):
    """Drives with a bus of short messages tell -12.5 to 12.5 rad; a counter has 16 bits."""
    count = np.arange(1500)
    whole = period * (1.9 * np.sin(count / 180.0) + 0.2 * np.sin(count / 37.0) + 0.3)
    moved, notes = _moved_and_told(tmp_path, (whole + 0.5 * period) % period - 0.5 * period, unit)
    np.testing.assert_allclose(moved, base * np.diff(whole), atol=1e-3 * base * period)
    assert "begins anew after " in notes[0]


def test_a_reference_that_is_a_saws_teeth_stays_one(tmp_path):
    """The axis flies back in some samples; what it is sent to, in one."""
    count = np.arange(600)
    teeth = 0.05 * (count % 100) - 2.5
    followed = np.convolve(np.pad(teeth, (11, 0), mode="edge"), np.full(12, 1 / 12), "valid")
    rows = np.column_stack([followed, np.cos(count), teeth])
    np.savetxt(tmp_path / "a.txt", rows)
    (tmp_path / "d.yaml").write_text(
        "file: a.txt\nsample_rate_hz: 50\naxes:\n  b:\n"
        '    position: {column: "1", unit: mm}\n    command: {column: "2", unit: A}\n'
        '    reference: {column: "3", unit: mm}\n'
    )
    axis = read_recording(tmp_path / "d.yaml").axes["b"]
    np.testing.assert_allclose(axis.reference, 1e-3 * teeth)
    np.testing.assert_allclose(axis.position, 1e-3 * followed)


def test_a_loose_contact_is_no_counter(tmp_path):
    count = np.arange(600)
    position = 8.0 + np.sin(count / 40.0)
    position[200:260] = position[400:430] = 0.0
    moved, notes = _moved_and_told(tmp_path, position)
    np.testing.assert_allclose(moved, np.diff(position))
    assert notes == ()


def test_an_axis_that_is_between_its_ends_in_one_sample_is_no_counter(tmp_path):
    position = np.where(np.arange(600) // 40 % 2, 3.0, -3.0) + 0.01 * np.sin(np.arange(600))
    moved, notes = _moved_and_told(tmp_path, position, "mm")
    np.testing.assert_allclose(moved, 1e-3 * np.diff(position))
    assert notes == ()


@pytest.mark.parametrize("unfilled", [0, 11])
def test_a_clock_may_count_ticks_and_rows_without_a_value_are_left_out(tmp_path, unfilled):
    """A recorder that rejects a message writes a row of nan; at its end the clock is 0."""
    count = np.arange(300)
    rows = np.column_stack([11 + 40.0 * count, np.sin(count / 30.0), np.cos(count)])
    lines = [",".join(f"{value:.9g}" for value in row) for row in rows]
    for place in (250, 120, 121, 60, 0):
        lines.insert(place, "nan,nan,nan")
    lines += ["0,1.5,0"] * unfilled
    (tmp_path / "a.csv").write_text("\n".join(["n,q,u", *lines]) + "\n")
    text = (
        "file: a.csv\ntime: {column: n, unit: s, scale: 0.000125}\naxes:\n  b:\n"
        "    position: {column: q, unit: turns}\n    command: {column: u, unit: V}\n"
    )
    (tmp_path / "d.yaml").write_text(text)
    recording = read_recording(tmp_path / "d.yaml")
    assert recording.sample_rate_hz == pytest.approx(200.0)
    np.testing.assert_allclose(recording.axes["b"].command, rows[:, 2], atol=1e-8)
    told = f"{5 + unfilled} rows without a value left out, the first: row 1 (line 2)"
    assert told in recording.notes[0]
    lines[150] = f"{rows[0, 0]:.9g},0,0"
    (tmp_path / "a.csv").write_text("\n".join(["n,q,u", *lines]) + "\n")
    with pytest.raises(DataError, match=r"row 151 \(line 152\)"):
        read_recording(tmp_path / "d.yaml")


@pytest.mark.parametrize("unit", ["m", "rad"])
def test_a_position_that_jumps_in_other_ways_stays_as_it_is(tmp_path, unit):
    rows = np.column_stack([np.sin(np.arange(400) / 60.0), np.cos(np.arange(400))])
    rows[200:, 0] += 3.0 if unit == "rad" else 2.0 * math.pi
    np.savetxt(tmp_path / "a.txt", rows)
    (tmp_path / "d.yaml").write_text(
        "file: a.txt\nsample_rate_hz: 250\naxes:\n  b:\n"
        f'    position: {{column: "1", unit: {unit}}}\n    command: {{column: "2", unit: A}}\n'
    )
    recording = read_recording(tmp_path / "d.yaml")
    np.testing.assert_allclose(recording.axes["b"].position, rows[:, 0])
    assert recording.notes == ()


def test_signals_in_an_array_of_structs_are_counted_as_dspace_writes_them(tmp_path):
    signals = np.zeros(2, dtype=[("Name", object), ("Data", object)])
    signals[0], signals[1] = ("enc1 (mm)", ROWS[:, 1]), ("input (V)", ROWS[:, 2])
    run = {"X": {"Data": ROWS[:, 0]}, "Y": signals}
    scipy.io.savemat(tmp_path / "a.mat", {"exp1": run})
    (tmp_path / "d.yaml").write_text(
        "file: a.mat\ntime: {column: exp1.X.Data}\naxes:\n  b:\n"
        "    position: {column: exp1.Y(1).Data, unit: mm}\n"
        "    command: {column: exp1.Y(2).Data, unit: V}\n"
    )
    axis = read_recording(tmp_path / "d.yaml").axes["b"]
    np.testing.assert_allclose(axis.position, 1e-3 * ROWS[:, 1])
    np.testing.assert_allclose(axis.command, ROWS[:, 2])


@pytest.mark.parametrize(("asked", "told"), [("u", r"say 'u \(1\)', or \(2\)"), ("u (2)", "")])
def test_of_columns_with_one_name_each_can_be_had_by_its_number(tmp_path, asked, told):
    np.savetxt(
        tmp_path / "a.csv",
        np.column_stack([ROWS, 2.0 * ROWS[:, 2]]),
        delimiter=",", header="t,q,u,u", comments="",
    )  # fmt: skip
    (tmp_path / "d.yaml").write_text(
        "file: a.csv\ntime: {column: t}\naxes:\n  b:\n    position: {column: q, unit: m}\n"
        f"    command: {{column: {asked}, unit: A}}\n"
    )
    if told:
        with pytest.raises(DataError, match=told):
            read_recording(tmp_path / "d.yaml")
        return
    axis = read_recording(tmp_path / "d.yaml").axes["b"]
    np.testing.assert_allclose(axis.command, 2.0 * ROWS[:, 2])


@pytest.mark.parametrize(
    ("unit", "position", "command", "translated"),
    [
        ("V*s^2/m", "rad", "V", "V*s^2/rad"),
        ("V*s^2/m", "m", "A", "A*s^2/m"),
        ("V*s/m", "rad", "N*m", "N*m*s/rad"),
        ("1/V", "m", "N*m", "1/(N*m)"),
        ("1/V^2", "m", "A", "1/A^2"),
        ("V", "m", "N", "N"),
        ("mm", "rad", "V", "mm"),
    ],
)
def test_units_of_parameters_follow_the_axis(unit, position, command, translated):
    assert unit_for(unit, position, command) == translated


def test_csv_and_parquet_can_be_described_too(tmp_path):
    table = pa.table({"pos": np.arange(N) * 0.1, "volt": np.ones(N)})
    pq.write_table(table, tmp_path / "a.parquet")
    np.savetxt(
        tmp_path / "a.csv",
        np.column_stack([np.arange(N) * 0.1, np.ones(N)]),
        delimiter=";",
        header="pos;volt",
        comments="",
    )
    for file in ("a.parquet", "a.csv"):
        (tmp_path / "d.yml").write_text(
            f"file: {file}\nsample_rate_hz: 250\naxes:\n  b:\n"
            "    position: {column: pos, unit: deg}\n    command: {column: volt, unit: A}\n"
        )
        axis = read_recording(tmp_path / "d.yml").axes["b"]
        np.testing.assert_allclose(axis.position, np.deg2rad(np.arange(N) * 0.1))
        assert axis.reference is None
        assert axis.following_error is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("unit: mm", "unit: inch", r"yaml:5: axes\.x\.position\.unit: unknown unit; known: m, mm"),
        ("unit: V", "unit: bar", r"yaml:6: axes\.x\.command\.unit: unknown unit; known: V, A, N"),
        ("unit: ms", "unit: h", r"yaml:2: time\.unit: unknown unit; known: s, ms"),
        ("N/V", "N/A", r"yaml:4: axes\.x: force_per_command is 35\.15 N/A; .* per V"),
        ("35.15", "0", r"axes\.x: force_per_command is 0 N/V"),
        ("35.15", "much", r"axes\.x\.force_per_command\.value: .*number.*\(it is 'much'\)"),
        ("unit: um", "unit: deg", r"the reference is in rad, but the position in m"),
        ("unit: mm", "unit: count", r"axes\.x\.position: unit count needs resolution"),
        ("unit: mm", "unit: mm, scale: 0", r"yaml:5: axes\.x\.position\.scale: must not be 0"),
        ("position: {column: q, unit: mm}", "# none", r"axes\.x: needs position: .* velocity"),
        (
            "position: {column: q, unit: mm}",
            "position: {column: q, unit: mm}\n    velocity: {column: v, unit: mm/s}",
            r"axes\.x: has a position and a velocity: leave out the velocity",
        ),
        ("column: q", "colum: q", r"yaml:5: axes\.x\.position\.column: is missing"),
        ("column: q", "colum: q", r"yaml:5: axes\.x\.position\.colum: unknown key"),
        ("column: q", "column: qq", r"axes\.x\.position\.column: .*data\.mat: no column 'qq'"),
        ("column: t", "column: tt", r"data\.mat: no column 'tt'"),
        ("time:", "tme:", r"yaml:2: tme: unknown key"),
        ("time:", "sample_rate_hz: 5\ntime:", r"needs either sample_rate_hz or time"),
        ("time: {column: t, unit: ms}", "sample_rate_hz: -5", r"yaml:2: sample_rate_hz: .*'-5'"),
        ("0.06, 0.1]", "0.05, 0.1]", r"yaml:9: segments: fit and held_out overlap"),
        ("[0.06, 0.1]", "[0.1, 0.06]", r"\[0\.1, 0\.06\] s: the end"),
        ("0.06, 0.1]", "0.06, 9]", r"segments\.held_out: .* lasts from 0 to 0\.1 s"),
        ("data.mat", "none.mat", r"none\.mat: no such file"),
        ("data.mat", "run.yaml", r"should be a CSV, Parquet, MAT or HDF5 file"),
        ("file:", "file: [", r"not valid YAML"),
        ("  x:\n", "  x:\n  x:\n", r"yaml:5: axes\.x: stands twice, first on line 4"),
    ],
)
def test_a_wrong_description_is_told_with_line_key_and_value(described, old, new, message):
    assert old in GOOD
    with pytest.raises(DataError, match=message):
        described(GOOD.replace(old, new, 1))


def test_all_problems_of_a_description_are_told_at_once(described):
    text = GOOD.replace("unit: mm", "unit: inch").replace("unit: V", "unit: bar")
    with pytest.raises(DataError) as refusal:
        described(text)
    assert len(str(refusal.value).splitlines()) == 2


@pytest.mark.parametrize("text", ["", "- 1\n", "text", "a: &a [*a]", "? [1]\n: 2\n", "[" * 5000])
def test_yaml_that_is_no_description_is_refused(described, text):
    with pytest.raises(DataError, match=r"run\.yaml"):
        described(text)


@pytest.mark.slow
@settings(max_examples=60)
@given(text=st.text(max_size=200), at=st.floats(0, 1))
def test_any_text_inserted_into_a_description_gives_no_traceback(tmp_path_factory, text, at):
    path = tmp_path_factory.getbasetemp() / "fuzz.yaml"
    k = round(at * len(GOOD))
    path.write_text(GOOD[:k] + text + GOOD[k:], encoding="utf-8", errors="replace")
    with pytest.raises(DataError):  # there is no data.mat beside it
        read_recording(path)
