"""Groups of axes that stop together: what is wrong with them, and what they leave out."""

from __future__ import annotations

from collections.abc import Iterator

from motorctl.config.machine import Machine
from motorctl.config.validation import suggest
from motorctl.errors import Problem
from motorctl.located_yaml import Document, KeyPath

KEY = "stop_together"


def check_groups(document: Document) -> list[Problem]:
    """Check that groups name axes that exist, several each, and no axis twice."""
    known = list(document.part(("axes",)))
    problems: list[Problem] = []
    taken: dict[str, int] = {}

    def add(message: str, *where: int) -> None:
        path: KeyPath = (KEY, *where)
        problems.append(document.problem(path, message))

    groups = document.at((KEY,))
    for number, group in enumerate(groups if isinstance(groups, list) else ()):
        if not isinstance(group, list) or not all(isinstance(name, str) for name in group):
            continue  # the keys' own check tells
        if len(set(group)) < 2:
            count = len(set(group))
            message = f"found {count} different {'axis' if count == 1 else 'axes'}, should be"
            add(f"{message} two or more; or remove the group", number)
        for place, name in enumerate(group):
            if name not in known:
                add(f"unknown axis '{name}'; {suggest(name, known)}", number, place)
            elif taken.setdefault(name, number) != number:
                message = f"axis '{name}' stands in another group already, from which it would"
                add(f"{message} stop this one's axes too; join the two groups", number, place)
    return problems


def notes_on_groups(machine: Machine) -> Iterator[str]:
    """Yield which programs move axes that go on when another axis of the program trips."""
    if machine.stop_together is None:
        return
    for name, program in machine.programs.items():
        groups = {machine.group_of(axis) or axis for axis in program.axes}
        if len(groups) > 1:
            yield (
                f"program {name} moves {', '.join(program.axes)}, which {KEY} does not stop "
                "together: when one of them trips, the others go on"
            )
