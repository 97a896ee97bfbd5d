"""Draw the house: `docs/house.svg`, from the import rules and the packages' own first lines.

    .venv/bin/python tools/draw_house.py

The floors are the layers of import-linter's contract in `pyproject.toml`; what stands in a room is
the first line of its package's docstring, and below it the names of the packages inside. So the
drawing cannot say anything else than the code; a test compares the two.
"""

from __future__ import annotations

import ast
import re
import textwrap
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape

ROOT = Path(__file__).parents[1]
PICTURE = Path("docs") / "house.svg"

# All in pixels. LETTER is a little more than the mean width of a letter in a line of text.
WIDTH, MARGIN, GAP, PAD = 1000, 24, 10, 12
ANNEX_WIDTH = 250
LETTER, LINE, TITLE_LINE = 7.1, 17, 22
ROOF, HEADING = 92, 24
NO_BREAK = "\N{NO-BREAK SPACE}"
CONTRACT = "hal"  # the room through which a driver enters

STYLE = """
  text { font: 13px system-ui, 'DejaVu Sans', Helvetica, Arial, sans-serif; fill: #23303b }
  .title { font: 600 14px ui-monospace, 'DejaVu Sans Mono', Menlo, Consolas, monospace }
  .inside { font: 11.5px ui-monospace, 'DejaVu Sans Mono', Menlo, Consolas, monospace }
  .inside { fill: #5a6b78 }
  .note { fill: #5a6b78 }
  .paper { fill: #ffffff }
  .wall { fill: #f3f1ec; stroke: #8a8171; stroke-width: 1.5 }
  .roof { fill: #b5533c; stroke: #7e3524; stroke-width: 1.5 }
  .roof-text { fill: #ffffff }
  .room { fill: #ffffff; stroke: #b9b1a2 }
  .annex { fill: #e8f0f4; stroke: #7d99a8; stroke-width: 1.5 }
  .door { stroke: #7d99a8; stroke-width: 2; fill: none; marker-end: url(#tip) }
  .tip { fill: #7d99a8 }
"""


@dataclass(frozen=True)
class Room:
    """A package as the drawing shows it."""

    name: str
    first_line: str
    inside: tuple[str, ...]

    def lines(self, width: float) -> list[tuple[str, str]]:
        """Return class and text of each line that a room of this width [px] shows."""
        letters = int((width - 2 * PAD) / LETTER)
        inside = f"{NO_BREAK}· ".join(self.inside)
        return [
            ("title", self.name),
            *(("", line) for line in textwrap.wrap(self.first_line, letters)),
            *(("inside", line) for line in textwrap.wrap(inside, letters)),
        ]

    def height(self, width: float) -> float:
        """Return the height [px] that a room of this width [px] needs."""
        return TITLE_LINE + LINE * (len(self.lines(width)) - 1) + 2 * PAD


def read_room(package: str, root: Path) -> Room:
    """Read what a package's `__init__.py` says, without importing it.

    Raises
    ------
    FileNotFoundError
        Where no folder of sources has such a package.
    """
    folder = _folder(package, root)
    said = ast.get_docstring(ast.parse((folder / "__init__.py").read_text())) or ""
    inside = sorted(path.parent.name for path in folder.glob("*/__init__.py"))
    short = package.removeprefix("motorctl.")
    line = said.partition("\n")[0].rstrip(".")
    line = re.sub("``(.+?)``", lambda code: code[1].replace(" ", NO_BREAK), line)
    return Room(short, line, tuple(inside))


def _folder(package: str, root: Path) -> Path:
    sources = (root, *(root / name for name in ("drivers", "devices", "benchmarks")))
    for source in sources:
        folder = source.joinpath(*package.split("."))
        if (folder / "__init__.py").is_file():
            return folder
    raise FileNotFoundError(f"{package}: no such package in {', '.join(map(str, sources))}")


def house_svg(root: Path = ROOT) -> str:
    """Return the drawing of the checkout in `root` as SVG text."""
    rules = tomllib.loads((root / "pyproject.toml").read_text())["tool"]["importlinter"]
    contracts = rules["contracts"]
    layers = next(c for c in contracts if c["type"] == "layers")["layers"]
    floors = [[read_room(name, root) for name in re.findall(r"[\w.]+", layer)] for layer in layers]
    for floor in floors:
        floor.sort(key=lambda room: room.name == CONTRACT)  # beside the wall that has the door
    # What is no room of motorctl's own stands beside the wheel, whatever floor it looks at.
    beside = {name for name in rules["root_packages"] if name != "motorctl"}
    indoors = [floor for floor in floors if not beside & {room.name for room in floor}]
    outdoors = [room for floor in floors for room in floor if room.name in beside]
    drivers = [read_room(name, root) for name in beside - {room.name for room in outdoors}]
    return _Sheet().drawn(
        roof=read_room("motorctl", root),
        floors=indoors,
        drivers=sorted(drivers, key=lambda room: room.name),
        outdoors=sorted(outdoors, key=lambda room: room.name),
        rules=[contract["name"] for contract in contracts],
    )


