"""Names of axes in recordings of others: shown as they are, or refused; no file goes elsewhere."""

from pathlib import Path

import numpy as np
import pytest

from motorctl.errors import DataError
from motorctl.log import read_recording


def described(folder: Path, name: str) -> Path:
    """Write a recording of one axis of this name, and give its description."""
    np.savetxt(
        folder / "run.csv",
        np.arange(60.0).reshape(20, 3),
        delimiter=",",
        header="t,x,u",
        comments="",
    )
    path = folder / "run.yaml"
    path.write_text(
        f"file: run.csv\nsample_rate_hz: 100\naxes:\n  {name}:\n"
        "    position: {column: x, unit: m}\n    command: {column: u, unit: V}\n"
    )
    return path


@pytest.mark.parametrize(
    "name", ['"../../x"', '"a\\\\b"', '"x\\e[31m"', '"x\\ny"', '""', '"' + 65 * "x" + '"']
)
def test_a_name_that_leads_elsewhere_or_commands_a_terminal_is_refused(tmp_path, name):
    with pytest.raises(DataError, match="part of file names"):
        read_recording(described(tmp_path, name))


@pytest.mark.parametrize("name", ["x", "Achse 1 (rechts)", "<b>", "$x_1$", "\u8ef8"])
def test_any_other_name_is_taken_as_it_is(tmp_path, name):
    assert list(read_recording(described(tmp_path, f'"{name}"')).axes) == [name]
