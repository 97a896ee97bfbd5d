"""What was learned is kept from run to run, and nothing else gets in that way."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from daemon_rig import bench_config
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from motorctl.config import Machine, load
from motorctl.daemon.learned import save, take_up

pytestmark = [pytest.mark.wall_clock(lanes=3), pytest.mark.bears_pauses]

THETA = {
    "x": np.array([0.2, 0.3, 0.1, 0.05, -0.004, -0.0004]),
    "y": np.array([0.7, 0.3, 0.2, 0.0, -0.01, -0.0002, 99.0]),  # longer than its model: the rest
}


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Machine:
    path = tmp_path_factory.mktemp("config") / "bench.yaml"
    path.write_text(bench_config(keep_learned=True))
    return load(path)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "state" / "bench.json"


def test_what_was_saved_is_taken_up_to_the_last_bit(machine: Machine, path: Path) -> None:
    save(machine, THETA, path)
    learned, remarks = take_up(machine, path)
    assert learned == {"x": list(THETA["x"]), "y": list(THETA["y"][:6])}
    assert all("starts from the parameters learned until" in remark for remark in remarks)
    assert [file.name for file in path.parent.iterdir()] == ["bench.json"]


def test_axes_that_do_not_keep_it_are_neither_saved_nor_changed(path: Path, tmp_path: Path) -> None:
    config = tmp_path / "bench.yaml"
    config.write_text(bench_config(keep_learned=True).replace("keep_learned: true", "", 1))
    half = load(config)
    save(half, THETA, path)
    assert list(json.loads(path.read_text())["axes"]) == ["y"]
    config.write_text(bench_config(keep_learned=False))
    assert take_up(load(config), path) == ({}, [])


def test_an_axis_that_ended_with_another_model_keeps_what_it_had_learned(
    machine: Machine, path: Path
) -> None:
    save(machine, THETA, path)
    other = {"x": np.array([9.0, 9.0]), "y": 1.01 * THETA["y"]}
    save(machine, other, path, ["x"])
    learned, _ = take_up(machine, path)
    assert learned == {"x": list(THETA["x"]), "y": list(other["y"][:6])}


def test_without_a_file_everything_starts_as_configured(machine: Machine, path: Path) -> None:
    assert take_up(machine, path) == ({}, [])


def spoilt(machine: Machine, path: Path, old: str, new: str) -> tuple[dict[str, list[float]], str]:
    save(machine, THETA, path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    learned, remarks = take_up(machine, path)
    return learned, "\n".join(remarks)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('"machine": "bench"', '"machine": "lathe"', "machine 'lathe'"),
        ('"format": "motorctl-learned-1"', '"format": "2"', "format '2'"),
        ('"axes"', '"taxes"', "axes: Field required"),
        ("{", "", "Invalid JSON"),
    ],
)
def test_a_foreign_or_damaged_file_is_told_and_ignored(
    machine: Machine, path: Path, old: str, new: str, told: str
) -> None:
    learned, remarks = spoilt(machine, path, old, new)
    assert learned == {}
    assert f"{path}: learned parameters ignored: " in remarks
    assert told in remarks


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('"inertia": 0.2', '"inertia": 1.3', "inertia = 1.3 lies outside 0.05 to 1.2"),
        ('"offset": 0.05', '"onset": 0.05', "they belong to another model"),
        ('"controller": "C2"', '"controller": "C1"', "they belong to another model"),
    ],
)
def test_an_axis_out_of_its_bounds_starts_as_configured_alone(
    machine: Machine, path: Path, old: str, new: str, told: str
) -> None:
    learned, remarks = spoilt(machine, path, old, new)
    assert list(learned) == ["y"]
    assert f"axis x: learned parameters ignored: {told}" in remarks


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("preset: published_gantry", "preset: published_gantry, substep_s: 1e-5"),
        ("resolution_m: 0.5e-6", "resolution_m: 1e-6"),
        ("resolution_m: 0.5e-6", "direction: -1, resolution_m: 0.5e-6"),
        ("inertia: {initial: 0.19,", "inertia: {initial: 0.38,"),
        ("coulomb_friction: {initial: 0.15,", "coulomb_friction: {slope_s_m: 700, initial: 0.15,"),
    ],
    ids=["driver", "resolution", "direction", "initial", "option"],
)
def test_what_was_learned_on_another_driver_encoder_or_model_is_not_taken_up(
    machine: Machine, path: Path, tmp_path: Path, old: str, new: str
) -> None:
    save(machine, THETA, path)
    text = bench_config(keep_learned=True)
    assert old in text
    (tmp_path / "bench.yaml").write_text(text.replace(old, new, 1))
    learned, remarks = take_up(load(tmp_path / "bench.yaml"), path)
    assert "x" not in learned
    assert "axis x: learned parameters ignored: since they were learned" in remarks[0]


def test_other_bounds_and_gains_leave_what_was_learned(
    machine: Machine, path: Path, tmp_path: Path
) -> None:
    save(machine, THETA, path)
    text = bench_config(keep_learned=True).replace("[0.05, 1.2]", "[0.06, 1.3]")
    (tmp_path / "bench.yaml").write_text(text.replace("gamma_d: 20", "gamma_d: 30"))
    assert list(take_up(load(tmp_path / "bench.yaml"), path)[0]) == ["x", "y"]


def test_a_file_that_does_not_say_what_it_was_learned_on_is_told_and_ignored(
    machine: Machine, path: Path
) -> None:
    save(machine, THETA, path)
    document = json.loads(path.read_text())
    for axis in document["axes"].values():
        del axis["meaning"]
    path.write_text(json.dumps(document))
    learned, remarks = take_up(machine, path)
    assert learned == {}
    assert all("without for which driver, encoder and model" in remark for remark in remarks)


def test_an_input_map_that_is_not_monotonic_is_not_taken_up(path: Path, tmp_path: Path) -> None:
    config = tmp_path / "bench.yaml"
    config.write_text(bench_config(keep_learned=True).replace("[-0.015, 0]", "[-0.05, 0]"))
    wide = load(config)
    # dv/du at 10 V: 1 + 2 * 10 theta5 + 3 * 100 theta6, 0.1 for x and -0.1 for y.
    x, y = THETA["x"].copy(), THETA["y"].copy()
    x[4:6], y[4:6] = (-0.03, -0.001), (-0.04, -0.001)
    save(wide, {"x": x, "y": y}, path)
    learned, remarks = take_up(wide, path)
    assert list(learned) == ["x"]
    assert "axis y: " in remarks[1]
    assert "not monotonic up to 10 V (Assumption 2)" in remarks[1]


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.binary(max_size=300)
    | st.recursive(
        st.none() | st.floats() | st.text(), lambda inner: st.dictionaries(st.text(), inner)
    ).map(lambda value: json.dumps(value).encode())
)
def test_no_file_content_whatever_hinders_the_start(
    machine: Machine, tmp_path: Path, content: bytes
) -> None:
    path = tmp_path / "bench.json"
    path.write_bytes(content)
    learned, remarks = take_up(machine, path)
    assert learned == {}
    assert len(remarks) == 1


@pytest.mark.parametrize("kept", [0, 1, 40, 0.5])
def test_a_file_that_a_power_cut_left_short_is_told_once_and_put_aside(
    machine: Machine, path: Path, kept: float
) -> None:
    save(machine, THETA, path)
    whole = path.read_bytes()
    short = whole[: int(kept * len(whole)) if 0 < kept < 1 else int(kept)]
    path.write_bytes(short)
    learned, (remark,) = take_up(machine, path)
    assert learned == {}
    assert f"{path}: learned parameters ignored: Invalid JSON" in remark
    assert "start as configured" in remark
    assert "bench.json.damaged" in remark
    assert path.read_bytes() == short  # until there is something better
    save(machine, THETA, path)
    assert path.with_name("bench.json.damaged").read_bytes() == short
    learned, _ = take_up(machine, path)
    assert learned["x"] == list(THETA["x"])


def test_something_else_in_the_place_of_the_file_is_told_and_put_aside(
    machine: Machine, path: Path
) -> None:
    path.mkdir(parents=True)
    learned, (remark,) = take_up(machine, path)
    assert learned == {}
    assert "learned parameters ignored: Is a directory" in remark
    save(machine, THETA, path)
    assert path.is_file()
    path.with_name("a file").write_text("")
    assert take_up(machine, path.with_name("a file") / "bench.json")[0] == {}


def test_a_failed_save_leaves_the_old_file(machine: Machine, path: Path) -> None:
    save(machine, THETA, path)
    before = path.read_bytes()
    blocked = {**THETA, "x": np.array([np.nan] * 6)}
    with pytest.raises(ValueError, match="finite"):
        save(machine, blocked, path)
    assert path.read_bytes() == before
    assert [file.name for file in path.parent.iterdir()] == ["bench.json"]