class _Sheet:
    """The paper: what is drawn is collected, top to bottom."""

    def __init__(self) -> None:
        self._parts: list[str] = []
        self._doors: dict[str, tuple[float, float]] = {}

    def drawn(
        self,
        roof: Room,
        floors: Sequence[Sequence[Room]],
        drivers: Sequence[Room],
        outdoors: Sequence[Room],
        rules: Sequence[str],
    ) -> str:
        left, right = MARGIN, WIDTH - MARGIN - ANNEX_WIDTH - 3 * GAP
        self._roof(roof, left, right)
        top = MARGIN + ROOF
        bottom = float(top)
        heights = [_floor_height(floor, right - left - 2 * GAP) for floor in floors]
        self._box("wall", left, top, right - left, sum(heights) + GAP * (len(floors) + 1))
        for floor, height in zip(floors, heights, strict=True):
            bottom += GAP
            self._floor(floor, left + GAP, bottom, right - left - 2 * GAP, height)
            bottom += height
        bottom += GAP
        annex = WIDTH - MARGIN - ANNEX_WIDTH
        end = float(top)
        if outdoors:
            end = self._annex("beside the wheel", outdoors, annex, top) + 2 * GAP
        end = self._drivers(drivers, annex, max(end, bottom - _annex_height(drivers)))
        bottom = max(bottom, end) + 2 * GAP + LINE
        bottom = self._rules(rules, bottom)
        return self._page(bottom + MARGIN)

    def _roof(self, roof: Room, left: float, right: float) -> None:
        base = MARGIN + ROOF
        points = f"{left},{base} {left + 90},{MARGIN} {right - 90},{MARGIN} {right},{base}"
        self._parts.append(f'<polygon class="roof" points="{points}"/>')
        middle, width = (left + right) / 2, right - left - 170
        lines = textwrap.wrap(roof.first_line.partition(": ")[2], int(width / LETTER))
        y = base - ROOF / 2 - LINE * len(lines) / 2 + 4
        self._text(middle, y, roof.name, "title roof-text", middle=True)
        for line in lines:
            y += TITLE_LINE
            self._text(middle, y, line, "roof-text", middle=True)

    def _floor(
        self, floor: Sequence[Room], x: float, y: float, width: float, height: float
    ) -> None:
        each = _room_width(floor, width)
        for room in floor:
            self._room(room, x, y, each, height)
            x += each + GAP

    def _room(self, room: Room, x: float, y: float, width: float, height: float) -> None:
        self._box("room", x, y, width, height)
        self._doors[room.name] = (x + width, y + height / 2)
        line = y + PAD + 11
        for style, text in room.lines(width):
            self._text(x + PAD, line, text, style)
            line += TITLE_LINE if style == "title" else LINE

    def _annex(self, title: str, rooms: Sequence[Room], x: float, y: float) -> float:
        """Draw rooms that stand apart below each other; return where they end [px]."""
        self._box("annex", x, y, ANNEX_WIDTH, _annex_height(rooms))
        self._text(x + GAP, y + HEADING - 6, title, "note")
        y += HEADING
        width = ANNEX_WIDTH - 2 * GAP
        for room in rooms:
            self._room(room, x + GAP, y, width, room.height(width))
            y += room.height(width) + GAP
        return y

    def _drivers(self, drivers: Sequence[Room], x: float, y: float) -> float:
        end = self._annex("drivers: plug-ins", drivers, x, y)
        door_x, door_y = self._doors[CONTRACT]
        lane = x - 1.5 * GAP
        path = f"M{x},{y + HEADING / 2} H{lane} V{door_y} H{door_x + 6}"
        self._parts.append(f'<path class="door" d="{path}"/>')
        return end

    def _rules(self, rules: Sequence[str], y: float) -> float:
        self._text(MARGIN, y, "Who may know whom (kept by import-linter):", "note")
        for rule in rules:
            y += LINE
            self._text(MARGIN + PAD, y, f"– {rule}", "note")
        return y

    def _box(self, style: str, x: float, y: float, width: float, height: float) -> None:
        self._parts.append(
            f'<rect class="{style}" x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" '
            'rx="4"/>'
        )

    def _text(self, x: float, y: float, text: str, style: str, *, middle: bool = False) -> None:
        anchor = ' text-anchor="middle"' if middle else ""
        kind = f' class="{style}"' if style else ""
        self._parts.append(f'<text x="{x:g}" y="{y:g}"{kind}{anchor}>{escape(text)}</text>')

    def _page(self, height: float) -> str:
        size = f'viewBox="0 0 {WIDTH} {height:g}" width="{WIDTH}" height="{height:g}"'
        tip = (
            '<marker id="tip" markerUnits="userSpaceOnUse" markerWidth="9" markerHeight="10" '
            'refX="8" refY="5" orient="auto"><path class="tip" d="M0,0 L9,5 L0,10 z"/></marker>'
        )
        head = [
            "<!-- Drawn by tools/draw_house.py; do not edit. -->",
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">',
            "<title>The rooms of motorctl by floors; each imports only from below</title>",
            f"<style>{STYLE}</style>",
            f"<defs>{tip}</defs>",
            '<rect class="paper" width="100%" height="100%"/>',
        ]
        return "\n".join([*head, *self._parts, "</svg>", ""])


def _room_width(floor: Sequence[Room], width: float) -> float:
    return (width - GAP * (len(floor) - 1)) / len(floor)


def _floor_height(floor: Sequence[Room], width: float) -> float:
    each = _room_width(floor, width)
    return max(room.height(each) for room in floor)


def _annex_height(rooms: Iterable[Room]) -> float:
    width = ANNEX_WIDTH - 2 * GAP
    return HEADING + sum(room.height(width) + GAP for room in rooms)


if __name__ == "__main__":
    (ROOT / PICTURE).write_text(house_svg())
    print(f"{PICTURE} drawn")
