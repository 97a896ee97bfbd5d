"""The drawing of the house shows the code as it is, and every room says what it is for."""

from __future__ import annotations

import ast
import re
import shutil
import tomllib
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

import pytest
from draw_house import PICTURE, ROOT, house_svg

SVG = "{http://www.w3.org/2000/svg}"
SOURCES = [ROOT / name for name in ("motorctl", "drivers", "devices", "benchmarks")]


def shown(svg: str) -> list[str]:
    return [text.text or "" for text in ET.fromstring(svg).iter(f"{SVG}text")]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """Copy what the drawing is made from."""
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for source in filter(Path.is_dir, SOURCES):
        for path in source.rglob("__init__.py"):
            copy = tmp_path / path.relative_to(ROOT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, copy)
    return tmp_path


def test_the_drawing_of_the_house_is_that_of_the_code() -> None:
    drawn = (ROOT / PICTURE).read_text()
    assert drawn == house_svg(), "draw it anew: .venv/bin/python tools/draw_house.py"


def test_a_room_that_is_added_to_a_floor_is_drawn_with_its_own_words(checkout: Path) -> None:
    room = checkout / "motorctl" / "weather" / "clouds"
    room.mkdir(parents=True)
    (room / "__init__.py").touch()
    (room.parent / "__init__.py").write_text('"""Rain on the roof."""\n')
    rules = checkout / "pyproject.toml"
    ground = '"motorctl.kernels",\n]'
    assert ground in rules.read_text()
    below = ground.replace("]", '  "motorctl.weather",\n]')
    rules.write_text(rules.read_text().replace(ground, below))
    words = shown(house_svg(checkout))
    assert words.index("weather") > words.index("model")
    assert {"Rain on the roof", "clouds"} <= set(words)


def test_a_room_that_is_gone_cannot_be_drawn(checkout: Path) -> None:
    (checkout / "motorctl" / "model" / "__init__.py").unlink()
    with pytest.raises(FileNotFoundError, match=r"motorctl\.model"):
        house_svg(checkout)


def test_every_package_says_in_one_line_what_it_is_for() -> None:
    lines = {}
    for source in filter(Path.is_dir, SOURCES):
        for path in source.rglob("__init__.py"):
            said = ast.get_docstring(ast.parse(path.read_text())) or ""
            lines[str(path.parent.relative_to(ROOT))] = said.partition("\n")[0]
    assert len(lines) > 20
    mute = {path: line for path, line in lines.items() if len(line.split()) < 4 or line[-1] != "."}
    assert not mute
    twice = [line for line, times in Counter(lines.values()).items() if times > 1]
    assert not twice


def test_a_driver_is_forbidden_every_room_but_the_driver_contract() -> None:
    rules = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    contracts = {contract["name"]: contract for contract in rules["contracts"]}
    layers = contracts["A room imports only rooms on lower floors"]["layers"]
    rooms = {room for layer in layers for room in re.findall(r"[\w.]+", layer)}
    folders = (ROOT / "motorctl").glob("*/__init__.py")
    assert rooms >= {f"motorctl.{path.parent.name}" for path in folders}
    forbidden = [
        *contracts["A driver knows only the driver contract"]["forbidden_modules"],
        *contracts["A driver has kernels and errors through the driver contract only"][
            "forbidden_modules"
        ],
    ]
    assert set(forbidden) - {"motorctl.errors"} == rooms - {"motorctl.hal"}
