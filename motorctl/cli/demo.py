"""`motorctl demo`: the published experiment on the simulated gantry, no hardware needed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("demo", epilog="Example: motorctl demo --out demo-out")(_demo)


def _demo(
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Where logs, pictures and the page go.")
    ] = Path("demo-out"),
) -> None:
    """Run C1 and C2 on the published trajectory; print the tables beside the published figures."""
    from motorctl.cli.measure_tables import print_measures
    from motorctl.demo.story import tell
    from motorctl.demo.tables import published_beside_ours, verdict

    console = Console(stderr=True)
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        console=console,
        disable=not console.is_terminal,
    )
    with bar:
        tasks: dict[str, int] = {}

        def progress(what: str, share: float) -> None:
            stage = what.partition(":")[0]
            if stage not in tasks:
                for task in tasks.values():
                    bar.update(task, completed=1.0)  # type: ignore[arg-type]
                tasks[stage] = bar.add_task(stage, total=1.0)
            bar.update(tasks[stage], completed=share, description=what)  # type: ignore[arg-type]

        story = tell(out, progress)
    for axis in story.comparison.axes:
        rows = published_beside_ours(story.comparison, axis)
        print_measures(axis, [rows[:3], rows[3:]])
    print()
    print(verdict(story.comparison))
    print(f"The whole story with its pictures: {story.page}")
