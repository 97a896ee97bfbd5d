"""Text files whose letters are not written in UTF-8."""

import codecs

import numpy as np
import pytest

from motorctl.log import read_recording

N = 40
TIME = np.arange(N) / 100.0
ANGLE_DEG = np.abs(np.arange(N) % 20 - 10.0) - 5.0
COMMAND = np.arange(N) % 7 - 3.0
ROWS = [f"{t:.2f};{x:.1f};{u:.1f}" for t, x, u in zip(TIME, ANGLE_DEG, COMMAND, strict=True)]
NAMES = "t;Position [°];Strom [µA]"


def read(tmp_path, content: bytes):
    (tmp_path / "a.csv").write_bytes(content)
    (tmp_path / "a.yaml").write_text(
        "file: a.csv\ntime: {column: t, unit: s}\naxes:\n  x:\n"
        "    position: {column: 'Position [°]', unit: deg}\n"
        "    command: {column: 'Strom [µA]', unit: A, scale: 1.0e-6}\n",
        encoding="utf-8",
    )
    return read_recording(tmp_path / "a.yaml")


def check(recording):
    np.testing.assert_allclose(recording.time_s, TIME)
    np.testing.assert_allclose(recording.axes["x"].position, np.deg2rad(ANGLE_DEG))
    np.testing.assert_allclose(recording.axes["x"].command, COMMAND * 1e-6)


@pytest.mark.parametrize("title", [(), ("Prüfstand 3, Größe 2",)])
@pytest.mark.parametrize("decimal", [".", ","])
def test_letters_of_windows_are_read_and_told(tmp_path, title, decimal):
    rows = [row.replace(".", decimal) for row in ROWS]
    recording = read(tmp_path, "\r\n".join([*title, NAMES, *rows, ""]).encode("cp1252"))
    check(recording)
    assert any("read as Windows-1252" in note for note in recording.notes)


def test_letters_between_blanks_are_read(tmp_path):
    text = "\n".join([NAMES.replace(" ", "_"), *ROWS]).replace(";", " ")
    (tmp_path / "a.csv").write_bytes(text.encode("cp1252"))
    (tmp_path / "a.yaml").write_text(
        "file: a.csv\ntime: {column: t, unit: s}\naxes:\n  x:\n"
        "    position: {column: 'Position_[°]', unit: deg}\n"
        "    command: {column: 'Strom_[µA]', unit: A, scale: 1.0e-6}\n",
        encoding="utf-8",
    )
    check(read_recording(tmp_path / "a.yaml"))


@pytest.mark.parametrize("codec", ["utf-16-le", "utf-16-be"])
def test_unicode_text_of_spreadsheets_is_read_without_a_note(tmp_path, codec):
    mark = codecs.BOM_UTF16_LE if codec.endswith("le") else codecs.BOM_UTF16_BE
    recording = read(tmp_path, mark + "\r\n".join([NAMES, *ROWS, ""]).encode(codec))
    check(recording)
    assert recording.notes == ()


@pytest.mark.parametrize("mark", [b"", codecs.BOM_UTF8])
def test_utf_8_is_read_without_a_note(tmp_path, mark):
    recording = read(tmp_path, mark + "\n".join([NAMES, *ROWS, ""]).encode())
    check(recording)
    assert recording.notes == ()
