"""`motorctl tune` writes a filter of the command into whatever way it stands in the file."""

from __future__ import annotations

from pathlib import Path

import pytest
from config_bench import machine, write

from motorctl.config import load
from motorctl.config.analysis import LoopGains
from motorctl.control import CommandFilter, command_filter
from motorctl.errors import UsageError
from motorctl.tune.tuning import require_tunable, write_beside

PERIOD_S = 1.0 / 2000.0
NOTCH = command_filter("notch", 240.0, 0.6, 0.2, PERIOD_S)
LOW_PASS = command_filter("low_pass", 400.0, 0.8, 1.0, PERIOD_S)
BLOCK = """
      command_filter:                 # of the drum
        kind: notch
        frequency_hz: 210.5           # as measured
        damping: 0.5
        depth: 0.15
"""
SHORT_BLOCK = BLOCK.replace("        damping: 0.5\n        depth: 0.15\n", "")
FLOW = "\n      command_filter: {kind: notch, frequency_hz: 210.5}  # of the drum\n"


def file_with(folder: Path, filter_text: str) -> Path:
    path = write(folder, machine())
    text = path.read_text(encoding="utf-8")
    assert "\n      d_hat_max_v: 1.0\n" in text
    path.write_text(text.replace("\n      d_hat_max_v", f"{filter_text}      d_hat_max_v", 1))
    return path


@pytest.mark.parametrize("own", [NOTCH, LOW_PASS, None], ids=["notch", "low-pass", "none"])
@pytest.mark.parametrize("written", [BLOCK, SHORT_BLOCK, FLOW], ids=["block", "short", "flow"])
def test_a_filter_is_written_in_place_of_the_one_that_stood_there(
    tmp_path: Path, written: str, own: CommandFilter | None
) -> None:
    path, out = file_with(tmp_path, written), tmp_path / "tuned.yaml"
    gains = LoopGains(90.0, 36.0, 80.0, own)
    beside = write_beside(load(path), "x", gains, out)
    after = load(beside).axes["x"].gains
    assert (after.k1_1_s, after.ks_v_s_m, after.gamma_d) == (90.0, 36.0, 80.0)
    found = after.command_filter
    assert (found is None) == (own is None)
    if found is not None and own is not None:
        assert (found.kind, found.frequency_hz) == (own.kind, own.frequency_hz)
    text = beside.read_text(encoding="utf-8")
    assert "# of the drum" in text
    if own is NOTCH and written is BLOCK:
        assert "        frequency_hz: 240             # as measured\n" in text


@pytest.mark.parametrize("written", [BLOCK, FLOW], ids=["block", "flow"])
def test_a_machine_with_a_filter_can_be_tuned(tmp_path: Path, written: str) -> None:
    require_tunable(load(file_with(tmp_path, written)), "x", tmp_path / "tuned.yaml")


def test_a_filter_that_another_key_borrows_is_refused_before_anything_takes_time(
    tmp_path: Path,
) -> None:
    path = file_with(tmp_path, BLOCK.replace("command_filter: ", "command_filter: &drum "))
    with pytest.raises(UsageError, match="without anchors"):
        write_beside(load(path), "x", LoopGains(90.0, 36.0, 80.0), tmp_path / "tuned.yaml")
