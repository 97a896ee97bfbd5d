"""Files of what axes learn: one of its own for each."""

from __future__ import annotations

import os
from pathlib import Path

from motorctl.errors import Problem
from motorctl.located_yaml import Document


def check_learning_files(document: Document, directory: Path) -> list[Problem]:
    """Check that no two axes keep what they learn in one file: each would replace the other's.

    Parameters
    ----------
    document
        The configuration.
    directory
        Its folder, from which the files are seen.
    """
    problems, owners = [], dict[str, str]()
    for name in document.part(("axes",)):
        place = ("axes", name, "learning", "file")
        file = document.at(place)
        if not isinstance(file, str) or not file:
            continue
        owner = owners.setdefault(os.path.realpath(directory / file), name)
        if owner != name:
            message = (
                f"found '{file}', the file of axis '{owner}'; should be one of its own, "
                f"such as learned_{name}.json"
            )
            problems.append(document.problem(place, message))
    return problems
