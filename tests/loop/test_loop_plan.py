"""What the loop is given to follow has passed the rules that `check` has for programs."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest
from config_bench import machine, problems, write

from motorctl.config import load
from motorctl.errors import UsageError
from motorctl.loop.plan import plan_program
from motorctl.motion import Circle

CIRCLE = {
    "axes": ["x", "c"], "center_m": [0.1, 0.1], "radius_m": 0.05, "speed_m_s": 0.1,
    "max_acceleration_m_s2": 5.0, "max_jerk_m_s3": 500.0,
}  # fmt: skip


@pytest.mark.parametrize("kind", ["linear", "rotary"])
def test_a_circle_of_a_program_file_is_refused_as_that_of_a_configuration(
    tmp_path: Path, kind: str
) -> None:
    data = machine()
    data["axes"]["c"] = copy.deepcopy(data["axes"]["x"]) | {"channel": 1, "kind": kind}
    del data["axes"]["c"]["program"]
    ready = load(write(tmp_path, data))
    circle = Circle(name="round", **CIRCLE | {"axes": ("x", "c"), "center_m": (0.1, 0.1)})
    data["programs"]["round"] = CIRCLE | {"kind": "circle"}
    told = [problem.message for problem in problems(tmp_path, data)]
    if kind == "linear":
        assert told == []
        assert set(plan_program(ready, circle, {"x": 0.0, "c": 0.0}).trajectories) == {"x", "c"}
        return
    with pytest.raises(UsageError) as refused:
        plan_program(ready, circle, {"x": 0.0, "c": 0.0})
    assert str(refused.value) == f"program 'round': {told[0]}"
    assert told == ["axes x and c: a circle needs two axes of one kind"]
