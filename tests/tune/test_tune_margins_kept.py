"""Margins that `tune --response` promises are those of the axis that runs what it chose."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.config import load
from motorctl.config.shipped import locate

pytestmark = [pytest.mark.slow, pytest.mark.long]

CLOSE_DB, CLOSE_DEG = 0.5, 3.0
PERIODS = 100


def told(*words: object) -> dict[str, Any]:
    result = CliRunner().invoke(make_app(), [*map(str, words), "--json"])
    assert result.exit_code == 0, result.output
    document: dict[str, Any] = json.loads(result.stdout)
    return document


def test_margins_with_a_filter_that_was_chosen_are_as_promised(tmp_path: Path) -> None:
    """Axis x with 30 % of its mass on a spring of 300 Hz, tuned to 30 degrees and 6 dB."""
    text = locate("published_gantry").read_text(encoding="utf-8")
    before = "preset: published_gantry, seed: 1}"
    spring = {"frequency_hz": 300.0, "damping_ratio": 0.01, "fraction": 0.3}
    after = before[:-1] + f", plants: {{0: {json.dumps({'flexible_mode': spring})}}}}}"
    assert before in text
    ringing, tuned = tmp_path / "ringing.yaml", tmp_path / "tuned.yaml"
    ringing.write_text(text.replace(before, after).replace("cycles: 12", "cycles: 4"))

    def response(config: Path, out: Path) -> dict[str, Any]:
        return told("response", "x", "--config", config, "--out", out, "--periods", PERIODS)

    first = response(ringing, tmp_path / "first")
    assert first["margins"]["phase_margin_deg"] < 20.0  # as published it rings
    promised = told("tune", "x", "--config", ringing, "--margin", "30deg,6dB", "--out", tuned,
                    "--response", tmp_path / "first" / "response_x.parquet")  # fmt: skip
    promised = promised["after"]["margins"]
    chosen = load(tuned).axes["x"].gains.command_filter
    assert chosen is not None
    assert chosen.kind == "notch"

    measured = response(tuned, tmp_path / "again")["margins"]
    assert promised["phase_margin_deg"] >= 30.0
    assert measured["phase_margin_deg"] == pytest.approx(
        promised["phase_margin_deg"], abs=CLOSE_DEG
    )
    apart_db = 20.0 * np.log10(measured["gain_margin"] / promised["gain_margin"])
    assert abs(apart_db) < CLOSE_DB
