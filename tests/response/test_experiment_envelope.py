"""What an experiment may do where nobody is asked: what the configuration allows, and no more."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from motorctl.config import Machine, load, shipped_config
from motorctl.config.experiment_envelope import beyond_envelope
from motorctl.errors import ConfigError
from motorctl.motion import Peaks
from motorctl.response.plan import plan_response
from motorctl.response.rigs import beyond_allowed


def machine(folder: Path, experiments: dict[str, Any] | None, name: str = "can_gantry") -> Machine:
    document = yaml.safe_load(shipped_config(name).read_text())
    for axis in document["axes"].values():
        axis["experiments"] = experiments
    path = folder / "machine.yaml"
    path.write_text(yaml.safe_dump(document))
    return load(path)


def beyond(of: Machine) -> str:
    """Return what of a frequency response nobody has allowed."""
    axis = of.axes["x"]
    plan = plan_response(axis, of.period_of("x"), band_hz=(10.0, 60.0))
    return "; ".join(beyond_allowed(of, plan, sum(axis.limits.travel_m) / 2))


WIDE = {"max_velocity_share": 1.0, "max_acceleration_share": 1.0, "max_minutes": 60.0}


def wide(folder: Path) -> dict[str, Any]:
    return WIDE | {"travel_m": list(machine(folder, None).axes["x"].limits.travel_m)}


def test_without_an_envelope_nothing_is_allowed(tmp_path: Path) -> None:
    assert beyond(machine(tmp_path, None)) == "axes.x.experiments is not in the configuration"


def test_within_the_envelope_all_of_it_is(tmp_path: Path) -> None:
    assert not beyond(machine(tmp_path, wide(tmp_path)))


def test_a_simulated_machine_needs_none(tmp_path: Path) -> None:
    assert not beyond(machine(tmp_path, None, "published_gantry"))


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("travel_m", [0.199, 0.201], "travel_m: it goes from"),
        ("max_velocity_share", 1e-3, "max_velocity_share: it reaches"),
        ("max_acceleration_share", 1e-3, "max_acceleration_share: it reaches"),
        ("max_minutes", 0.01, "max_minutes: "),
    ],
)
def test_what_is_beyond_it_is_told_with_its_limit(
    tmp_path: Path, key: str, value: Any, told: str
) -> None:
    said = beyond(machine(tmp_path, wide(tmp_path) | {key: value}))
    assert said.startswith(f"axes.x.experiments.{told}")
    assert "allowed are" in said


def test_what_is_not_written_is_half_of_the_limits(tmp_path: Path) -> None:
    axis = machine(tmp_path, {}).axes["x"]
    limits = axis.limits
    low, high = limits.travel_m
    quarter = 0.25 * (high - low)
    most = {
        "range_m": (low + quarter, high - quarter),
        "max_velocity_m_s": 0.5 * limits.max_velocity_m_s,
        "max_acceleration_m_s2": 0.5 * limits.max_acceleration_m_s2,
    }
    rest = {"range_at_s": (0.0, 1.0), "max_jerk_m_s3": 0.0, "max_jerk_at_s": 0.0}
    rest |= {"max_velocity_at_s": 0.0, "max_acceleration_at_s": 0.0}

    def told(minutes: float, **more: Any) -> list[str]:
        return list(beyond_envelope(axis, Peaks(**(rest | most | more)), minutes))  # type: ignore[arg-type]

    assert told(10.0) == []
    assert len(told(10.1)) == 1
    for key in ("max_velocity_m_s", "max_acceleration_m_s2"):
        assert len(told(10.0, **{key: 1.01 * most[key]})) == 1  # type: ignore[operator]
    assert len(told(10.0, range_m=(low + 0.9 * quarter, high - quarter))) == 1


@pytest.mark.parametrize("travel_m", [[-9.0, 0.2], [0.1, 9.0], [0.2, 0.1]])
def test_an_envelope_outside_the_limits_is_refused(tmp_path: Path, travel_m: list[float]) -> None:
    with pytest.raises(ConfigError, match=r"experiments\.travel_m: found .*within limits\.travel"):
        machine(tmp_path, {"travel_m": travel_m})
