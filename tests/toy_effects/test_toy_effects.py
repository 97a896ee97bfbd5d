"""Effects of other packages go all the way: check, simulate, fit, diagnose, refine, run again."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from tiers import few_of
from toy_bench import TOYS, Toy, configuration, install, record
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.model import catalog

CACHES = (catalog.known_effects, catalog.installed_effects)
QUICK = "push_pull"
ODD = ("current_loop", "scale_joint", "iron_knee")
"""A command, a measurement and an electromagnetic one: least like effects that act as forces."""
MAIN = "from motorctl.cli import main; main()"


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Let every toy package be installed."""
    folder = tmp_path_factory.mktemp("site")
    install(folder)
    sys.path.insert(0, str(folder))
    for cache in CACHES:
        cache.cache_clear()
    yield folder
    sys.path.remove(str(folder))
    for cache in CACHES:
        cache.cache_clear()


def command(*words):
    """Run a command; give what it printed as JSON, or as text."""
    result = CliRunner().invoke(make_app(), [str(word) for word in words])
    assert result.exit_code == 0, f"{result.output}\n{result.exception!r}"
    return json.loads(result.stdout) if "--json" in words else result.output


def each(test):
    """Run a test with every toy; one of them quickly, the others among the slow ones."""
    names = [name if name == QUICK else pytest.param(name, marks=pytest.mark.slow) for name in TOYS]
    return pytest.mark.parametrize("toy", names)(test)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Make recordings of plants once."""
    folder, made = tmp_path_factory.mktemp("recordings"), {}

    def give(name: str) -> Path:
        if name not in made:
            made[name] = record(folder / f"{name}.csv", TOYS.get(name))
        return made[name]

    return give


def test_every_toy_package_is_installed_and_none_is_refused(installed):
    assert set(TOYS) <= set(catalog.known_effects())
    assert not catalog.failed_effects()


@pytest.mark.slow
def test_a_new_process_finds_what_is_installed(installed, tmp_path):
    path = configuration(tmp_path / "machine.yaml", TOYS[QUICK])
    run = subprocess.run(
        [sys.executable, "-c", MAIN, "check", str(path), "--json"],
        env={"PYTHONPATH": str(installed), "PATH": "/usr/bin:/bin", "HOME": str(Path.home())},
        capture_output=True, text=True, timeout=200, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert QUICK in run.stdout


@pytest.mark.slow
@pytest.mark.parametrize("toy", few_of(TOYS, 1))
def test_a_declared_toy_is_checked_and_run(installed, toy, tmp_path):
    path = configuration(tmp_path / "machine.yaml", TOYS[toy])
    assert toy in json.dumps(command("check", path, "--json"))
    log = tmp_path / "run.parquet"
    measures = command("simulate", path, "--duration", 2, "--log", log, "--json")
    assert measures["axes"]["x"]["eM"] < 400e-6


@pytest.mark.slow
@each
def test_fit_finds_the_parameters_of_a_declared_toy(installed, recorded, toy, tmp_path):
    path = configuration(tmp_path / "machine.yaml", TOYS[toy])
    fit = command("fit", recorded(toy), "--model", path, "--json")["axes"]["x"]
    for name, value in TOYS[toy].theta.items():
        assert fit["parameters"][name]["value"] == pytest.approx(value, rel=TOYS[toy].rel), name
    assert fit["parameters"]["inertia"]["value"] == pytest.approx(0.197, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    "toy", [name if name in ODD else pytest.param(name, marks=pytest.mark.long) for name in TOYS]
)
def test_diagnosis_finds_a_toy_where_the_plant_has_it_and_refinement_takes_it_up(
    installed, recorded, toy, tmp_path
):
    plain = configuration(tmp_path / "machine.yaml")
    refined = tmp_path / "refined.yaml"
    report = tmp_path / "report"
    given = ("--config", plain, "--out", refined, "--report", report, "--json")
    axis = command("refine", recorded(toy), *given)["axes"]["x"]
    assert catalog.effect_class(toy).title in (report / "diagnosis.html").read_text()
    names = [effect["name"] for effect in axis["effects"]]
    assert axis["verdict"] == "effect", axis
    assert toy in names, axis
    declared = yaml.safe_load(refined.read_text())["axes"]["x"]["model"]
    assert toy in declared
    wanted = _numbers(TOYS[toy])
    for name, value in wanted.items():
        assert _given(declared[toy], name) == pytest.approx(value, rel=0.2), name
    command("check", refined)
    measures = command(
        "simulate", refined, "--duration", 2, "--log", tmp_path / "again.parquet", "--json"
    )
    assert np.isfinite(measures["axes"]["x"]["eM"])


@pytest.mark.slow
def test_no_toy_is_found_where_the_plant_has_none(installed, recorded, tmp_path):
    path = configuration(tmp_path / "machine.yaml")
    axis = command("diagnose", recorded("none"), "--model", path, "--json")["axes"]["x"]
    assert axis["effects"] == []
    assert axis["verdict"] == "complete", axis


def _numbers(toy: Toy) -> dict[str, float]:
    """Return what a configuration should say in the end: options, and parameters by their names."""
    parameters = {key.removeprefix(toy.name).lstrip("_"): value for key, value in toy.theta.items()}
    return {**toy.options, **parameters}


def _given(said: dict, name: str) -> float:
    if not name:
        return float(said["initial"])
    return float(said[name] if name in said else said["parameters"][name]["initial"])


@pytest.mark.slow
def test_an_installed_effect_that_is_refused_hurts_no_other_and_is_told(tmp_path):
    install(tmp_path)
    module = tmp_path / "toy_push_pull.py"
    module.write_text(module.read_text().replace("def slope(", "def _slope("))
    run = subprocess.run(
        [sys.executable, "-c", MAIN, "effects", "--json"],
        env={"PYTHONPATH": str(tmp_path), "PATH": "/usr/bin:/bin", "HOME": str(Path.home())},
        capture_output=True, text=True, timeout=250, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    told = {row["name"]: row for row in json.loads(run.stdout)["effects"]}
    assert "slope is missing: expected slope(j, u, c)" in told["push_pull"]["error"]
    assert told["slow_core"] | {"title": ""} == {
        "name": "slow_core", "package": "toy-slow-core", "version": "1.0",
        "kind": "input", "title": "", "error": None,
    }  # fmt: skip
    assert told["inertia"]["package"] == "motorctl"


@pytest.mark.slow
def test_a_diagnosis_tells_which_installed_effects_it_did_not_try(recorded, monkeypatch):
    refused = catalog.EffectEntry("odd_one", "odd:Odd", "odd", "1.0", None, "slope is missing")
    monkeypatch.setattr(catalog, "installed_effects", lambda: (refused,))
    found = command("diagnose", recorded("none"), "--model", "C1", "--json")
    assert "odd_one was not tried: slope is missing" in json.dumps(found)
