"""Change the models of a running daemon's axes, go back, and look at what they were."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer

from motorctl.cli.axis_commands import AxisArgument
from motorctl.cli.say import say
from motorctl.cli.socket_option import SocketOption
from motorctl.printable import one_line

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document.")]


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
    from motorctl.config.story import story_of
    from motorctl.daemon.client import Client

    machine = load(config)
    with Client(socket) as client:
        say("checking and compiling it; the machine runs on meanwhile", err=True)
        answer = client.ask(
            "apply",
            config=machine.resolved,
            source=str(machine.source.absolute()),
            story=story_of(machine.source),
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
    say(one_line(f"now: the model of {told['runs']}"))


def _tell(what: str, answer: dict[str, Any], as_json: bool) -> None:
    if as_json:
        say(json.dumps(answer))
        return
    if not answer["axes"]:
        say("these models run already: nothing was changed")
        return
    log = answer["log"] or "no log yet: `motorctl status` tells why"
    say(one_line(f"axis {', '.join(answer['axes'])}: {what}; recorded in {log}"))
    if trial := answer["trial"]:
        say(
            f"on trial for {trial['motions']} motions, with {trial['window']:.0%} of the limit of "
            "the following error; `motorctl revert` goes back"
        )


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
