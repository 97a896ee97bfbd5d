"""The table of the guards tells each of them once, with the reactions that it may have."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from motorctl.config.guard_keys import NO_QUICK_STOP, EncoderNoise, Guards, Skew, Thermal
from motorctl.log.sample import FaultCause

PAGE = (Path(__file__).parents[2] / "docs" / "guards.md").read_text()
TABLE = PAGE.partition("## What trips an axis")[2].partition("## ")[0]
ROWS = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in TABLE.splitlines()
        if line.startswith("| `")]  # fmt: skip
TOLD = {name: row[-1].rstrip(" |") for row in ROWS for name in re.findall(r"`(\w+)`", row[0])}
OTHER = {"disable": "quick_stop", "quick_stop": "disable"}
GUARDS = Guards(
    encoder_noise=EncoderNoise(rms_m=1.0),
    thermal=Thermal(continuous_voltage_v=1.0, time_constant_s=1.0),
    skew=Skew(limit_m=1.0),
)
"""Those as well that are off by default."""


def test_each_guard_of_the_configuration_has_its_place_in_the_table_and_each_row_is_one() -> None:
    assert set(TOLD) == set(Guards.model_fields)
    assert sum(len(re.findall(r"`(\w+)`", row[0])) for row in ROWS) == len(TOLD)


def test_whatever_trips_an_axis_is_a_guard_or_of_homing() -> None:
    causes = {cause.guard for cause in FaultCause if cause is not FaultCause.NONE}
    assert causes - {"homing_failed", "not_square"} == set(TOLD)


@pytest.mark.parametrize("guard", Guards.model_fields)
def test_the_table_tells_the_reactions_of_a_guard(guard: str) -> None:
    default = getattr(GUARDS, guard).reaction
    may_be = [default] if guard in NO_QUICK_STOP else [default, OTHER[default]]
    assert TOLD[guard] == ", ".join(reaction.replace("_", " ") for reaction in may_be)
