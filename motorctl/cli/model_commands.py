"""Change the models of a running daemon's axes, go back, and look at what they were."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from motorctl.cli.axis_commands import AxisArgument
from motorctl.cli.say import say
from motorctl.cli.socket_option import SocketOption
from motorctl.printable import one_line

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document.")]
STORY_LINES, STORY_CHARACTERS = 100, 400
"""Of a configuration's head: as much of it as the daemon keeps."""


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command(epilog="Example: motorctl apply refined.yaml")(apply)
    app.command(epilog="Example: motorctl revert")(revert)
    app.command(epilog="Example: motorctl models x")(models)


def apply(
    config: Annotated[
        str,
        typer.Argument(
            help="The running configuration with other models, gains, adaptation or "
            "controllers, as `refine` and `tune` write it."
        ),
    ],
    socket: SocketOption = None,
    as_json: AsJson = False,
) -> None:
    """Let other models take over while the machine runs.

    The axes concerned hold, or are off; their commands do not jump. The first motions run under
    half of the limit of the following error: where one trips, what ran before takes over again.
    Nothing else of the configuration may differ. The daemon's next start takes its own file.
    """
    from motorctl.config import load
    from motorctl.daemon.client import Client

    machine = load(config)
    with Client(socket) as client:
        say("checking and compiling it; the machine runs on meanwhile", err=True)
        answer = client.ask(
            "apply",
            config=machine.resolved,
            source=str(machine.source.absolute()),
            story=_story(machine.source),
        )
    _tell("now with other models", answer, as_json)


def revert(socket: SocketOption = None, as_json: AsJson = False) -> None:
    """Let the models that ran before the last `apply` take over again."""
    from motorctl.daemon.client import Client

    with Client(socket) as client:
        answer = client.ask("revert")
    _tell("with the models from before again", answer, as_json)


def models(axis: AxisArgument, socket: SocketOption = None, as_json: AsJson = False) -> None:
    """Tell which models an axis has run, since when and why."""
    from motorctl.daemon.client import Client

    with Client(socket) as client:
        told = client.ask("models", axis=axis)
    if as_json:
        say(json.dumps(told))
        return
    if not told["models"]:
        say(one_line(f"axis {axis}: its model has never been changed while it ran"))
    for change in told["models"]:
        for line in _lines(change):
            say(line)


def _tell(what: str, answer: dict[str, Any], as_json: bool) -> None:
    if as_json:
        say(json.dumps(answer))
        return
    if not answer["axes"]:
        say("these models run already: nothing was changed")
        return
    say(one_line(f"axis {', '.join(answer['axes'])}: {what}; recorded in {answer['log']}"))
    if trial := answer["trial"]:
        say(
            f"on trial for {trial['motions']} motions, with {trial['window']:.0%} of the limit of "
            "the following error; `motorctl revert` goes back"
        )


def _story(source: Path) -> list[str]:
    """Return the comment at the head of a configuration, which says how it was found."""
    story = []
    for line in source.read_text(encoding="utf-8-sig").splitlines():
        if not line.startswith("#"):
            break
        told = line.removeprefix("#").strip()
        if told and not told.startswith("yaml-language-server"):
            story.append(told[:STORY_CHARACTERS])
    return story[:STORY_LINES]


def _lines(change: dict[str, Any]) -> list[str]:
    what = str(change["what"]).replace("_", " ")
    parts = [
        f"{word} {', '.join(change[key])}"
        for word, key in (("with", "added"), ("without", "removed"), ("changed:", "changed"))
        if change[key]
    ]
    why = f" ({change['why']})" if change["why"] else ""
    head = f"{change['time_utc']}  {what}{why}: {'; '.join(parts)}"
    details = [f"from {change['source']}"]
    if change["log"]:
        details.append(f"recorded in {change['log']}")
    return [one_line(head), *(one_line(f"    {line}") for line in (*details, *change["story"]))]
