"""`motorctl demo`: the whole story on the simulated gantry, no hardware needed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motorctl.cli.say import say

if TYPE_CHECKING:  # the analysis takes long to import: the command does so when it runs
    from motorctl.demo.story import Story


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("demo", epilog="Example: motorctl demo --out demo-out")(_demo)


def _demo(
    out: Annotated[
        Path,
        typer.Option(metavar="DIR", help="Where logs, configurations, pictures and the page go."),
    ] = Path("demo-out"),
) -> None:
    """Run the published experiment; find what its model lacks; add it; run again.

    C1 and C2 on the published trajectory, beside the published figures. Then C2's recordings are
    diagnosed, what was found is added to the configuration, and the same machine runs again.
    """
    from motorctl.cli.progress import showing_stages
    from motorctl.demo.story import tell

    with showing_stages(lines=True) as progress:
        story = tell(out, progress)
    _print(story)


def _print(story: Story) -> None:
    from motorctl.cli.measure_tables import print_measures
    from motorctl.close_loop.tables import tracking_table, velocity_words
    from motorctl.demo.tables import (
        first_sentence,
        found_beside_plant,
        gains,
        published_beside_ours,
        verdict,
    )
    from motorctl.identify.compare.measures import EXPLAINED

    say("1. The published experiment: C1 and C2")
    comparison = story.experiment.comparison
    for axis in comparison.axes:
        rows = published_beside_ours(comparison, axis)
        print_measures(axis, [rows[:3], rows[3:]])
    say(EXPLAINED)
    say(verdict(comparison))
    say("\n2. Diagnosed: what the declared model lacks")
    for axis in comparison.axes:
        say(f"axis {axis}: {first_sentence(story.loop, axis)}")
        for name, there, found, _ in found_beside_plant(story.loop, axis):
            say(f"  {name}\n    found:    {found}\n    is there: {there}")
    say("\n3. Refined, and run again")
    for axis, judgement in story.loop.overall.items():
        print_measures(axis, tracking_table(judgement))
    say(gains(story.loop))
    if story.loop.velocity is not None:
        say(velocity_words(story.loop.velocity))
    say(f"\nThe whole story with its pictures: {story.page}")
    say(f"The refined configuration: {story.loop.refined}")
