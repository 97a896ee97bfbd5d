"""Count what the house is made of, at any commit: lines, rooms, quoted effects, places of a key.

    python tools/counts.py [--key KEY] [--column COLUMN] [COMMIT …]

One column of figures a commit, and one for the files as they stand. What a residual sample passes
through is counted by `residual_walk.py`, which runs the diagnosis.
"""

from __future__ import annotations

import argparse
import io
import re
import subprocess
import tarfile
from collections import Counter
from collections.abc import Mapping
from pathlib import PurePosixPath

from effects_quoted import EFFECTS, ORDINARY_WORDS, ROOT, effect_names

Sources = Mapping[PurePosixPath, str]
"""Text of the Python and HTML files by their path in the repository."""

COUNTED = (".py", ".html")
WHEEL = "motorctl"
PAGE = re.compile(r"<!doctype html", re.IGNORECASE)
WITHOUT_VERB = re.compile(r'"""Give ')


def at(commit: str | None) -> Sources:
    """Return the files of a commit, or as they stand in the working tree."""
    if commit is None:
        listed = _git("ls-files", "--cached", "--others", "--exclude-standard").decode().split("\n")
        paths = [path for path in listed if path.endswith(COUNTED) and (ROOT / path).exists()]
        return {PurePosixPath(path): (ROOT / path).read_text("utf-8") for path in paths}
    with tarfile.open(fileobj=io.BytesIO(_git("archive", commit))) as archive:
        files = [one for one in archive if one.isfile() and one.name.endswith(COUNTED)]
        read = {one.name: archive.extractfile(one) for one in files}
        return {PurePosixPath(name): file.read().decode() for name, file in read.items() if file}


def figures(sources: Sources, key: str, column: str) -> dict[str, int]:
    """Return every figure by what it says.

    Parameters
    ----------
    sources
        The files of one state.
    key
        Of the YAML file, as it is spelt there.
    column
        Of the log, its unit included.

    Returns
    -------
    dict
        Counts of lines, files or places.
    """
    wheel = {path: text for path, text in sources.items() if path.parts[0] == WHEEL}
    code = {path: text for path, text in wheel.items() if path.suffix == ".py"}
    tests = Counter(
        path.parent for path in sources if path.parts[0] == "tests" and path.name[:5] == "test_"
    )
    rooms = Counter(path.parent for path in code)
    return {
        "lines of Python in the wheel": _lines(code),
        "of these code, without docstrings, comments and empty lines": _code_lines(code),
        "files in the wheel": len(code),
        "files in its fullest folder": max(rooms.values()),
        "files of more than 500 lines in the wheel": sum(
            text.count("\n") > 500 for text in code.values()
        ),
        "test files in the fullest folder of tests": max(tests.values(), default=0),
        "lines of Python beside the wheel, without tests": _lines(
            {
                path: text
                for path, text in sources.items()
                if path.parts[0] not in (WHEEL, "tests") and path.suffix == ".py"
            }
        ),
        "places that quote an effect's name outside its folder": _quoted(code),
        "files that begin a page of HTML": sum(bool(PAGE.search(text)) for text in wheel.values()),
        'docstrings that begin with "Give"': sum(
            len(WITHOUT_VERB.findall(text)) for text in code.values()
        ),
        f"files that spell the key {key}": _spelling(code, key),
        f"places that spell the key {key}": _places(code, key),
        f"files that spell the column {column}": _spelling(code, column),
        f"places that spell the column {column}": _places(code, column),
    }


def _lines(code: Sources) -> int:
    return sum(text.count("\n") for text in code.values())


def _code_lines(code: Sources) -> int:
    """Count lines with code; strings that are statements are words, as comments are."""
    prose = re.compile(r'^\s*[rRuU]?"""(?:.|\n)*?"""\s*$', re.MULTILINE)
    bare = re.compile(r"^\s*(#.*)?$")
    return sum(
        not bare.match(line) for text in code.values() for line in prose.sub("", text).split("\n")
    )


def _quoted(code: Sources) -> int:
    """Count strings that are just an effect's name; whatever effects there are today."""
    own = PurePosixPath(EFFECTS.relative_to(ROOT).as_posix())
    names = "|".join(name for name in effect_names() if name not in ORDINARY_WORDS)
    quoted = re.compile(rf"[\"']({names})[\"']")
    return sum(len(quoted.findall(text)) for path, text in code.items() if own != path.parent)


def _places(code: Sources, word: str) -> int:
    return sum(len(re.findall(rf"\b{re.escape(word)}\b", text)) for text in code.values())


def _spelling(code: Sources, word: str) -> int:
    return sum(bool(_places({path: text}, word)) for path, text in code.items())


def _git(*command: str) -> bytes:
    return subprocess.run(["git", *command], cwd=ROOT, check=True, capture_output=True).stdout


def main() -> None:
    """Print a table in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("commits", nargs="*", metavar="COMMIT")
    parser.add_argument("--key", default="max_acceleration_m_s2", help="of the YAML file")
    parser.add_argument("--column", default="lateness_s", help="of the log")
    options = parser.parse_args()
    names = [*options.commits, "now"]
    states = [figures(at(c), options.key, options.column) for c in (*options.commits, None)]
    print(f"| count | {' | '.join(names)} |\n|---|{'---|' * len(names)}")
    for what in states[0]:
        print(f"| {what} | {' | '.join(str(state[what]) for state in states)} |")


if __name__ == "__main__":
    main()
