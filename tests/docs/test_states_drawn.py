"""Drawing and tables of the axis' states are those of the table that the loop looks up."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import draw_states
import pytest
from draw_states import PAGE, PICTURE, ROOT, arrows, main, states_svg

from motorctl.log.sample import AxisState
from motorctl.loop.states import (
    TRANSITIONS,
    DriveState,
    Event,
    State,
    Transition,
    drive_words,
    possible_words,
    state_words,
)

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture
def page(tmp_path: Path) -> Path:
    """Copy the page alone: its drawing is still to be made."""
    (tmp_path / "docs").mkdir()
    (tmp_path / PAGE).write_text((ROOT / PAGE).read_text())
    return tmp_path


def test_drawing_and_tables_are_those_of_the_code() -> None:
    assert main(["--check"]) == 0


def test_a_drawing_that_is_behind_is_told_and_made(
    page: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--check"], page) == 1
    assert "docs/states.svg is not that of" in capsys.readouterr().out
    assert main([], page) == 0
    assert main(["--check"], page) == 0
    assert (page / PICTURE).read_text() == states_svg()


def test_every_line_that_changes_a_state_has_its_arrow_and_no_other_is_drawn() -> None:
    frames = {name: inside for name, (_, inside, *_) in draw_states.FRAMES.items()}
    drawn = {
        (state, words, after)
        for (begin, after), events in arrows().items()
        for words in events
        for state in (frames[begin] if begin in frames else (State[begin],))
    }
    asked = {
        (state, line.event.words, line.after.name)
        for line in TRANSITIONS
        for state in line.before
        if state is not line.after
    }
    assert drawn == asked
    paths = [p for p in ET.fromstring(states_svg()).iter(f"{SVG}path") if p.get("class") == "way"]
    assert len(paths) == len(arrows()) + 1  # one leads in


def test_a_line_without_a_way_on_the_paper_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    back = Transition((State.QUICK_STOP_ACTIVE,), Event.START, State.HOLDING, "16")
    monkeypatch.setattr(draw_states, "TRANSITIONS", (*TRANSITIONS, back))
    with pytest.raises(SystemExit, match="no way from QUICK_STOP_ACTIVE to HOLDING"):
        states_svg()


def test_every_state_of_cia_402_and_every_state_of_before_is_told() -> None:
    assert {state.drive for state in State} == set(DriveState)
    assert {state.told for state in State} == set(AxisState)
    words = [drive_words(state) for state in DriveState]
    assert "ready to switch on" in words
    assert {text.text for text in ET.fromstring(states_svg()).iter(f"{SVG}text")} >= set(words)


@pytest.mark.parametrize(
    ("state", "called", "possible"),
    [
        (
            State.SWITCH_ON_DISABLED,
            "off (switch on disabled)",
            "nothing until its device is ready and it stands, then start, home",
        ),
        (State.READY_TO_SWITCH_ON, "off (ready to switch on)", "start, home"),
        (State.SWITCHED_ON, "idle (switched on)", "stop, home, move, program"),
        (State.HOLDING, "idle (operation enabled)", "stop, home, move, program"),
        (State.HOMING, "homing (operation enabled)", "stop"),
        (State.FOLLOWING, "running (operation enabled)", "stop"),
        (State.QUICK_STOP_ACTIVE, "stopping (quick stop active)", "nothing until it stands"),
        (
            State.FAULT_REACTION_ACTIVE,
            "stopping (fault reaction active)",
            "nothing until it stands",
        ),
        (State.FAULT, "in fault", "reset"),
    ],
)
def test_a_refusal_names_the_state_and_what_is_possible(
    state: State, called: str, possible: str
) -> None:
    assert state_words(state) == called
    assert possible_words(state) == possible
    assert possible_words(state, absolute=True) == possible.replace(", home", "")
