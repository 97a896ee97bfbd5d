"""Draw the axis' states, `docs/states.svg`, and write the tables of `docs/states.md`.

    python tools/draw_states.py           # draws, and writes the tables between their marks
    python tools/draw_states.py --check   # exits with 1 where one of them is behind

Both are made from the table of transitions in `motorctl/loop/states.py`. Only where things stand
on the paper is said here; a line of the table that has no way on the paper is an error.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from xml.sax.saxutils import escape

from motorctl.loop.states import (
    OFF,
    OPERATION,
    POWERED,
    STOPPING,
    TRANSITIONS,
    DriveState,
    State,
    Transition,
    drive_words,
)

ROOT = Path(__file__).parents[1]
PICTURE = Path("docs") / "states.svg"
PAGE = Path("docs") / "states.md"
BEGIN = "<!-- states: made by tools/draw_states.py -->"
END = "<!-- end of states -->"

Point = tuple[float, float]
Area = tuple[float, float, float, float]

# All in pixels: left, top, width, height.
WIDTH, HEIGHT, LINE = 1110, 760, 16
AREAS: dict[State, Area] = {
    State.SWITCH_ON_DISABLED: (260, 50, 200, 48),
    State.READY_TO_SWITCH_ON: (260, 150, 200, 48),
    State.SWITCHED_ON: (260, 296, 200, 48),
    State.HOMING: (74, 512, 130, 48),
    State.HOLDING: (295, 512, 130, 48),
    State.FOLLOWING: (516, 512, 130, 48),
    State.QUICK_STOP_ACTIVE: (840, 290, 200, 48),
    State.FAULT_REACTION_ACTIVE: (840, 430, 200, 48),
    State.FAULT: (840, 690, 200, 48),
}
FRAMES: dict[str, tuple[str, tuple[State, ...], Area, float]] = {
    "enabled": ("enabled", (*POWERED, *STOPPING), (34, 240, 1030, 400), 18),
    "powered": ("", POWERED, (46, 272, 628, 350), 18),
    "off": ("off", OFF, (130, 24, 460, 190), 18),
    "operation": (drive_words(DriveState.OPERATION_ENABLED), OPERATION, (58, 430, 604, 170), 160),
}
"""Larger ones first: an event that all states in a frame know is one arrow from the frame. The last
figure is how far below its top the title stands."""

WAYS: dict[tuple[str, str], tuple[list[Point], Point, str]] = {
    ("SWITCH_ON_DISABLED", "READY_TO_SWITCH_ON"): ([(330, 98), (330, 150)], (322, 128), "end"),
    ("READY_TO_SWITCH_ON", "SWITCH_ON_DISABLED"): ([(390, 150), (390, 98)], (398, 128), "start"),
    ("READY_TO_SWITCH_ON", "SWITCHED_ON"): ([(360, 198), (360, 296)], (368, 234), "start"),
    ("READY_TO_SWITCH_ON", "HOMING"): ([(260, 174), (110, 174), (110, 512)], (118, 234), "start"),
    ("SWITCHED_ON", "HOLDING"): ([(360, 344), (360, 512)], (368, 376), "start"),
    ("SWITCHED_ON", "HOMING"): ([(260, 320), (170, 320), (170, 512)], (178, 400), "start"),
    ("SWITCHED_ON", "FOLLOWING"): ([(460, 320), (580, 320), (580, 512)], (572, 412), "end"),
    ("HOLDING", "HOMING"): ([(295, 526), (204, 526)], (250, 518), "middle"),
    ("HOMING", "HOLDING"): ([(204, 546), (295, 546)], (250, 564), "middle"),
    ("HOLDING", "FOLLOWING"): ([(425, 526), (516, 526)], (470, 518), "middle"),
    ("FOLLOWING", "HOLDING"): ([(516, 546), (425, 546)], (470, 564), "middle"),
    ("SWITCHED_ON", "SWITCH_ON_DISABLED"): (
        [(460, 306), (500, 306), (500, 88), (460, 88)], (508, 234), "start"),
    ("operation", "QUICK_STOP_ACTIVE"): (
        [(624, 430), (624, 314), (840, 314)], (757, 306), "middle"),
    ("QUICK_STOP_ACTIVE", "SWITCH_ON_DISABLED"): (
        [(940, 290), (940, 74), (460, 74)], (932, 180), "end"),
    ("powered", "FAULT_REACTION_ACTIVE"): ([(674, 454), (840, 454)], (757, 446), "middle"),
    ("QUICK_STOP_ACTIVE", "FAULT_REACTION_ACTIVE"): ([(900, 338), (900, 430)], (908, 388), "start"),
    ("FAULT_REACTION_ACTIVE", "FAULT"): ([(980, 478), (980, 690)], (972, 560), "end"),
    ("enabled", "FAULT"): ([(880, 640), (880, 690)], (872, 664), "end"),
    ("off", "FAULT"): ([(130, 120), (16, 120), (16, 714), (840, 714)], (200, 706), "start"),
    ("FAULT", "SWITCH_ON_DISABLED"): (
        [(1040, 714), (1090, 714), (1090, 10), (360, 10), (360, 50)], (1082, 234), "end"),
}  # fmt: skip
"""From where to where: the corners of the arrow, and where its words stand."""

STYLE = """
  text { font: 13px system-ui, 'DejaVu Sans', Helvetica, Arial, sans-serif; fill: #23303b }
  .title { font-weight: 600 }
  .note { fill: #5a6b78; font-size: 12px }
  .told { font: 12px ui-monospace, 'DejaVu Sans Mono', Menlo, Consolas, monospace; fill: #5a6b78 }
  .paper { fill: #ffffff }
  .state { fill: #ffffff; stroke: #7d99a8; stroke-width: 1.5 }
  .fault { fill: #f9e9e5; stroke: #b5533c; stroke-width: 1.5 }
  .frame { fill: #5a6b78; fill-opacity: 0.05; stroke: #b9b1a2; stroke-dasharray: 5 4 }
  .way { stroke: #4c5f6d; stroke-width: 1.3; fill: none; marker-end: url(#tip) }
  .halo { stroke: #ffffff; stroke-width: 3; font-size: 12px }
  .words { font-size: 12px }
  .tip { fill: #4c5f6d }
"""


def arrows() -> dict[tuple[str, str], dict[str, set[str]]]:
    """Return each arrow's events with their numbers in CiA 402, by where it begins and ends."""
    reached: dict[tuple[str, str], set[State]] = {}
    numbers: dict[tuple[str, str], dict[State, set[str]]] = {}
    for line in TRANSITIONS:
        key = (line.event.words, line.after.name)
        for state in line.before:
            if state is not line.after:
                reached.setdefault(key, set()).add(state)
                own = numbers.setdefault(key, {}).setdefault(state, set())
                own.update(filter(None, line.number.split(", ")))
    found: dict[tuple[str, str], dict[str, set[str]]] = {}
    for (words, after), states in reached.items():
        left = set(states)
        for name, (_, inside, *_) in FRAMES.items():
            if left >= set(inside):
                left -= set(inside)
                union = set().union(*(numbers[words, after][s] for s in inside))
                found.setdefault((name, after), {})[words] = union
        for state in left:
            found.setdefault((state.name, after), {})[words] = numbers[words, after][state]
    return found


def states_svg() -> str:
    """Return the drawing as SVG text."""
    parts = []
    for title, _, (x, y, w, h), below in FRAMES.values():
        parts.append(f'<rect class="frame" x="{x}" y="{y}" width="{w}" height="{h}" rx="8"/>')
        parts.append(_text(x + w - 10, y + below, title, "note", "end"))
    for state, area in AREAS.items():
        parts += _box(state, area)
    words = []
    for ends, events in sorted(arrows().items()):
        if ends not in WAYS:
            raise SystemExit(f"draw_states: no way from {ends[0]} to {ends[1]}; add it to WAYS")
        corners, (x, y), anchor = WAYS[ends]
        path = " L".join(f"{a:g},{b:g}" for a, b in corners)
        parts.append(f'<path class="way" d="M{path}"/>')
        words += _labels(x, y, events, anchor)
    x, y, _, h = AREAS[State.SWITCH_ON_DISABLED]
    parts.append(f'<circle class="tip" cx="{x - 60}" cy="{y + h / 2}" r="6"/>')
    parts.append(f'<path class="way" d="M{x - 54},{y + h / 2} L{x},{y + h / 2}"/>')
    parts.append(_text(46, HEIGHT - 10, "Numbers are those of the transitions in CiA 402.", "note"))
    tip = (
        '<marker id="tip" markerUnits="userSpaceOnUse" markerWidth="9" markerHeight="10" '
        'refX="8" refY="5" orient="auto"><path class="tip" d="M0,0 L9,5 L0,10 z"/></marker>'
    )
    size = f'viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}"'
    head = [
        "<!-- Drawn by tools/draw_states.py; do not edit. -->",
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">',
        "<title>The states of an axis in the words of CiA 402, and what changes them</title>",
        f"<style>{STYLE}</style>",
        f"<defs>{tip}</defs>",
        '<rect class="paper" width="100%" height="100%"/>',
    ]
    return "\n".join([*head, *parts, *words, "</svg>", ""])


def _box(state: State, area: Area) -> list[str]:
    x, y, w, h = area
    style = "fault" if state.drive is DriveState.FAULT else "state"
    name = state.name.lower() if state in OPERATION else drive_words(state.drive)
    return [
        f'<rect class="{style}" x="{x}" y="{y}" width="{w}" height="{h}" rx="6"/>',
        _text(x + w / 2, y + 20, name, "title", "middle"),
        _text(x + w / 2, y + 38, state.told.name.lower(), "told", "middle"),
    ]


def _labels(x: float, y: float, events: Mapping[str, Iterable[str]], anchor: str) -> list[str]:
    lines = []
    for row, (words, numbers) in enumerate(events.items()):
        told = ", ".join(sorted(numbers, key=int))
        text = f"{words} · {told}" if told else words
        # Twice, for not every viewer draws a letter's outline behind its filling.
        lines.append(_text(x, y + LINE * row, text, "halo", anchor))
        lines.append(_text(x, y + LINE * row, text, "words", anchor))
    return lines


def _text(x: float, y: float, text: str, style: str, anchor: str = "start") -> str:
    return f'<text x="{x:g}" y="{y:g}" class="{style}" text-anchor="{anchor}">{escape(text)}</text>'


def tables() -> str:
    """Return the states, and the lines of the table of transitions, as Markdown."""
    rows = ["| `drive_state` | `state` | the axis |", "|---|---|---|"]
    for state in State:
        what = " ".join((DOING[state]).split())
        rows.append(f"| `{state.drive.name.lower()}` | `{state.told.name.lower()}` | {what} |")
    rows += ["", "| in | on | to | CiA 402 | only if |", "|---|---|---|---|---|"]
    for line in TRANSITIONS:
        after = "stays so" if line.before == (line.after,) else _name(line.after)
        rows.append(
            f"| {_names(line)} | {line.event.words} | {after} | {line.number} | {line.only_if} |"
        )
    return "\n".join(rows)


DOING = {
    State.SWITCH_ON_DISABLED: "is disabled and may not be enabled: its device is not ready, or it "
    "moves",
    State.READY_TO_SWITCH_ON: "is disabled and may be enabled",
    State.SWITCHED_ON: "is started; its amplifier and its law begin with its next tick",
    State.HOLDING: "holds its position",
    State.HOMING: "looks for its zero",
    State.FOLLOWING: "follows a move or a program",
    State.QUICK_STOP_ACTIVE: "ramps down as it was told to, and is then disabled",
    State.FAULT_REACTION_ACTIVE: "ramps down because a guard tripped, and is then in fault",
    State.FAULT: "is disabled until `motorctl reset`",
}


def _names(line: Transition) -> str:
    return ", ".join(_name(state) for state in line.before)


def _name(state: State) -> str:
    """Return the state of CiA 402, and what the axis does while its operation is enabled."""
    return state.name.lower() if state in OPERATION else drive_words(state.drive)


def with_tables(text: str) -> str:
    """Return a page with the tables between its marks brought up to date."""
    head, _, rest = text.partition(BEGIN)
    _, found, tail = rest.partition(END)
    if not found:
        raise SystemExit(f"{PAGE} has no lines '{BEGIN}' and '{END}' for the tables")
    return f"{head}{BEGIN}\n{tables()}\n{END}{tail}"


def main(arguments: list[str], root: Path = ROOT) -> int:
    """Write drawing and tables, or check them; return the exit status."""
    page = (root / PAGE).read_text(encoding="utf-8")
    wanted = {PICTURE: states_svg(), PAGE: with_tables(page)}
    behind = [
        path
        for path, text in wanted.items()
        if not (root / path).exists() or (root / path).read_text(encoding="utf-8") != text
    ]
    if "--check" in arguments:
        for path in behind:
            print(f"{path} is not that of motorctl/loop/states.py: python tools/draw_states.py")
        return 1 if behind else 0
    for path in behind:
        (root / path).write_text(wanted[path], encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
